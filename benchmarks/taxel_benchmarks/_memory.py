"""The memory task (6.4.4, C = 3) on the grid: its rows, and solving it with rows on demand, as ConeX does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from taxel import SpikeTrains

TAU, THETA_0, THETA_PLUS, REFRACTORY, BOUND, END = 15.0, 0.3, 0.2, 3.0, 0.3, 200
#: How much the potential may be above its limit of silence.
TOLERANCE = 1e-8

#: Takes the rows that are added, and their limits; returns the verdict, the weights and the objective.
Solve = Callable[[Any, Any], tuple[str, Any, float]]


def draw(n: int, p: int, seed: int = 0) -> tuple[Any, Any]:
    """Draw one spike per train on whole ms 1 to 200, shape (p, n), and the target of each pattern."""
    random = np.random.default_rng(seed)
    return random.integers(1, END + 1, (p, n)).astype(float), END * (1 + np.arange(p) % 3) / 4


def trains(spikes: Any, targets: Any) -> tuple[list[SpikeTrains], list[list[float]]]:
    """Return trains and targets as ConeX takes them."""
    patterns = [SpikeTrains.from_lists([[s] for s in row], stop=float(END)) for row in spikes]
    return patterns, [[t] for t in targets]


def kernel(ages: Any) -> Any:
    """Alpha kernel at these ages, ms."""
    x = np.maximum(ages, 0.0) / TAU
    return x * np.exp(-x)


def threshold(t: Any, target: float) -> Any:
    """Threshold at `t`; the neuron fired at `target` if that is past."""
    return np.where(t > target, THETA_0 + THETA_PLUS * np.exp(-(t - target - REFRACTORY) / (2 * TAU)), THETA_0)


def silent(target: float) -> Any:
    """Whole ms at which the neuron must be silent (6.9b)."""
    points = np.arange(END + 1.0)
    return points[(points < target) | (points > target + REFRACTORY)]


def equalities(n: int, p: int, after: float = 0.0) -> Any:
    """Return the rows of the potential at the targets, or so many ms after them."""
    spikes, targets = draw(n, p)
    return np.array([kernel(t + after - row) for row, t in zip(spikes, targets, strict=True)])


def every_row(n: int, p: int) -> tuple[Any, Any]:
    """Return all rows of silence, and their limits."""
    spikes, targets = draw(n, p)
    points = [silent(t) for t in targets]
    rows = np.empty((sum(map(len, points)), n))
    at = 0
    for row, times in zip(spikes, points, strict=True):
        rows[at : at + len(times)] = kernel(times[:, None] - row)
        at += len(times)
    return rows, np.concatenate([threshold(times, t) for times, t in zip(points, targets, strict=True)])


def on_demand(n: int, p: int, solve: Solve) -> tuple[str, float]:
    """Solve from the targets alone, adding the peak of each stretch above the limit of silence; return the verdict."""
    spikes, targets = draw(n, p)
    points = np.arange(END + 1.0)
    limits = np.array([np.where(np.isin(points, silent(t)), threshold(points, t), np.inf) for t in targets])
    at = spikes.astype(int) + (END + 1) * np.arange(p)[:, None]
    decay = math.exp(-1 / TAU)
    rows, most = np.empty((0, n)), np.empty(0)
    while True:
        verdict, w, objective = solve(rows, most)
        if verdict != "solved":
            return verdict, objective
        inputs = np.bincount(at.ravel(), np.tile(w, p), p * (END + 1)).reshape(p, END + 1)
        potential, a, b = np.zeros((p, END + 1)), np.zeros(p), np.zeros(p)
        for t in range(1, END + 1):
            a, b = a * decay, (b + a / TAU) * decay
            potential[:, t] = b
            a = a + inputs[:, t]
        excess = potential - limits
        broken = [np.flatnonzero(over > TOLERANCE) for over in excess]
        added = [
            (pattern, stretch[np.argmax(excess[pattern, stretch])])
            for pattern, times in enumerate(broken)
            for stretch in np.split(times, np.flatnonzero(np.diff(times) > 1) + 1)
            if len(stretch)
        ]
        if not added:
            return "solved", objective
        rows = np.array([kernel(t - spikes[pattern]) for pattern, t in added])
        most = np.array([limits[pattern, t] for pattern, t in added])
