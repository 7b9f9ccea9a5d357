"""The process in which the page trains: what it answers, and how it is stopped."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from loopback import until

import taxel
from taxel._base.child_process import ChildProcess
from taxel.panel.training_process import run

from .recordings import board, mat

MODULE = "taxel.panel.training_process"


def test_steps_are_counted_and_the_last_line_is_the_result(tmp_path: Path) -> None:
    place, out = mat(tmp_path), tmp_path / "r.json"
    steps: list[tuple[str, int, int]] = []
    line = run({"recording": str(place), "open": {}, "out": str(out)}, lambda *step: steps.append(step))
    folds = [step for step in steps if step[2]]
    assert folds == [(f"fold {k + 1} of {len(folds)}", k, len(folds)) for k in range(4)]
    assert line["lines"][0].startswith("held out: ")
    assert taxel.Readout.load(out).labels == tuple(line["result"]["labels"])
    assert line["command"] == f"taxel detect RECORDING --readout {out}"


@pytest.mark.slow
@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "parent"])
def test_a_task_that_is_stopped_ends_soon_without_a_word_and_without_a_file(tmp_path: Path, how: str) -> None:
    place = board(tmp_path)
    before = set(tmp_path.iterdir())
    request = {"recording": str(place), "open": {}, "out": str(tmp_path / "r.json")}
    pipe = subprocess.PIPE
    child = ChildProcess(MODULE, line=json.dumps(request), stdout=pipe, stderr=pipe)
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
