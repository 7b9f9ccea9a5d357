"""``python -m taxel.tasks``: what it is asked, what it answers, and how it is stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from loopback import until

import taxel
from taxel._base.child_process import ChildProcess
from taxel.tasks.__main__ import run

from .recordings import board, mat

WORDS = [sys.executable, "-P", "-m", "taxel.tasks"]


def asked(name: str, request: Any) -> tuple[dict[str, Any], list[tuple[str, int, int]]]:
    """Run a task in this process; return its last line, and its steps."""
    steps: list[tuple[str, int, int]] = []
    return run(name, request, lambda *step: steps.append(step)), steps


@pytest.mark.parametrize(
    ("name", "more", "said"),
    [
        ("trane", {}, "the task is 'trane': must be one of 'train', 'detect', 'information'"),
        (
            "train",
            {"fold": 5},
            "fold is not a key of train: must be one of recordings, open, labels, options, out, overwrite",
        ),
        (
            "train",
            {"options": {"fold": 5}},
            "fold is not a field of options: must be one of recipe, changes, tare, folds,",
        ),
        ("train", {"open": {"pitch": 5}}, "pitch is not a field of open: must be one of array, layout, topic"),
        ("train", {"options": [5]}, "options is [5]: must be a dict (names and values)"),
        ("train", {"options": {"folds": 1}}, "must be 2 or more, or 0 for none"),
        ("train", {"out": None}, "out is missing in the request"),
        ("detect", {"out": None}, "readout is missing in the request"),
        ("detect", {}, "out is not a key of detect: must be one of recordings, open, readout, truth, options"),
        ("encode", {}, "options: encoder is missing"),
        ("encode", {"options": {"encoder": "fa3"}}, "fa3"),
        ("calibrate", {"loads": [{"kg": 3}]}, "kg is not a field of loads: must be one of load, unit, from_s"),
        ("rest", {"tare": -1}, "-1: must be seconds above 0, or a file"),
        ("info", {"out": None, "tare": True}, "tare is True"),
    ],
)
def test_what_no_task_knows_is_refused_by_its_name(tmp_path: Path, name: str, more: dict[str, Any], said: str) -> None:
    request = {"recordings": [str(mat(tmp_path))], "out": str(tmp_path / "new.json"), **more}
    request = {key: value for key, value in request.items() if value is not None}
    with pytest.raises(taxel.ProblemError) as refused:
        asked(name, request)
    assert said in str(refused.value)
    assert not (tmp_path / "new.json").exists()


def test_each_task_answers_and_writes_what_it_says(tmp_path: Path) -> None:
    events, out = str(board(tmp_path)), tmp_path / "out"
    line, steps = asked("rest", {"recordings": [events], "out": str(out)})
    assert (line["result"]["source"], steps) == ("quiet", [(f"reading {events}", 0, 0)])
    assert taxel.Tare.load(out).note == events
    with pytest.raises(FileExistsError):
        asked("rest", {"recordings": [events], "out": str(out)})
    asked("rest", {"recordings": [events], "tare": 0.1, "out": str(out), "overwrite": True})
    line, steps = asked(
        "encode", {"recordings": [events], "options": {"encoder": "fa1"}, "out": str(tmp_path / "fa1.npz")}
    )
    assert len(taxel.SpikeTrains.load(tmp_path / "fa1.npz")) == line["result"]["trains"]
    assert [step[0].split()[0] for step in steps] == ["reading", "encoding"]
    line, _ = asked("info", {"recordings": [events]})
    assert (line["result"]["events"], line["result"]["warnings"]) == (len(taxel.open(events).events), [])
    request: dict[str, Any] = {"recordings": [str(mat(tmp_path))], "options": {"exponent": 1.0}}
    loads = [{"load": 9.0, "from_s": 1.0, "to_s": 1.2}]
    line, _ = asked("calibrate", {**request, "loads": loads, "out": str(tmp_path / "c.json")})
    assert taxel.Calibration.load(tmp_path / "c.json").reading_unit == line["result"]["of"] == "counts"


def test_folds_are_counted_and_the_last_line_is_the_result(tmp_path: Path) -> None:
    line, steps = asked(
        "train", {"recordings": [str(mat(tmp_path))], "options": {"folds": 3}, "out": str(tmp_path / "r")}
    )
    assert [step for step in steps if step[2]] == [(f"fold {k + 1} of 3", k, 3) for k in range(3)]
    assert line["lines"][0].startswith("held out: ")


def test_errors_are_a_line_and_an_exit_code(tmp_path: Path) -> None:
    for request, code, kind, said in (
        ("{", 2, "ProblemError", "the request is not JSON"),
        (json.dumps({"recordings": ["none.npz"], "out": "r"}), 2, "FileNotFoundError", "none.npz: no such file"),
    ):
        done = subprocess.run(
            [*WORDS, "train"], input=request, cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False
        )
        line = json.loads(done.stdout.splitlines()[-1])
        assert (done.returncode, line["type"], line["kind"], done.stderr) == (code, "error", kind, "")
        assert said in line["text"]


@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "parent"])
def test_a_task_that_is_stopped_ends_soon_without_a_word_and_without_a_file(tmp_path: Path, how: str) -> None:
    place = board(tmp_path)
    before = set(tmp_path.iterdir())
    request = {"recordings": [str(place)], "options": {"folds": 6}, "out": str(tmp_path / "r.json")}
    pipe = subprocess.PIPE
    child = ChildProcess("taxel.tasks", ["train"], line=json.dumps(request), stdout=pipe, stderr=pipe)
    with child:
        assert child.stdout is not None and child.stderr is not None  # noqa: PT018
        until(lambda: "fold" in child.stdout.readline(), 60.0)
        if how == "parent":
            child.end()
        else:
            os.kill(child.pid, getattr(signal, how))
        lines = [json.loads(line) for line in child.stdout if line.endswith("\n")]
        assert child.wait(30) == 130
        assert {line["type"] for line in lines} <= {"progress"}
        assert child.stderr.read() == ""
    assert set(tmp_path.iterdir()) == before
