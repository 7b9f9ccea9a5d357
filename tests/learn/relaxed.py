"""Problems of ConeR with options of every kind, and from which rows the largest values of their terms are reckoned."""

from __future__ import annotations

import warnings

import numpy as np
import stated
from making import made

from taxel import SpikeTrains
from taxel.learn import ConeR


def examples(seed, trains=14, *shape, **options):
    return stated.examples(seed, trains, *shape, first=20.0, **options)


def fitted(cone, *args, **kwargs):
    """Fit without a word of warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cone.fit(*args, **kwargs)


def sizes(cone, patterns, targets, windows, rows):
    """The rows from which the largest value of each term is reckoned: those of the magnitudes of graded values."""
    if patterns[0].kind != "graded":
        return rows
    positive = [SpikeTrains(p.times, p.offsets, p.start, p.stop, abs(p.values), kind="graded") for p in patterns]
    return (*map(np.abs, rows[:3]), stated.grid_rows(cone, positive, targets, windows)[3], rows[4])


def drawn(seed):
    """A fit with options, bounds, windows and examples of every kind, its examples and its windows."""
    random = np.random.default_rng([77, seed])
    one = lambda *values: values[random.integers(len(values))]  # noqa: E731
    trains = int(random.integers(1, 15)) * one(1, 1, 8)
    kernel = one("alpha", "alpha", "double_exponential", "exponential")
    shape = (int(random.integers(1, 4)), int(random.integers(1, 4)))
    patterns, targets = stated.examples(seed, trains, *shape, whole_ms=one(True, False), first=20.0)
    kind = one("unsigned", "unsigned", "positive", "signs")
    if kind != "unsigned":
        signs = [1.0] if kind == "positive" else [-1.0, 1.0]
        patterns = stated.graded(patterns, seed, lambda r, n: r.choice(signs, n) * 10 ** r.uniform(-1, 1, n))
    empty = random.random(trains) < one(0.0, 0.3)
    keep = [~np.repeat(empty, p.counts) for p in patterns]
    counts = [np.where(empty, 0, p.counts) for p in patterns]
    patterns = [
        SpikeTrains(
            p.times[k],
            np.append(0, np.cumsum(c)),
            p.start,
            p.stop,
            p.values if p.values is None else p.values[k],
            kind=p.kind,
        )
        for p, k, c in zip(patterns, keep, counts, strict=True)
    ]
    # A pattern without spikes has no target.
    targets = [t if len(p.times) else t[:0] for p, t in zip(patterns, targets, strict=True)]
    targets[0] = targets[0][: int(random.integers(0, 4))]
    options = {
        "kernel": kernel,
        "tau": float(random.uniform(5, 30)),
        "after_spike": one("keep", "ignore", "reset"),
        "first_threshold": one("theta_0", "printed"),
        "refractory": one(1.0, 3.0, 6.5),
        "theta_plus": one(0.0, 0.2, 2.0),
        "tau_rec": one(None, 8.0, 100.0),
        "step_ms": one(1.0, 1.0, 0.5, 0.3),
        "margin": one(0.0, 0.0, 0.02),
        "horizon": one(None, None, 180.0),
        "kappa": float(random.uniform(0.8, 2.0)),
        "delta_t_ms": one(None, 0.0, 4.0),
        "lambdas": [*(one(0.0, 1.0, 10.0, 100.0) for _ in range(4)), one(1.0, 80.0, 800.0)],
        "form_b": ("square", "sum")[seed % 2],
        "divide_b_by": one("B_max", "targets"),
        "divide_c_by": one("C_max", "targets"),
        "divide_d_by": one("D_max", "targets"),
        "sides_b": one("both", "below"),
        "sides_c": one("both", "below"),
        "norm": one("norm", "square"),
        "tolerance": one(1e-6, 1e-6, 1e-3),
    }
    if kernel == "double_exponential" and one(True, False):
        options["tau_s"] = 0.5 * options["tau"]
    low, high = random.uniform(-1, 0.02, trains), random.uniform(0.05, 1, trains)
    kinds = {"one": (-0.5, 0.3), "each": (low.tolist(), high.tolist()), "wide": (-300.0, 300.0), "up": (0.01, 0.6)}
    options["lb"], options["ub"] = kinds[one(*kinds)]
    silence = one(None, None, [one(None, [(15.0, 40.0), (40.0, 60.5)], []) for _ in patterns])
    # In another unit of potential every number of the options that is one is larger.
    unit = one(1.0, 1.0, 0.02, 40.0)
    options |= {"theta_0": 0.3 * unit, "theta_plus": options["theta_plus"] * unit, "margin": options["margin"] * unit}
    options |= {end: (np.asarray(options[end]) * unit).tolist() for end in ("lb", "ub")}
    cone = made(ConeR, **options).fit(patterns, targets, silence=silence)
    return cone, patterns, targets, silence
