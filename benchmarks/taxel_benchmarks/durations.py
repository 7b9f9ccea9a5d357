"""Taps and presses, which differ by how long they last alone: told by what a training writes, the plain rule.

Five drawn trainings on 16 x 16 taxels at 60 Hz: 20 taps (.1 to .2 s) and 10 presses (1.2 to 2.2 s) of the same size and
force to learn from, 40 and 20 others to judge. A touch is told right if its label is found within 50 ms of its onset.

Peer: none. Unit: touches told right, and false detections. Goal: 98 % right and 1 % false over the five.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from taxel import Array, Frames, Tare
from taxel.detect import Example, Recipe, fit, score
from taxel.detect import run as detect
from taxel.detections import Detections
from taxel_benchmarks._goals import Goal, at_least, at_most

LABELS = ("press", "tap")
HZ, WINDOW_MS, NOISE = 60, 50.0, 1.0
SEEDS = range(4851, 4856)
#: How long each lasts, s.
LASTS = {"tap": (0.1, 0.2), "press": (1.2, 2.2)}


def drawn(seed: int, taps: int, presses: int) -> Example:
    """Return a recording of touches in a drawn order, with their labels; it begins with 2 s of rest."""
    rng = np.random.default_rng(seed)
    kinds = rng.permutation(["tap"] * taps + ["press"] * presses)
    at, touches = 2 * HZ, []
    for kind in kinds:
        last = round(rng.uniform(*LASTS[kind]) * HZ)
        touches.append((kind, at, last))
        at += last + int(rng.integers(HZ // 2, HZ))
    values = rng.normal(20.0, NOISE, (at + HZ, 16, 16))
    y, x = np.mgrid[:16, :16]
    for _, begin, last in touches:
        row, column = rng.uniform(3, 12, 2)
        shape = np.exp(-((y - row) ** 2 + (x - column) ** 2) / (2 * rng.uniform(1.2, 1.8) ** 2))
        # It rises and falls in two frames.
        rise = np.minimum(1.0, np.minimum(np.arange(1, last + 1), np.arange(last, 0, -1)) / 2)
        values[begin : begin + last] += rng.uniform(60.0, 100.0) * rise[:, None, None] * shape
    t = (np.arange(len(values)) * (1e6 / HZ)).astype(np.int64)
    frames = Frames(np.rint(values), t, unit="counts", array=Array(16, 16, name="drawn"))
    labels = {kind: t[[begin for of, begin, _ in touches if of == kind]] for kind in LABELS}
    return Example(frames, labels, Tare.take(frames, stop_us=1_900_000))


def judged(found: Detections, unseen: Example) -> dict[str, int]:
    """Return how many touches are told right, and how many detections are false."""
    scored = score(found, unseen.labels, WINDOW_MS)
    return {"touches": scored.events, "right": scored.found, "false": scored.false}


def training(seed: int) -> dict[str, Any]:
    """Train on 30 touches, and judge on 60 others."""
    learnt, unseen = drawn(seed, 20, 10), drawn(seed + 1000, 40, 20)
    floor = 6 * NOISE
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        readout = fit([learnt], Recipe.load("touch", labels=LABELS, noise_floor=floor))
    return {
        "runs": judged(detect(readout, unseen.source, tare=unseen.tare), unseen),
        "by rule": list(readout.by_rule),
        "rules": {label: repr(rule) for label, rule in readout.rules.items()},
    }


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    shares = result.get("shares")
    # Results that were kept before readouts held rules have neurons alone.
    shares = shares and shares.get("neuron", shares)
    if shares is None:
        return []
    return [*at_least({"right": 0.98}, shares), *at_most({"false": 0.01}, shares)]


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return each training, and the shares of all."""
    trainings = {str(seed): training(seed) for seed in (SEEDS[:1] if quick else SEEDS)}
    sums = {key: sum(each["runs"][key] for each in trainings.values()) for key in ("touches", "right", "false")}
    shares = {key: sums[key] / sums["touches"] for key in ("right", "false")}
    ratios = {f"{key}, of the touches": share for key, share in shares.items()}
    return {"ratios": ratios, "trainings": trainings, "shares": shares}
