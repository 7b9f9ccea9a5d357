"""What a recording is compared by where taxels beside the touches creep through the noise floor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.detect import Example, PlainRule
from taxel.detect.examples import check_examples
from taxel.detect.tares import count_loaded
from taxel.detect.training_data import training_data, unlike


def crept(seed: int, gain: float = 1.0, creep: float = 19.0) -> Example:
    """Return touches of .4 s and their labels; the last row creeps to the noise floor, and noise crosses it."""
    rng = np.random.default_rng(seed)
    begins = 150 + np.cumsum(rng.integers(150, 200, 20))
    values = 500.0 + 3.0 * rng.standard_normal((int(begins[-1]) + 300, 4, 4))
    values[:, 3] += np.linspace(0.0, creep, len(values))[:, None]
    for begin in begins:
        values[begin : begin + 80, :3, rng.integers(0, 2) :][:, :, :3] += gain * rng.uniform(400, 800)
    t = 5_000 * np.arange(len(values))
    frames = taxel.Frames(np.round(values), t, unit="counts", array=taxel.Array(4, 4))
    return Example(frames, {"contact": t[begins], "lift": t[begins + 80]}, taxel.Tare.take(frames, stop_us=500_000))


def compared(seed: int, gain: float = 1.0, creep: float = 19.0) -> tuple[str, ...]:
    """Return in what a recording differs from that of another seed."""
    rule = PlainRule("area", 2, labels=("contact", "lift"), noise_floor=100.0, unit="counts")
    training, other = check_examples([crept(seed), crept(seed + 100, gain, creep)])
    found = [taxel.detect.run(rule, example.source, tare=example.tare) for example in (training, other)]
    data = training_data([training], found[:1])
    return tuple(unlike(rule._with(training=data), other, found[1]).sensor)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_noise_and_a_creep_that_is_small_beside_the_touches_are_no_difference(seed: int) -> None:
    for creep in (14.0, 19.0):
        assert compared(seed, creep=creep) == ()
    (weak,) = compared(seed, 0.35, creep=7.0)
    ratio = float(weak.removeprefix("touches are ").removesuffix(" times as strong as in the training"))
    assert ratio == pytest.approx(0.35, abs=0.1)
    assert compared(seed, creep=120.0) == (
        "4 taxels have other readings at the end than at the beginning: a drift, or a load that stays",
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_load_in_the_rest_is_told_from_a_drift(seed: int) -> None:
    frames = crept(seed).source
    assert isinstance(frames, taxel.Frames)
    for values, count in (
        (frames.values, 0),
        (frames.values + np.linspace(200.0, 0.0, len(frames))[:, None, None], 0),
        (frames.values + np.where(frames.t < 2_000_000, 200.0, 0.0)[:, None, None], 16),
    ):
        loaded = taxel.Frames(values, frames.t, unit="counts", array=frames.array)
        assert count_loaded(loaded, taxel.Tare.take(loaded, stop_us=500_000), 20.0) == count


@pytest.mark.parametrize("seed", [1, 2])
def test_a_recording_without_labels_is_no_fault_and_an_offset_of_one_is_said(seed: int, tmp_path: Path) -> None:
    rule = PlainRule("area", 2, labels=("contact", "lift"), noise_floor=100.0, unit="counts")
    labels = []
    for k, late_ms in enumerate((0, None, 75, 0, 0)):
        example = crept(seed + k)
        assert isinstance(example.source, taxel.Frames)
        taxel.convert(example.source, tmp_path / f"{k}.npz")
        late = {label: t + 1000 * (late_ms or 0) + 15_000 * (label == "lift") for label, t in example.labels.items()}
        labels.append({} if late_ms is None else late)
    opened = [taxel.open(tmp_path / f"{k}.npz") for k in range(5)]
    found = taxel.tasks.detect(rule, opened, labels)
    assert found.each[1].remarks[0].startswith("0 labels: 40 detections count as false")
    assert [line.count("2.npz") for line in found.unreliable] == [1, 1], found.unreliable
    assert all("ms before the label, for 20 of 20 labels" in line for line in found.unreliable)
    assert found.each[1].outcome.causes == ()
    [cause, *_] = found.each[2].outcome.causes
    assert cause.arguments["shift_ms"] == pytest.approx(-82, abs=15)
