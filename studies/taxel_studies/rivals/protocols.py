"""The two protocols: what is drawn, what counts as learnt, and the search for the largest load."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from taxel import ProblemError
from taxel.spikes import SpikeTrains
from taxel_studies.rivals.rules import RULES, learner
from taxel_studies.runner import noted

DURATION_MS = 200.0
CLASSES = 5


def gardner_gruning(seed: int, inputs: int, count: int) -> tuple[list[SpikeTrains], list[list[float]]]:
    """Draw patterns of one spike an input in 0 to 200 ms, and 5 targets in 40 to 200 ms, 7 ms apart or more."""
    random = np.random.default_rng([1, seed, inputs])
    while True:
        targets = np.sort(random.uniform(40.0, DURATION_MS, CLASSES))
        if np.diff(targets).min() >= 7.0:
            break
    return _drawn(seed, inputs, count, lambda r: r.uniform(0.0, DURATION_MS, inputs)), [
        [float(targets[k % CLASSES])] for k in range(count)
    ]


def thesis(seed: int, inputs: int, count: int) -> tuple[list[SpikeTrains], list[list[float]]]:
    """Draw patterns of one spike an input on whole ms from 1 to 200, with targets at 200 c / 6 ms."""
    return _drawn(seed, inputs, count, lambda r: r.integers(1, 201, inputs).astype(float)), [
        [DURATION_MS * (k % CLASSES + 1) / (CLASSES + 1)] for k in range(count)
    ]


def _drawn(
    seed: int, inputs: int, count: int, draw: Callable[[np.random.Generator], np.ndarray[Any, Any]]
) -> list[SpikeTrains]:
    """Draw patterns of which the first ones are the same at every count."""
    offsets = np.arange(inputs + 1)
    return [
        SpikeTrains(draw(np.random.default_rng([2, seed, inputs, k])), offsets, 0.0, DURATION_MS) for k in range(count)
    ]


def share_right(params: dict[str, Any], count: int, seed: int) -> float:
    """Return the share of patterns that are right: in "a" after all epochs, in "b" at best.

    ConeX learns all of them or, by its certificate, none can.
    """
    name, protocol, inputs = params["rule"], params["protocol"], params["inputs"]
    patterns, targets = (gardner_gruning if protocol == "a" else thesis)(seed, inputs, count)
    training = {"epochs": params[f"epochs_{protocol}"], "until_right": protocol == "b", "within_ms": 1.0}
    if name == "ConeX":
        cone = noted(learner(name, protocol, inputs, count, seed).fit(patterns, targets))
        if cone.status_ == "stopped":
            raise ProblemError(f"ConeX came to no verdict on {count} patterns, seed {seed}, of {params}")
        return 1.0 if cone.status_ in ("solved", "feasible") else 0.0
    fitted = learner(name, protocol, inputs, count, seed, **training).fit(patterns, targets)
    return float(fitted.right_[-1])


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Find the largest load of one rule at one number of inputs, in steps of 5 patterns.

    Returns
    -------
    dict
        ``p``, ``load``, and ``tried``: (patterns, runs, mean share right, runs with all right) of each load tried.
        In "b" a load is left at the first run that fails.
    """
    tried: dict[int, list[Any]] = {}

    def holds(count: int) -> bool:
        shares: list[float] = []
        for run in range(seed, seed + params[f"runs_{params['protocol']}"]):
            shares.append(share_right(params, count, run))
            if params["protocol"] == "b" and shares[-1] < 1.0:
                break
        mean = float(np.mean(shares))
        tried[count] = [len(shares), round(mean, 4), sum(s == 1.0 for s in shares)]
        return mean >= 0.9 if params["protocol"] == "a" else mean == 1.0

    step = CLASSES
    most = max(round(RULES[params["rule"]].begin * params["inputs"] / step), 1) * step
    if holds(most):
        while holds(most + step):
            most += step
    else:
        most -= step
        while most and not holds(most):
            most -= step
    return {"p": most, "load": round(most / params["inputs"], 4), "tried": [[c, *tried[c]] for c in sorted(tried)]}
