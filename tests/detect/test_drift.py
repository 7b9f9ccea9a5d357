"""Loads of a recording are compared with those of the training, which a readout's file keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from shell import call
from touching import pressed

import taxel
from taxel import Tare
from taxel.detect import Example, drift, load
from taxel.detect.examples import check_examples
from taxel.tasks import TrainOptions


def example(seed: int, gain: float = 1.0) -> Example:
    frames, labels = pressed(seed, 25)
    stronger = taxel.Frames(50.0 + gain * (frames.values - 50.0), frames.t, unit=frames.unit, array=frames.array)
    [checked] = check_examples([Example(stronger, labels, Tare.take(stronger, stop_us=900_000))])
    return checked


@pytest.mark.parametrize(("gain", "differs"), [(1.0, False), (3.0, True)])
def test_features_that_differ_from_the_training_are_named(gain: float, differs: bool) -> None:
    nothing = taxel.detect.score(taxel.Detections([], [], []), {"contact": [1000]})
    data = drift.training_data([example(1)], nothing)
    said = drift.lines(data, drift.of_loads([example(2, gain)], data["noise_floor"]))
    assert bool(said) == differs
    for line in said:
        assert "sum " in line
        assert "taxels" not in line
        assert len(line) <= 160


def test_a_readout_keeps_its_training_and_the_report_draws_both(tmp_path: Path, capsys) -> None:
    frames, labels = pressed(1, 25)
    taxel.convert(frames, tmp_path / "a.npz")
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [labels], TrainOptions(folds=0))
    readout = load(training.readout.save(tmp_path / "r.json"))
    data = readout._parts["training"]
    assert set(data["error_ms"]) == {"contact", "lift"}
    assert data["loads"]["sum"]["count"] == 25
    assert np.all(np.diff(data["loads"]["sum"]["values"]) >= 0)
    rows = "".join(f"{label},{t}\n" for label, times in labels.items() for t in times)
    (tmp_path / "a.csv").write_text(f"label,t_us\n{rows}")
    arguments = ("detect", tmp_path / "a.npz", "--readout", tmp_path / "r.json", "--truth", tmp_path / "a.csv")
    code, _, error = call(capsys, *arguments, "--report", tmp_path / "page")
    assert code == 0, error
    page = (tmp_path / "page" / "report.html").read_text()
    assert page.count("detection minus label, ms") == 1
    assert page.count("from begin to begin, ms") == 1
