"""Touches that load one taxel, two apart or many, on 1 to 256 taxels: trainings beside the tuned plain rule.

Each case is a drawn recording at 100 Hz: a number of taxels (1, 4, 16, 64, 256), a unit (counts, N, kPa: another size
of the noise, and what lies below 0 is cut off in N and kPa), touches of so many times the noise (8, 30, 100) that load
one taxel, two that are no neighbours, or half of the taxels for .15 to .4 s. The recipe `touch` learns contact and lift
from 30 touches; 60 others of another seed are judged, within 50 ms, by what it writes (of each label the neuron or the
rule) and by the plain rule that is tuned on the same 30 (by peak in nearly all cases). Both have a noise floor of six
standard deviations.

Peer: the plain rule. Unit: contacts and lifts missed and false, of 120. Goal: at most the rule's and 2 % of the
labels in each case.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from taxel import Array, Frames, Tare
from taxel.detect import Example, Recipe, fit, score, tune
from taxel.detect import run as detect
from taxel.detections import Detections
from taxel_benchmarks._goals import Goal, at_most

LABELS = ("contact", "lift")
HZ, WINDOW_MS, SHARE = 100, 50.0, 0.02
LEARNT, JUDGED = 30, 60
#: Rows and columns, and what the noise is in each unit.
SHAPES = {1: (1, 1), 4: (2, 2), 16: (4, 4), 64: (8, 8), 256: (16, 16)}
NOISE = {"counts": 2.0, "N": 0.02, "kPa": 0.5}
TIMES = (8.0, 30.0, 100.0)
LOADED = ("one", "two apart", "many")
SEED = 4801


class Case(NamedTuple):
    """A sensor, and how large and how wide its touches are."""

    taxels: int
    unit: str
    times: float
    loaded: str

    def __str__(self) -> str:
        return f"{self.taxels} taxels, {self.unit}, {self.times:g} x noise, {self.loaded} loaded"


def cases() -> Iterator[Case]:
    """Yield each case that the number of taxels allows."""
    for taxels in SHAPES:
        for unit in NOISE:
            for times in TIMES:
                for loaded in LOADED:
                    # Two taxels of 2 x 2 are always neighbours.
                    if loaded == "one" or taxels >= (16 if loaded == "two apart" else 4):
                        yield Case(taxels, unit, times, loaded)


def places(case: Case, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return which taxels a touch loads."""
    rows, columns = SHAPES[case.taxels]
    first = int(rng.integers(rows)), int(rng.integers(columns))
    if case.loaded == "one":
        return [first]
    if case.loaded == "two apart":
        apart = [(y, x) for y in range(rows) for x in range(columns) if max(abs(y - first[0]), abs(x - first[1])) > 1]
        return [first, apart[int(rng.integers(len(apart)))]] if apart else places(case, rng)
    height, width = max(1, rows * 3 // 4), max(2, columns * 2 // 3)
    top, left = int(rng.integers(rows - height + 1)), int(rng.integers(columns - width + 1))
    return [(y, x) for y in range(top, top + height) for x in range(left, left + width)]


def drawn(case: Case, touches: int, seed: int) -> Example:
    """Return a recording of a case with its labels; it begins with 2 s of rest."""
    rng = np.random.default_rng([SEED, seed, case.taxels, int(case.times), *map(ord, case.unit + case.loaded)])
    noise = NOISE[case.unit]
    begins = 2 * HZ + np.arange(touches) * 90 + rng.integers(0, 20, touches)
    lasts = rng.integers(15, 40, touches)
    values = rng.normal(0.0, noise, (int(begins[-1]) + 2 * HZ, *SHAPES[case.taxels]))
    for begin, last in zip(begins, lasts, strict=True):
        for y, x in places(case, rng):
            values[begin : begin + last, y, x] += case.times * noise
    values = np.rint(values + 40.0) if case.unit == "counts" else np.maximum(values, 0.0)
    t = np.arange(len(values)) * (1_000_000 // HZ)
    frames = Frames(values, t, unit=case.unit, array=Array(*SHAPES[case.taxels], name="drawn"))
    labels = {"contact": t[begins], "lift": t[begins + lasts]}
    return Example(frames, labels, Tare.take(frames, stop_us=1_900_000))


def wrong(found: Detections, unseen: Example) -> dict[str, int]:
    """Return how many of an example's labels are missed, and how many detections are false."""
    scored = score(found, unseen.labels, WINDOW_MS)
    return {"missed": scored.missed, "false": scored.false}


def compared(case: Case) -> dict[str, Any]:
    """Train and tune on 30 touches, and judge both on 60 others."""
    learnt, unseen = drawn(case, LEARNT, 1), drawn(case, JUDGED, 2)
    floor = 6 * NOISE[case.unit]
    recipe = Recipe.load("touch", labels=LABELS, noise_floor=floor)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        readout = fit([learnt], recipe)
    by_rule = Detections([], [], [])
    rules = tune([learnt], LABELS, window_ms=WINDOW_MS, noise_floor=floor)
    for rule in rules.values():
        if rule is not None:
            by_rule += detect(rule, unseen.source, tare=unseen.tare)
    return {
        "runs": wrong(detect(readout, unseen.source, tare=unseen.tare), unseen),
        "rule": wrong(by_rule, unseen),
        "rules": {label: rule and rule.quantity for label, rule in rules.items()},
    }


def excess(result: Mapping[str, Any]) -> float:
    """Return how many more a training misses and invents than the rule, as a share of the labels."""
    # Results that were kept before readouts held rules have neurons alone.
    return float(sum(result.get("runs", result.get("neuron", {})).values()) - sum(result["rule"].values())) / (
        2 * JUDGED
    )


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached: by number of taxels the worst case."""
    worst: dict[str, float] = {}
    for name, case in result.get("cases", {}).items():
        taxels = name.split(",")[0]
        worst[taxels] = max(worst.get(taxels, -1.0), excess(case))
    return at_most(dict.fromkeys(worst, SHARE), worst)


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return what trainings and rules miss and invent in each case."""
    chosen = [case for case in cases() if not quick or (case.unit == "N" and case.times == 8.0 and case.taxels < 64)]
    found = {str(case): compared(case) for case in chosen}
    worst = {"more missed and false than the rule, worst case, share of the labels": max(map(excess, found.values()))}
    return {"ratios": worst, "cases": found}
