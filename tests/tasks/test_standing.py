"""An object that lies on a mat all the time, or a channel that sticks, is said in place of loads that overlap."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.tasks import DetectOptions, detect

HZ = 50


def pressed(seed: int, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray, dict[str, list[int]]]:
    """Return 20 presses in N, their times, us, and when each begins and ends."""
    random = np.random.default_rng(seed)
    begins = HZ + np.cumsum(random.integers(50, 80, 20))
    values = np.abs(0.2 * random.standard_normal((begins[-1] + 2 * HZ, *shape)))
    for begin in begins:
        place = slice(0, 3) if shape[0] > 1 else slice(None)
        values[begin : begin + 30, place] += 40
    t = np.arange(len(values)) * (1_000_000 // HZ)
    return values, t, {"contact": t[begins].tolist(), "lift": t[begins + 30].tolist()}


def said(
    place: Path, rule: taxel.detect.PlainRule, values: np.ndarray, t: np.ndarray, labels: dict[str, list[int]]
) -> list[taxel.detect.cause.Cause]:
    frames = taxel.Frames(np.round(values, 1), t, unit="N", array=taxel.Array(*values.shape[1:]))
    taxel.convert(frames, place / "a.npz", overwrite=True)
    [each] = detect(rule, taxel.open(place / "a.npz"), [labels]).each
    return list(each.outcome.causes)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_tare_that_takes_off_what_lies_there_is_advised_after_a_trial(tmp_path: Path, seed: int) -> None:
    rule = taxel.detect.PlainRule("area", 2, noise_floor=5.0)
    values, t, labels = pressed(seed, (8, 8))
    assert said(tmp_path, rule, values, t, labels) == []
    values[:, 5:7, 1:4] += 25
    [cause] = said(tmp_path, rule, values, t, labels)
    assert (cause.kind, set(cause.labels)) == ("standing_load", {"contact", "lift"})
    assert "an object is on the sensor from beginning to end, at rows 5 to 6, columns 1 to 3 (up to 2" in cause.measured
    assert "; tried with it: 40 found and 0 false, instead of " in cause.measured
    option, seconds = cause.option.split()
    assert (option, cause.arguments) == ("--tare", {"tare": float(seconds)})
    tared = DetectOptions(tare=cause.arguments["tare"])
    [each] = detect(rule, taxel.open(tmp_path / "a.npz"), [labels], tared).each
    assert each.outcome.score is not None
    assert (each.outcome.score.found, each.outcome.score.false, each.outcome.causes) == (40, 0, ())


@pytest.mark.parametrize("seed", [3, 4])
def test_a_channel_that_sticks_is_no_two_loads(tmp_path: Path, seed: int) -> None:
    rule = taxel.detect.PlainRule("peak", 20, noise_floor=1.0)
    values, t, labels = pressed(seed, (1, 6))
    values[300:, 0, int(np.random.default_rng(seed).integers(6))] = 150
    causes = said(tmp_path, rule, values, t, labels)
    assert "standing_load" in [cause.kind for cause in causes]
    assert not any("source or region for each load" in cause.advice for cause in causes)
    assert any("reads 150 N from 6.0 s to the end" in cause.measured for cause in causes)


@pytest.mark.parametrize("seed", [1, 2])
def test_another_tare_is_not_advised_where_somebody_stays_on_a_mattress(tmp_path: Path, seed: int) -> None:
    random, rate = np.random.default_rng(seed), 10
    turns = 100 + np.cumsum(random.integers(60, 120, 8))
    values = np.abs(random.normal(0, 0.3, (int(turns[-1]) + 100, 16, 12)))
    for begin, end in zip([0, *turns], [*turns, len(values)], strict=True):
        left = int(random.integers(1, 5))
        values[begin:end, 2:14, left : left + 6] += random.uniform(10, 40, (12, 6))
    t = np.arange(len(values)) * (1_000_000 // rate)
    frames = taxel.Frames(np.round(values), t, unit="mmHg", array=taxel.Array(16, 12))
    taxel.convert(frames, tmp_path / "night.npz")
    labels = [{"turn": t[turns].tolist()}]
    training = taxel.train(taxel.open(tmp_path / "night.npz"), labels, taxel.tasks.TrainOptions(labels_as_given=True))
    cause, *_ = training.causes
    assert (cause.kind, cause.advice, cause.option) == ("standing_load", "", "")
    assert "tare of such a time does not help (with a tare of " in cause.measured
    assert not any("--tare" in line for line in (*training.lines(), *training.warnings))
    found = detect(training.readout, taxel.open(tmp_path / "night.npz"), labels)
    assert found.warnings == (), "a tare that was tried is not a given one"
