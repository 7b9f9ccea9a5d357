"""The same recordings and labels from Python, the shell and the page give the same results."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.shell import run

import taxel
from taxel.panel.shown_files import Opening, ShownFiles
from taxel.panel.training import Training
from taxel.tasks import detect

from .recordings import board, mat, trials


def requests() -> Training:
    """Return what handles the page's requests about readouts."""
    return Training(Opening(), ShownFiles())


def moments(detections: list[dict[str, Any]]) -> list[tuple[str, int]]:
    """Return label and time, in the order of the detections."""
    return [(one["label"], one["t_us"]) for one in detections]


@pytest.mark.parametrize("written", [board, mat, trials])
def test_readouts_and_detections_are_the_same_from_python_the_shell_and_the_page(
    written: Callable[[Path], Path], tmp_path: Path
) -> None:
    place = written(tmp_path)
    training = taxel.train(taxel.open_all(place))
    assert training.score.found > 8
    training.readout.save(tmp_path / "python.json")
    shell = run("train", place, "-o", tmp_path / "shell.json", "--json")
    assert shell.returncode == 0, shell.stderr
    texts = {(tmp_path / f"{name}.json").read_text() for name in ("python", "shell")}
    if place.is_file():
        made = requests().train(place, tmp_path / "page.json", lambda _: None)
        texts.add((tmp_path / "page.json").read_text())
        assert made["text"].splitlines() == [*training.lines(), *(f"warning: {text}" for text in training.warnings)]
        assert made["next"] == f"taxel detect RECORDING --readout {tmp_path / 'page.json'}"
    assert len(texts) == 1
    assert json.loads(shell.stdout) == {"readout": str(tmp_path / "shell.json"), **training.to_dict()}

    readout = tmp_path / "python.json"
    found = json.loads(json.dumps(detect(training.readout, taxel.open_all(place)).to_dict()))
    assert sum(len(one["detections"]) for one in found["recordings"]) > 8
    shown = json.loads(run("detect", place, "--readout", readout, "--json").stdout)
    if place.is_dir():
        assert shown["recordings"] == found["recordings"]
        return
    rec = taxel.open(place)
    by_hand, truth = taxel.detect.run(training.readout, rec), detect(training.readout, rec, "notes")
    assert [(d.label, d.t) for d in by_hand] == moments(found["recordings"][0]["detections"])
    assert repr(taxel.detect.score(by_hand, rec.notes)) == repr(truth.each[0].outcome.score)
    [one] = found["recordings"]
    assert {key: shown[key] for key in one} == one
    labels, detections = requests().detect(place, None, readout, "better")
    assert (labels, moments(detections)) == (["contact", "lift"], moments(one["detections"]))
