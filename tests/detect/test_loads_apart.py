"""Loads of real sensors: hands that are read before they touch, feet that stand at once, ends of some kinds."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import Array, Frames, Readout, Tare
from taxel.detect import Example, Recipe, fit, judge, recipes, run, score
from taxel.detect.floors import measured_floor
from taxel.encode import SeparateLoads, TouchEnds

SKIN, HZ = (8, 16), 50


def skin(seed: int, *, near: float, touches: int = 24) -> Example:
    """Return taps and strokes on a capacitive skin, which reads a hand `near` (in counts) before and after it touches.

    A tap has a label at its begin, a stroke at its begin and its end.
    """
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[: SKIN[0], : SKIN[1]]
    labels: dict[str, list[int]] = {"stroke_begin": [], "stroke_end": [], "tap": []}
    at, loads = 2 * HZ, []
    for kind in rng.permutation(["tap", "stroke"] * (touches // 2)):
        last = round((rng.uniform(0.1, 0.2) if kind == "tap" else rng.uniform(0.8, 2.0)) * HZ)
        loads.append((at, last, rng.uniform([1, 2], [6, 13]), rng.uniform(600.0, 1500.0)))
        labels["tap" if kind == "tap" else "stroke_begin"].append(at)
        if kind == "stroke":
            labels["stroke_end"].append(at + last)
        at += last + int(rng.integers(HZ, 2 * HZ))
    values = rng.normal(3000.0, 10.0, (at + HZ, *SKIN))
    for begin, last, place, force in loads:
        around = np.hypot(row - place[0], column - place[1])
        before, after = rng.integers(5, 10, 2)
        values[begin - before : begin + last + after] += near * rng.uniform(0.5, 1.0) * np.exp(-((around / 3) ** 2))
        values[begin : begin + last] += force * np.exp(-((around / 1.5) ** 2))
    t = np.arange(len(values)) * (1_000_000 // HZ)
    frames = Frames(np.rint(values), t, unit="counts", array=Array(*SKIN))
    jitter = {
        label: t[times] + np.rint(rng.normal(0.0, 8000.0, len(times))).astype(int) for label, times in labels.items()
    }
    return Example(frames, jitter, Tare.take(frames, stop_us=1_800_000))


def trained(examples: list[Example], changes: dict[str, object] | None = None) -> Readout:
    labels = sorted({label for example in examples for label in example.labels})
    recipe = recipes.fitting(examples[0].source, labels)
    return fit(examples, Recipe.load(recipe, changes, labels, measured_floor(examples)))


def floors(readout: Readout) -> set[float]:
    return {part.noise_floor for part in readout.encoder._each()}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_hand_that_is_read_before_it_touches_raises_the_floor(seed: int) -> None:
    learnt, unseen = skin(seed, near=110.0), skin(seed + 50, near=110.0)
    readout = trained([learnt])
    (floor,) = floors(readout)
    assert floor in {2.0 * measured_floor([learnt]), 4.0 * measured_floor([learnt])}
    result = score(run(Readout.from_json(readout.to_json()), unseen.source, tare=unseen.tare), unseen.labels, 50.0)
    assert result.rank[0] <= 2, result


def test_each_fold_raises_the_floor_by_its_own_labels() -> None:
    examples = [skin(seed, near=110.0, touches=12) for seed in (1, 2, 3)]
    labels = sorted(examples[0].labels)
    floor = measured_floor(examples)
    held_out = judge(examples, Recipe.load("touch", None, labels, floor), 3).together
    assert held_out.rank[0] <= 3, held_out


def test_the_floor_of_the_noise_stays_where_touches_begin_at_their_labels_and_a_stated_one_always() -> None:
    learnt = skin(1, near=0.0)
    assert floors(trained([learnt])) == {measured_floor([learnt])}
    near = skin(1, near=110.0)
    parts = ("area", "levels", "changes", "load", "moments", "later", "places", "ends", "lifts", "separate")
    stated = {f"encoders.{part}.noise_floor": 90.0 for part in parts}
    assert floors(trained([near], stated)) == {90.0}


def test_the_end_of_a_stroke_beside_taps_is_the_time_of_its_detection() -> None:
    learnt, unseen = skin(4, near=0.0), skin(5, near=0.0)
    readout = trained([learnt])
    ends = readout.encoder_of("stroke_end")
    assert isinstance(ends, TouchEnds)
    assert ends.at_end
    found = run(readout, unseen.source, tare=unseen.tare)
    assert score(found, unseen.labels, 50.0).rank[0] == 0
    of_ends = found[found.label == "stroke_end"]
    assert (of_ends.known - of_ends.t <= 1_000_000 // HZ).all()
    stream = readout.stream(unseen.source.array, frame_us=1e6 / HZ, tare=unseen.tare)
    live = []
    for piece in np.array_split(np.arange(len(unseen.source)), 37):
        live += list(stream.push(unseen.source[piece[0] : piece[-1] + 1]))
    live += list(stream.advance(int(unseen.source.t[-1]) + 1_000_000))
    assert [(d.label, d.t, d.known) for d in live] == [(d.label, d.t, d.known) for d in found]


def walk(seed: int, *, rate_hz: int = 100, unit: str = "kPa") -> Example:
    """Return three steps on one plate, each of which begins before the one before ends: heel first, toes last."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:14, :48]
    at, labels = rate_hz, {"contact": [], "lift": []}
    values = np.abs(rng.normal(0.0, 0.4, (5 * rate_hz, 14, 48)))
    for k in range(3):
        stance, heel = round(rng.uniform(0.6, 0.8) * rate_hz), 3 + 15 * k
        side = (4, 9)[k % 2]
        for frame in range(stance):
            share = frame / stance
            first, last = (0 if share < 0.6 else round(20 * (share - 0.6))), round(min(9.0, 3 + 14 * share))
            arch = (column - heel > 3) & (column - heel < 6)
            foot = (np.abs(row - side) <= 1) & (column >= heel + first) & (column <= heel + last) & ~arch
            values[at + frame][foot] += rng.uniform(60.0, 120.0)
        labels["contact"].append(at)
        labels["lift"].append(at + stance)
        at += round(stance - rng.uniform(0.1, 0.18) * rate_hz)
    t = np.arange(len(values)) * (1_000_000 // rate_hz)
    frames = Frames(values, t, unit=unit, array=Array(14, 48, 10.0))
    return Example(frames, {label: t[times] for label, times in labels.items()}, Tare.take(frames, stop_us=800_000))


def test_steps_that_overlap_on_one_plate_are_loads_of_their_own() -> None:
    learnt, unseen = [walk(seed) for seed in range(8)], [walk(seed) for seed in range(20, 28)]
    readout = trained(learnt)
    assert all(isinstance(readout.encoder_of(label), SeparateLoads) for label in ("contact", "lift"))
    for example in unseen:
        found = run(Readout.from_json(readout.to_json()), example.source, tare=example.tare)
        assert score(found, example.labels, 50.0).rank[0] == 0
