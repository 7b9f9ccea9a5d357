"""Training on a sensor of one's own: frames of a grid in any unit, with an offset and noise of each taxel."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from shell import call

import taxel
from taxel import Array, Frames, Tare
from taxel.detect import Example, recipes, run, score
from taxel.detect.floors import measured_floor

LABELS = ("contact", "lift")


def touched(
    shape: tuple[int, int], seed: int, *, gain: float, noise: float, offset: float = 0.0, begin_s: float = 1.0
) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return frames at 100 Hz of 12 touches anywhere, and when they begin and end."""
    random = np.random.default_rng(seed)
    count, period = 12, 100
    first = round(100 * begin_s)
    values = random.normal(offset, offset / 20, shape) + random.normal(0, noise, (first + count * period, *shape))
    y, x = np.mgrid[: shape[0], : shape[1]]
    starts = first + period * np.arange(count) + random.integers(0, 20, count)
    stops = starts + random.integers(30, 60, count)
    for start, stop in zip(starts, stops, strict=True):
        at = [random.uniform(1, side - 2) for side in shape]
        values[start:stop] += gain * random.uniform(0.3, 1) * np.exp(-((y - at[0]) ** 2 + (x - at[1]) ** 2) / 3)
    times = np.arange(len(values)) * 10_000
    return Frames(values, times, unit="counts", array=Array(*shape)), {"contact": times[starts], "lift": times[stops]}


def written(folder: Path, frames: Frames, labels: dict[str, np.ndarray], more: str = "") -> tuple[object, ...]:
    """Write a recording and its labels, and return the arguments of a training."""
    taxel.convert(frames, folder / "own.npz")
    rows = [f"{label},{t}" for label, times in labels.items() for t in times]
    (folder / "labels.csv").write_text("\n".join(["label,t_us", *rows]) + "\n" + more)
    return ("train", folder / "own.npz", "--labels", folder / "labels.csv", "-o", folder / "readout.json")


@pytest.mark.parametrize(
    ("shape", "values"),
    [
        pytest.param((24, 32), {"gain": 1200.0, "noise": 6.0, "offset": 3000.0}, marks=pytest.mark.slow),
        pytest.param((16, 16), {"gain": 0.8, "noise": 0.006, "offset": 0.2}, marks=pytest.mark.slow),
        ((8, 8), {"gain": 200.0, "noise": 1.0, "offset": 10.0}),
    ],
)
def test_a_plain_training_finds_the_touches_of_any_grid(
    tmp_path: Path, capsys, shape: tuple[int, int], values: dict[str, float]
) -> None:
    code, out, error = call(capsys, *written(tmp_path, *touched(shape, 1, **values)))
    assert code == 0, error
    lines = out.splitlines()
    assert lines[0] == "held out: 5 blocks of time of one recording (window 50 ms)"
    for line, label in zip(lines[1:4:2], LABELS, strict=True):
        assert re.match(rf"{label}: \w+ runs: [01] mistakes? of 12 \(", line), line
    assert "recipe touch" in out
    unseen, truth = touched(shape, 2, **values)
    tare = Tare.take(unseen, stop_us=900_000)
    again = score(run(taxel.Readout.load(tmp_path / "readout.json"), unseen, tare=tare), truth)
    assert again.missed + again.false <= 1


def test_the_floor_scales_with_the_unit_and_not_with_a_bad_taxel() -> None:
    frames, labels = touched((6, 6), 3, gain=100.0, noise=1.0)
    values = frames.values.astype(float)
    values[:, 2, 3] *= 40

    def floor(values: np.ndarray, unit: str = "counts") -> float | None:
        frames_of = Frames(values, frames.t, unit=unit, array=frames.array)
        return measured_floor([Example(frames_of, labels, Tare.take(frames_of, stop_us=900_000))])

    alone = floor(frames.values)
    assert alone == pytest.approx(6.0, rel=0.25)
    assert floor(frames.values * 0.001) == pytest.approx(alone / 1000, rel=0.01)
    assert floor(values) < 3 * alone
    assert floor(frames.values, "ticks") is None, "a board's registers state it"
    assert measured_floor([Example(frames, labels)]) is None


@pytest.mark.parametrize(
    ("labels", "unit", "shape", "recipe"),
    [
        (("contact", "lift"), "counts", (2, 2), "touch"),
        (("contact",), "V", (2, 2), "touch"),
        (("contact", "foot_off"), "counts", (2, 2), "gait_plate"),
        (("contact", "lift"), "V", (1, 4), "touch"),
        (("press", "release"), "N", (1, 1), "touch"),
        (("contact", "lift", "slip"), "V", (1, 4), "grip"),
        (("press", "tap"), "counts", (1, 1), "touch"),
        (("left foot", "right foot"), "V", (1, 16), "gait_channel"),
        (("soft", "hard"), "V", (3, 11), "touch"),
        (("contact", "lift", "slip"), "counts", (4, 8), "grip"),
        (("tap",), "N", (1, 16), "gait_insole"),
        (("contact", "lift", "soft", "hard"), "N", (4, 8), "touch"),
        (("heel strike", "toe-off"), "counts", (16, 16), "gait_plate"),
        (("footfall",), "counts", (16, 16), "gait_plate"),
        (("soft", "hard"), "V", (1, 64), "touch"),
        (("contact", "foot_off"), "kPa", (16, 16), "touch"),
        (("links Erstkontakt", "links Zehenablösung"), "kPa", (16, 16), "touch"),
        (("Erstkontakt", "Zehenablösung"), "N", (1, 12), "gait_insole"),
        (("contact", "heel_off", "foot_off"), "kPa", (4, 8), "gait_channel"),
        ((), "counts", (2, 2), "gait_plate"),
    ],
)
def test_labels_and_neighbours_choose_the_recipe(
    labels: tuple[str, ...], unit: str, shape: tuple[int, int], recipe: str
) -> None:
    assert recipes.chosen(Frames(np.zeros((1, *shape)), [0], unit=unit, array=Array(*shape)), labels)[0] == recipe
