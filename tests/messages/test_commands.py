"""What a command says of what was typed: one line, in the words of a shell."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shell import call

import taxel

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
    ("record", "--port", "0", "there.mcap"),
    ("record", "--trials", "3", "a.mcap"),
    ("record",),
    ("info",),
    ("info", "walk.npz", "--array", "6 by 6"),
    ("convert", "walk.npz"),
    ("convert", "walk.npz", "walk.xyz"),
    ("convert", "walk.npz", "walk.npz"),
    ("convert", "walk.npz", "nowhere/a.csv"),
    ("convert", "walk.npz", "a.mcap", "--compression", "gzip"),
    ("convert", "walk.npz", "a.csv", "--frames", "-3"),
    ("cut", "walk.npz", "a.npz", "--from", "99"),
    ("cut", "walk.npz", "a.csv", "--from", "2", "--to", "1"),
    ("cut", "walk.npz", "a.npz", "--rows", "1-2"),
    ("calibrate", "walk.npz"),
    ("calibrate", "walk.npz", "--load", "0"),
    ("calibrate", "walk.npz", "--load", "3", "--from", "7", "--to", "9"),
    ("calibrate", "walk.npz", "--load", "3", "--from", "99"),
    ("calibrate", "walk.npz", "--load", "3", "--to", "-1"),
    ("calibrate", "walk.npz", "--load", "3"),
    ("calibrate", "walk.npz", "--load", "3", "--load-unit", "kg"),
    ("calibrate", "walk.npz", "--from", "1"),
    ("calibrate", "walk.npz", "--loads", "loads.csv"),
    ("cut", "walk.npz", "a.npz", "-o", "b.npz"),
    ("live", "--readout", "a.json", "--readout=b.json"),
    ("record", "a.mcap", "--bogus"),
    ("bogus",),
    ("trian",),
    ("devic",),
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
    ("study", "fig6.11", "--set", "kapa=1"),
    ("study", "fig6.11", "--set", "kappa=wide"),
    ("study", "fig6.11", "--set", "realisations=0"),
    ("study", "fig6.11", "--set", "realisations=2.5"),
    ("study", "fig6.11", "--size", "huge"),
    ("study", "fig6.11", "--jobs", "0"),
    ("study", "fig6.11", "--backend", "slurm"),
    ("study", "fig6.11", "--scheduler", "tcp://127.0.0.1:1"),
]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a recording, labels and a readout that needs a tare."""
    monkeypatch.chdir(tmp_path)
    array = taxel.Array(4, 4, name="small")
    t = np.arange(0, 2_000_000, 1000)
    events = taxel.Events(t, t // 1000 % 4, t // 4000 % 4, t % 2000 == 0, array=array, intensity=40 + t // 1000 % 2)
    taxel.convert(events, "walk.npz")
    Path("labels.csv").write_text("label,t_us\ncontact,500000\n")
    Path("loads.csv").write_text("load,unit,from_s,to_s\n3,kg,1,2\n")
    readout = taxel.Readout(taxel.encode.ContactArea(), {"contact": (taxel.Neuron(tau=0.5), np.ones(10))})
    readout.save("touch.json")
    Path("there.json").write_text("{}")
    Path("there.mcap").write_bytes(b"")
    return tmp_path


def test_messages(here: Path, capsys: pytest.CaptureFixture[str], snapshot: Any) -> None:
    before = sorted(here.iterdir())
    said = {}
    for arguments in TYPED:
        code, out, error = call(capsys, *arguments)
        assert (code, out) == (2, ""), arguments
        assert error.count("\n") == 1, arguments
        assert not re.search(FOREIGN, error), error
        said[" ".join(arguments)] = error.rstrip("\n")
    assert sorted(here.iterdir()) == before, "nothing is left behind"
    assert Path("there.json").read_text() == "{}", "nothing is replaced"
    assert said == snapshot
