"""The check of a solution: that a fitted neuron fires at its targets and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.errors import refused
from taxel.learn._checked import checked_examples, fitted
from taxel.learn._statement import AT_EDGE, BEFORE_TARGET, PatternRows, pattern_rows
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import ConeX, Margin
from taxel.spikes import SpikeTrains

#: A potential this far below the threshold reaches it, in thresholds (1e-12 mV at 0.3 mV).
_TOUCH = 1e-12 / 0.3
#: The instants at which silence is looked at: so many a time constant, for so many time constants after an input.
_INSTANTS, _AFTER = 50, 20
_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Checked:
    """Tell whether a fitted neuron fires at its targets and nowhere else, and by how much; true if it does.

    Parameters
    ----------
    holds : bool
        Whether it does, with every weight within its bounds.
    missed_mv : float, mV
        The largest distance of the potential from the threshold at a target.
    room_mv : float, mV
        The least distance of the potential below the threshold at the instants of a fine grid at which silence is
        required; infinite without any. Within the last millisecond before a target, where it falls to 0, it is divided
        by the ms left.
    slope : float, mV/ms
        The least slope at which the potential crosses the threshold at a target; infinite without targets or on a grid.
    wrong : str or None
        The first pattern and time at which something is wrong.
    """

    holds: bool
    missed_mv: float
    room_mv: float
    slope: float
    wrong: str | None

    def __bool__(self) -> bool:
        return self.holds


def check_solution(cone: ConeX | ConeR, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> Checked:
    """Check that a fitted neuron fires at every target and nowhere else: the neuron runs, and NumPy computes again.

    The neuron runs on each pattern up to the horizon: its spikes must be the targets, to 1e-6 ms in continuous time.
    Then, with spikes put at the targets, the potential is computed in plain NumPy: it must reach the threshold at each
    target (6.9a) and stay below it at all other times outside the refractory times (6.9b), which is looked at on a grid
    of a fiftieth of `tau`. Every weight must be within its bounds (6.9c).

    Parameters
    ----------
    cone : ConeX or ConeR
        The fitted learner: its parameters state the problem, `weights_` are checked. A `ConeX` that is "solved" or
        "feasible" holds; on a grid only with a `margin`, as a neuron on a grid fires where it touches its threshold.
        A `ConeR` holds where its optimum meets every target and breaks no silence, which it does not claim.
    patterns : sequence of SpikeTrains
    targets : sequence of float sequences, ms
        As in `fit`.

    Returns
    -------
    Checked

    Raises
    ------
    ProblemError : examples that cannot be those of the fit; an infeasible fit, which has no weights
    NotFittedError : before `fit`

    Notes
    -----
    Thesis 6.3.2, equations 6.7 to 6.9. Windows of silence (`ConeR.fit`) are not read: silence is checked everywhere.
    Cost: instants times the inputs of the last 50 `tau`.

    Examples
    --------
    >>> import taxel
    >>> trains = taxel.SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = taxel.learn.ConeX(neuron=taxel.Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> taxel.learn.check_solution(cone, [trains], [[20.0]]).holds
    True
    >>> cone.weights_ = 1.001 * cone.weights_
    >>> taxel.learn.check_solution(cone, [trains], [[20.0]]).wrong
    'pattern 0: the neuron fires at 19.779341 ms, where silence is required'
    """
    w = fitted(cone)
    if not np.isfinite(w).all():
        raise refused("cone", f" is {cone.status_}, so it has no weights to check")
    trained, times, _ = checked_examples(cone, len(w), patterns, targets)
    all_rows = pattern_rows(cone, cone.neuron_, trained, times, margin=Margin(0.0, 0.0))
    lb, ub = (np.broadcast_to(np.asarray(bound, np.float64), len(w)) for bound in (cone.lb, cone.ub))
    out = np.flatnonzero((w < lb) | (w > ub))[:1]
    wrong = [f"weight {n}: {w[n]} mV is outside its bounds, {lb[n]} to {ub[n]} mV" for n in out]
    missed, room, slope = 0.0, np.inf, np.inf
    for p, (pattern, rows) in enumerate(zip(trained, all_rows, strict=True)):
        least, found = _silence(rows, w)
        room = min(room, least)
        for k in range(len(rows.targets)):
            missed = max(missed, abs(_excess(rows, w, k)))
            if not rows.on_grid:
                slope = min(slope, float(-rows.slope(k)[0] @ w + rows.fall(k)))
        reasons = (_fired_wrong(cone, w, pattern, rows), _target_wrong(rows, w), found)
        wrong += [f"pattern {p}: {reason}" for reason in reasons if reason]
    return Checked(not wrong, missed, float(room), slope, wrong[0] if wrong else None)


def _fired_wrong(cone: ConeX | ConeR, w: _Floats, pattern: SpikeTrains, rows: PatternRows) -> str:
    """Return the first difference between the neuron's own spikes and the targets; "" without any."""
    near = 4 * np.spacing(max(abs(rows.start), abs(rows.end))) + (0.0 if rows.on_grid else AT_EDGE)
    # A target at the end itself may be reached just after it.
    end = max([rows.end, *(rows.targets + near)])
    fired = cone.neuron_.run(w, pattern.lasting(max(pattern.stop, end)))
    fired = fired[fired <= end]
    for k, t in enumerate(rows.targets):
        if rows.on_grid and not rows.is_point(float(t)):
            return f"target {k} ({t:g} ms) is between two time steps; a neuron fires only at a time step"
        if k >= len(fired) or fired[k] > t + near:
            return f"the neuron does not fire at target {k} ({t:g} ms)"
        if fired[k] < t - near:
            return f"the neuron fires at {fired[k]:.6f} ms, where silence is required"
    if len(fired) > len(rows.targets):
        return f"the neuron fires at {fired[len(rows.targets)]:.6f} ms, where silence is required"
    return ""


def _excess(rows: PatternRows, w: _Floats, k: int) -> float:
    """Return the potential less the threshold at a target, mV."""
    return float(rows.target(k)[0] @ w - rows.threshold(rows.targets[k : k + 1])[0])


def _target_wrong(rows: PatternRows, w: _Floats) -> str:
    """Return the first target at which the potential is too low to reach the threshold in 1e-6 ms; "" without any."""
    rise = AT_EDGE * rows.steepest * np.abs(rows.values * w[rows.trains]).sum()
    for k, t in enumerate(rows.targets):
        excess = _excess(rows, w, k)
        if excess < -_TOUCH * rows.neuron.theta_0 - rise:
            return f"the potential at target {k} ({t:g} ms) is {-excess:.1e} mV below the threshold"
    return ""


def _silence(rows: PatternRows, w: _Floats) -> tuple[float, str]:
    """Return the least distance below the threshold where silence is required, and where it is not kept; or ""."""
    least, reached = np.inf, ""
    instants = rows.silent if rows.on_grid else _instants(rows)
    for t, potential, size in rows.potentials(rows.values * w[rows.trains], instants):
        room = rows.threshold(t) - potential
        rounding = np.finfo(float).eps * (len(rows.times) + rows.roundings) * (size + np.abs(room))
        above = np.flatnonzero(room < -_TOUCH * rows.neuron.theta_0 - rounding)[:1]
        if len(above) and not reached:
            reached = f"the potential reaches the threshold at {t[above[0]]:.6f} ms, where silence is required"
        left = np.where(rows.on_grid | (room < 0), 1.0, np.minimum(1.0, rows.following(t) - t))
        least = min(least, float((room / left).min()))
    return least, reached


def _instants(rows: PatternRows) -> _Floats:
    """Return a fine grid of instants at which silence is required: after every input, and close before targets."""
    tau, targets = rows.neuron.tau, rows.targets
    marks = [rows.start, rows.end, *rows.times, *targets, *(targets + rows.neuron.refractory)]
    edges = np.unique(np.clip(marks, rows.start, rows.end))
    lengths = np.minimum(np.diff(edges), _AFTER * tau)
    counts = np.ceil(_INSTANTS * lengths / tau).astype(np.int64) + 1
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    even = np.repeat(edges[:-1], counts) + within * np.repeat(lengths / counts, counts)
    before = (targets[:, None] - np.geomspace(BEFORE_TARGET, 1.0, _INSTANTS)).ravel()
    t = np.unique(np.concatenate([even, edges[-1:], before]))
    return t[rows.is_silent(t)]
