"""A disc that touches a board's array: its events, the truth, and a recipe that learns it."""

from __future__ import annotations

import numpy as np

import taxel
from taxel.detect import Readout, Recipe
from taxel.encode import ContactArea

ARRAY = taxel.Array(8, 8, pitch_mm=2.67, name="small")
FRAME_US = 192.0


def touches(seed: int, count: int = 6, array: taxel.Array = ARRAY) -> tuple[taxel.Events, dict[str, list[int]]]:
    """Play a disc that grows and shrinks on the array: the board's events with stamps of 100 us, and the truth."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[: array.rows, : array.columns]
    sent = np.full(array.shape, 60, np.int64)
    columns: list[tuple[int, int, int, bool, int]] = []
    columns += [(0, int(c), int(r), True, 60) for r, c in zip(y.ravel(), x.ravel(), strict=True)]
    truth: dict[str, list[int]] = {"contact": [], "lift": []}
    start = 300
    for _ in range(count):
        start += int(random.integers(150, 400))
        length = int(random.integers(150, 300))
        centre = random.uniform(2.5, 4.5, 2)
        truth["contact"].append(int(start * FRAME_US))
        truth["lift"].append(int((start + length) * FRAME_US))
        for k in range(start, start + length + 1):
            near = min(k - start, start + length - k) / 6.0
            radius = min(2.6, near)
            ticks = np.where(np.hypot(y - centre[0], x - centre[1]) < radius, 90, 60) + random.integers(
                -1, 2, array.shape
            )
            for r, c in np.argwhere(np.abs(ticks - sent) > 3):
                new = int(ticks[r, c])
                columns.append((int(k * FRAME_US) // 100 * 100, int(c), int(r), new >= sent[r, c], new))
                sent[r, c] = new
        start += length
    t, cx, cy, p, ticks = map(list, zip(*columns, strict=True))
    return taxel.Events(t, cx, cy, p, array=array, intensity=ticks), truth


def tare() -> taxel.Tare:
    return taxel.Tare.take(taxel.Frames(np.full((2, 8, 8), 60.0), [0, 1000], array=ARRAY))


def recipe() -> Recipe:
    """Contact area, and neurons like the demo's; each is known some frames after the event."""
    return Recipe(
        ContactArea(levels=(2, 4, 8)),
        {"step_ms": 0.192, "lb": -3.0, "ub": 3.0, "refractory": 15.0, "divide_b_by": "targets"},
        {"contact": {"tau": 1.5, "delay_ms": 2.0}, "lift": {"tau": 3.0, "delay_ms": 1.0}},
        run_threshold=0.9,
    )


def plain(encoder: taxel.encode.Encoder, array: taxel.Array, seed: int = 0, **neuron: object) -> Readout:
    """A readout of random weights, which says much and means nothing."""
    inputs = encoder.trains(array) * (2 if encoder.signed else 1)
    random = np.random.default_rng(seed)
    neurons = {
        label: (taxel.Neuron(tau=3.0, refractory=5.0, **neuron), random.normal(0.1, 0.5, inputs), 0.25 * k)
        for k, label in enumerate(("a", "b", "c"))
    }
    return Readout(encoder, neurons, array=array)
