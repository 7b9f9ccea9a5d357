"""How many patterns a neuron can learn (thesis 6.4.4): what figure 6.7, delays and rivals share.

A realisation draws its patterns one after the other, and a load takes the first p of them. So what is infeasible at one
load stays so at every higher one, and the published search (from 0.2 N up while all realisations are feasible, down if
not) ends at the largest load of the weakest realisation: one solve at that load for each of the others is enough.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.mapping import LEARN, TABLE
from taxel_studies.runner import noted

DURATION_MS = 200.0
#: Where rounding prevents a proof either way, rows that hold to within this count as satisfied, mV.
MET_TO = 1e-9
#: Loads that others published for one spike a pattern, each under criteria of its own (thesis 6.4.4).
PUBLISHED = {"E-learning": 0.22, "PSD": 0.144, "SPAN": 0.075, "ReSuMe": 0.04, "I-learning": 0.02}


def patterns(seed: int, inputs: int, count: int, classes: int) -> tuple[list[SpikeTrains], list[list[float]]]:
    """Draw patterns of one spike an input on whole ms from 1 to 200, and each one's target by its class.

    Pattern k depends on seed, inputs and k alone; classes take turns.
    """
    offsets = np.arange(inputs + 1)
    drawn = [
        SpikeTrains(
            np.random.default_rng([seed, inputs, k]).integers(1, 201, inputs).astype(float), offsets, 0.0, DURATION_MS
        )
        for k in range(count)
    ]
    return drawn, [[DURATION_MS * (k % classes + 1) / (classes + 1)] for k in range(count)]


def feasible(params: dict[str, Any], count: int, seed: int) -> bool:
    """Return whether one neuron can fire at the targets of `count` patterns and nowhere else.

    Parameters
    ----------
    params : dict
        ``inputs``, ``classes``, ``time`` ("grid" or "continuous"), ``after_spike``, ``margin`` (mV), ``slope`` (mV/ms).
    count : int
    seed : int
    """
    margins = {"margin": params["margin"], "slope": params["slope"]} if params["time"] == "continuous" else {}
    cone = ConeX(
        **LEARN,
        neuron=Neuron(**TABLE, time=params["time"], after_spike=params["after_spike"]),
        lambdas=(0.0, 1.0, 0.0),
        horizon=DURATION_MS,
        **margins,
    )
    return satisfied(noted(cone.fit(*patterns(seed, params["inputs"], count, params["classes"]))))


def satisfied(cone: ConeX) -> bool:
    """Return whether a fit found weights; where rounding forbids a proof, rows satisfied to 1e-9 mV decide."""
    return bool(cone.status_ in ("solved", "feasible") or (cone.status_ == "stopped" and cone.violation_ <= MET_TO))


def largest(holds: Callable[[int], bool], start: int, step: int, most: int | None = None) -> int:
    """Return the largest multiple of `step` at which a monotone test holds; 0 where it holds nowhere.

    Parameters
    ----------
    holds : function of int
        Monotone: once false it stays false.
    start, step : int
        Where the search begins, and its step.
    most : int, optional
        The search ends there.
    """
    low, high, stride = 0, None if most is None else most + step, step
    at = start
    while at > 0 and (high is None or at < high):
        if holds(at):
            low, at, stride = at, at + stride, 2 * stride
            continue
        high = at
        break
    stride = step
    while high is not None and low == 0 and high > step:
        at = max(high - stride, step)
        if holds(at):
            low = at
        else:
            high, stride = at, 2 * stride
    while high is not None and high - low > step:
        middle = low + (high - low) // (2 * step) * step
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


def weakest(bears: Callable[[int, int], bool], params: dict[str, Any], seed: int) -> list[list[int]]:
    """Search the largest load at which all realisations are feasible, from 0.2 N on.

    Parameters
    ----------
    bears : function of (seed, p)
        Whether a realisation is feasible at a load.
    params : dict
        ``inputs``, ``classes``, ``realisations``.
    seed : int
        The first realisation's; the others follow.

    Returns
    -------
    list of [seed, p]
        Of each realisation whose largest load is below those before it; at the last p all of them are feasible.
    """
    step = params["classes"]
    most = largest(partial(bears, seed), max(round(0.2 * params["inputs"] / step), 1) * step, step)
    limits = [[seed, most]]
    for of in range(seed + 1, seed + params["realisations"]):
        if most and not bears(of, most):
            most = largest(partial(bears, of), most - step, step, most - step)
            limits.append([of, most])
    return limits


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Search the largest load at which all realisations are feasible.

    Parameters
    ----------
    params : dict
        As `feasible`, and ``realisations``.
    seed : int
        The first realisation's; the others follow.

    Returns
    -------
    dict
        ``p``, ``load`` (p by inputs), ``limits`` (seed and p of each realisation below those before it),
        ``solves``.
    """
    solves = 0

    def bears(of: int, count: int) -> bool:
        nonlocal solves
        solves += 1
        return feasible(params, count, of)

    limits = weakest(bears, params, seed)
    most = limits[-1][1]
    return {"p": most, "load": round(most / params["inputs"], 6), "limits": limits, "solves": solves}
