"""What a command says of what was typed: one line, in the words of a shell."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from shell import call
from test_command_line import here  # noqa: F401  a fixture

#: Words of parsers and of Python that no message to a user should contain.
FOREIGN = r"unable to parse|Traceback|_core|overwrite=|NoneType|Input should be|taxel\.[A-Z]"
TYPED = [
    ("record", "--array", "8", "a.mcap"),
    ("record", "--port", "70000", "a.mcap"),
    ("record", "--port", "x", "a.mcap"),
    ("record", "--seconds", "x", "a.mcap"),
    ("record", "--port=", "a.mcap"),
    ("record", "--port"),
    ("emulate", "--fault", "lost=2"),
    ("emulate", "--flaw", "dead=1.5"),
    ("emulate", "--circuit", "gain=-1"),
    ("demo", "--scenes", "-3"),
    ("cut", "walk.npz", "-o", "b.npz", "--from", "40000000.5", "--to", "2"),
    ("record", "--port", "0", "nowhere/a.mcap"),
    ("emulate", "--truth", "nowhere/x.csv"),
    ("info", "nowhere/a.mcap"),
    ("info", "none.mcap"),
    ("info", "walk.npz", "--tare", "0,5"),
    ("record", "--compression", "x", "a.mcap"),
    ("record", "--host", "no such host", "a.mcap"),
    ("record", "--preset", "9 kHz", "a.mcap"),
    ("record", "there.mcap"),
    ("record", "--trials", "3", "a.mcap"),
    ("record",),
    ("convert", "walk.npz"),
    ("cut", "walk.npz", "a.npz", "-o", "b.npz"),
    ("live", "--readout", "a.json", "--readout=b.json"),
    ("record", "a.mcap", "--bogus"),
    ("bogus",),
    ("trian",),
    ("encode", "walk.npz", "s.npz", "--encoder", "level_crossing", "--set", "levels=40"),
    ("encode", "walk.npz", "s.npz", "--encoder", "level_crossing"),
    ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "alpha=soon"),
    ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "alpha=[1]"),
    ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "wings=2"),
    ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "decay=s"),
    ("encode", "walk.npz", "s.npz", "--encoder", "contact_area"),
    ("encode", "walk.npz", "nowhere/s.npz", "--encoder", "fa1"),
    ("detect", "walk.npz", "--readout", "touch.json", "--tare", "0.1", "--frame-us", "-5"),
    ("live", "--readout", "touch.json", "--tare", "5000"),
    ("train", "walk.npz", "--labels", "labels.csv", "-o", "nowhere/x.json"),
    ("train", "walk.npz", "--labels", "labels.csv", "-o", "there.json"),
    ("study", "fig6.1", "--set", "kappa"),
]


def test_messages(here: Path, capsys: pytest.CaptureFixture[str], snapshot: Any) -> None:  # noqa: F811
    before = sorted(here.iterdir())
    said = {}
    for arguments in TYPED:
        code, out, error = call(capsys, *arguments)
        assert (code, out) == (2, ""), arguments
        assert error.count("\n") == 1, arguments
        assert not re.search(FOREIGN, error), error
        said[" ".join(arguments)] = error.rstrip("\n")
    assert sorted(here.iterdir()) == before, "nothing is left behind"
    assert said == snapshot
