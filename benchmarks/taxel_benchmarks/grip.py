"""What happens within a touch: an object that a gripper lifts, that slips, and that is placed.

A drawn gripper: two fingertips of 5 x 4 taxels with three axes each, at 83 Hz, with a rest that drifts, a dead
taxel and lost lines. One pair of fingertips grasps, tries and bumps for a minute a recording: eight recordings are
learnt, five of other seeds judged, within 50 ms, from all 120 values.

Peer: none. Unit: missed and false, as a share of the labels of a name. Goal: what the best of all rules reached in a
trial on all axes, 9 of 45 lifts, 27 of 45 placements and 7 of 26 slips.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Array, Frames, Tare
from taxel.detect import Example, Recipe, fit, score
from taxel.detect import run as detect
from taxel_benchmarks._goals import Goal, at_most

#: Missed and false, of the labels of each name.
MOST = {"lift": 9 / 45, "place": 27 / 45, "slip": 7 / 26}
LEARNT, JUDGED = range(101, 109), range(201, 206)
ROWS, COLUMNS, HZ, SECONDS, NOISE = 5, 4, 83.0, 60.0, 15.0
#: The pair of fingertips, and its dead taxel: finger, row, column.
FINGERTIPS, DEAD = 7, (0, 1, 3)
WINDOW_MS = 50.0
NAMES = [f"{finger}{k}_{axis}" for finger in "lr" for k in range(ROWS * COLUMNS) for axis in "xyz"]
ARRAY = Array(1, len(NAMES), name="gripper", names=NAMES)

Column = NDArray[np.float64]


def smooth(t: Column, begin: float, lasts: float) -> Column:
    """Return what rises from 0 to 1 within a time, with no slope at its ends."""
    part = np.clip((t - begin) / lasts, 0.0, 1.0)
    return np.asarray(part * part * (3.0 - 2.0 * part))


def spot(row: Column, column: float, width: float) -> NDArray[np.float64]:
    """Return what part of a load each taxel takes, of shape (times, rows, columns)."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    shape = np.exp(-((y - row[:, None, None]) ** 2 + (x - column) ** 2) / (2.0 * width**2))
    return np.asarray(shape / shape.sum(axis=(1, 2), keepdims=True))


class Drawn:
    """A recording as it is drawn: values of shape (times, fingers, rows, columns, axes), and labels."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        fingertips = np.random.default_rng(FINGERTIPS)
        n = int(SECONDS * HZ)
        self.t = np.cumsum(self.rng.normal(1.0 / HZ, 0.0007, n).clip(0.004, 0.03))
        self.t -= self.t[0]
        shape = (2, ROWS, COLUMNS, 3)
        rest = fingertips.normal(0.0, 250.0, shape)
        self.gain = fingertips.normal(1.0, 0.12, shape[:3])
        # Both drift: a finger by its temperature, and each taxel.
        walk = 0.35 * np.cumsum(self.rng.normal(0.0, 1.0, (n, 2, 1, 1, 3)), axis=0)
        drift = np.linspace(0.0, 1.0, n).reshape(-1, 1, 1, 1, 1) * self.rng.normal(0.0, 45.0, shape)
        self.values = rest + walk + drift
        self.labels: list[tuple[str, float]] = []
        now = 1.5 + self.rng.uniform(0.0, 1.0)
        kinds: list[Callable[[float], float]] = [self.bump, self.attempt, *[self.grasp] * 5]
        while now < SECONDS - 7.5:
            now = kinds[int(self.rng.integers(len(kinds)))](now)

    def add(self, finger: int, where: NDArray[np.float64], forces: Mapping[int, Column]) -> None:
        """Load a finger with forces along axes."""
        for axis, force in forces.items():
            self.values[:, finger, :, :, axis] += force[:, None, None] * where * self.gain[finger]

    def bump(self, now: float) -> float:
        """Touch something with one finger for a moment; return when the next begins."""
        draw, finger = self.rng.uniform, int(self.rng.integers(2))
        force, lasts = draw(400.0, 1500.0), draw(0.15, 0.5)
        where = spot(np.full(len(self.t), draw(1.0, 3.0)), draw(0.8, 2.2), draw(0.7, 1.1))
        on = force * smooth(self.t, now, 0.05) * (1.0 - smooth(self.t, now + lasts, 0.06))
        self.add(finger, where, {2: on, 1: 0.3 * on})
        return float(now + lasts + 0.06 + draw(1.0, 2.0))

    def attempt(self, now: float) -> float:
        """Close and open again, without lifting."""
        return self.grasp(now, lifts=False)

    def grasp(self, now: float, lifts: bool = True) -> float:
        """Close, lift, slip or not, place, open; return when the next begins."""
        draw, t = self.rng.uniform, self.t
        grip, weight, close = draw(1500.0, 6000.0), draw(300.0, 1200.0), draw(0.06, 0.16)
        lift = now + close + draw(0.4, 0.9)
        place = lift + draw(1.0, 2.8) if lifts else lift
        slips: list[float] = []
        for _ in range(int(self.rng.integers(0, 3)) if lifts else 0):
            at = draw(lift + 0.45, place - 0.45)
            if all(abs(at - other) > 0.5 for other in slips):
                slips.append(at)
        release, opening = place + (draw(0.35, 0.8) if lifts else 0.3), draw(0.06, 0.14)
        on = 1.0 - smooth(t, release, opening)
        held = float(lifts) * smooth(t, lift, draw(0.05, 0.12)) * (1.0 - smooth(t, place, draw(0.04, 0.08)))
        # A slip takes shear away, shakes, moves the spot, and is answered by more force.
        boost, left, shift, shakes = np.ones(len(t)), np.ones(len(t)), np.zeros(len(t)), np.zeros(len(t))
        for at in slips:
            lasts = draw(0.08, 0.25)
            during = (t >= at) & (t < at + lasts)
            left *= 1.0 - draw(0.2, 0.45) * (smooth(t, at, 0.03) - smooth(t, at + lasts, 0.06))
            shakes[during] += self.rng.normal(0.0, 0.10, int(during.sum()))
            shift += draw(0.3, 0.9) * smooth(t, at, lasts)
            boost += draw(0.15, 0.4) * smooth(t, at + 0.09, 0.08)
        since = np.clip(t - place, 0.0, None)
        rings = float(lifts) * draw(0.1, 0.25) * np.exp(-since / 0.03) * np.cos(2 * np.pi * 25.0 * since) * (t >= place)
        creeps = 0.04 * (t > release) * np.exp(-np.clip(t - release, 0.0, None) / 0.8)
        sways = 40.0 * np.sin(2 * np.pi * draw(0.6, 1.5) * (t - now) + draw(0.0, 6.0)) * held
        late = self.rng.permutation([0.0, draw(0.0, 0.04)])
        for finger in range(2):
            where = spot(draw(1.2, 2.8) + shift, draw(0.9, 2.1), draw(0.8, 1.3))
            closed = smooth(t, now + late[finger], close)
            trembles = 1.0 + 0.01 * np.sin(2 * np.pi * 7.0 * t) * held
            normal = grip * (closed * on * boost + creeps) * trembles
            along = (weight / 2 * (held * left + shakes + rings) + sways / 2) * on
            across = 0.05 * grip * closed * on * self.rng.normal() + 0.3 * sways + 0.15 * weight * shakes
            self.add(finger, where, {2: normal + 0.04 * along, 1: along, 0: across})
        if lifts:
            self.labels += [("lift", lift), *(("slip", at) for at in slips), ("place", place)]
        return float(release + opening + draw(0.9, 2.0))

    def example(self) -> Example:
        """Return what is read, with lost lines and one gap, and the rest of its first second."""
        self.values += self.rng.normal(0.0, NOISE, self.values.shape)
        self.values[:, *DEAD] = 0.0
        kept = self.rng.random(len(self.t)) > 0.01
        gap = int(self.rng.integers(len(kept) // 3, len(kept) - 200))
        kept[gap : gap + int(self.rng.integers(10, 30))] = False
        kept[0] = True
        stamps = np.rint(1e6 * self.t[kept]).astype(np.int64)
        values = np.rint(self.values[kept]).reshape(len(stamps), *ARRAY.shape)
        frames = Frames(values, stamps, unit="counts", array=ARRAY)
        labels = {name: np.array([round(1e6 * at) for of, at in self.labels if of == name], np.int64) for name in MOST}
        return Example(frames, labels, Tare.take(frames, stop_us=1_000_000))


def shares(labels: Mapping[str, Mapping[str, int]]) -> dict[str, float]:
    """Return how many are missed and false of each label, as a share of the labels."""
    return {name: (one["missed"] + one["false"]) / one["events"] for name, one in labels.items() if one["events"]}


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    reached = shares(result.get("labels", {}))
    return at_most({name: MOST[name] for name in reached}, reached)


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return what is missed and false of each label."""
    learnt, judged = (LEARNT[:2], JUDGED[:1]) if quick else (LEARNT, JUDGED)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        recipe = Recipe.load("grip", labels=tuple(MOST), noise_floor=6.0 * NOISE)
        readout = fit([Drawn(seed).example() for seed in learnt], recipe, window_ms=WINDOW_MS)
    labels = {label: {"events": 0, "missed": 0, "false": 0} for label in MOST}
    for seed in judged:
        unseen = Drawn(seed).example()
        assert isinstance(unseen.source, Frames)
        found = score(detect(readout, unseen.source, tare=unseen.tare), unseen.labels, WINDOW_MS)
        for label, one in found.by_label.items():
            for key in labels[label]:
                labels[label][key] += getattr(one, key)
    ratios = {f"{name}, missed and false": share for name, share in shares(labels).items()}
    rules = {label: repr(rule) for label, rule in readout.rules.items()}
    return {"ratios": ratios, "labels": labels, "by rule": list(readout.by_rule), "rules": rules}
