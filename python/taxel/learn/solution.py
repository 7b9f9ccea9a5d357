"""The check of a solution: that a fitted neuron fires at its targets and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._core import ProblemError
from taxel.learn._checked import checked_examples, fitted
from taxel.learn._statement import BLOCK, PatternRows, pattern_rows
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import ConeX, Margin
from taxel.spikes import SpikeTrains

__all__ = ["Checked", "check_solution"]

#: A potential this far below the threshold reaches it, in thresholds (1e-12 mV at 0.3 mV).
_TOUCH = 1e-12 / 0.3
#: The share of the least room found that is proven.
_PROVEN = 0.8
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
        A distance that the potential is proven to keep below the threshold wherever silence is required: at least 0.8
        of the least one. Within the last millisecond before a target, where it falls to 0, it is divided by the ms
        left. On a grid it is the least one at the grid points. Where it is not above 0, it is the distance found.
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
    """Check that a fitted neuron fires at every target and nowhere else, computed anew in plain NumPy.

    Spikes are put at the targets. Then the neuron fires at them if its potential reaches the threshold at each (6.9a),
    and nowhere else if it stays below at all other times outside the refractory times (6.9b), up to the horizon. Both
    are linear in the weights, which must be within their bounds (6.9c).

    In continuous time silence is proven at every instant, not at samples: between two inputs the potential is one curve
    of the kernel's family, whose second derivative is bounded. An interval whose ends and curvature leave no room is
    halved. A target counts as met if the first crossing is at most 1e-6 ms before it, as `ConeX` has it.

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
    Thesis 6.3.2, equations 6.7 to 6.9. Compiled code takes no part. Windows of silence (`ConeR.fit`) are not read:
    silence is checked everywhere. Cost: inputs times the inputs of the last 50 `tau`.

    Examples
    --------
    >>> import taxel
    >>> trains = taxel.SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = taxel.learn.ConeX(neuron=taxel.Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> taxel.learn.check_solution(cone, [trains], [[20.0]]).holds
    True
    >>> cone.weights_ = 1.001 * cone.weights_
    >>> taxel.learn.check_solution(cone, [trains], [[20.0]]).wrong
    'pattern 0: the potential reaches the threshold at 19.999999 ms, where silence is required'
    """
    w = fitted(cone)
    if not np.isfinite(w).all():
        raise ProblemError(f"cone: is {cone.status_} and has no weights to be checked")
    trained, times, _ = checked_examples(cone, len(w), patterns, targets)
    all_rows = pattern_rows(cone, cone.neuron_, trained, times, margin=Margin(0.0, 0.0))
    missed, room, slope = 0.0, np.inf, np.inf
    lb, ub = (np.broadcast_to(np.asarray(bound, np.float64), len(w)) for bound in (cone.lb, cone.ub))
    out = np.flatnonzero((w < lb) | (w > ub))[:1]
    wrong = [f"weight {n}: {w[n]} mV is outside of its bounds, {lb[n]} to {ub[n]} mV" for n in out]
    touch = _TOUCH * cone.neuron_.theta_0
    for p, rows in enumerate(all_rows):
        least, at, close = _on_grid(rows, w) if rows.on_grid else _room(rows, w)
        if least <= close + (touch if rows.on_grid else 0.0):
            wrong.append(f"pattern {p}: the potential reaches the threshold at {at:.6f} ms, where silence is required")
        room = min(room, least)
        for k, t in enumerate(rows.targets):
            coefficients, sizes = rows.target(k)
            off = float(coefficients @ w - rows.threshold(rows.targets[k : k + 1])[0])
            missed = max(missed, abs(off))
            rounding = (np.abs(w) @ sizes + cone.neuron_.theta_0) * np.finfo(float).eps * (len(rows.times) + len(w))
            if off < -touch - rounding:
                wrong.append(f"pattern {p}: does not fire at target {k} ({t:g} ms), {-off:.1e} mV below the threshold")
            if rows.on_grid and not rows.is_point(float(t)):
                wrong.append(f"pattern {p}: target {k} ({t:g} ms) lies between grid points, where no neuron fires")
            if not rows.on_grid:
                slope = min(slope, float(-rows.slope(k)[0] @ w + rows.fall(k)))
    return Checked(not wrong, missed, float(room), slope, wrong[0] if wrong else None)


def _on_grid(rows: PatternRows, w: _Floats) -> tuple[float, float, float]:
    """Return the least distance below the threshold over the silent grid points, its time, and its rounding."""
    least = (np.inf, rows.start, 0.0)
    for t, potential, size in rows.potentials(rows.values * w[rows.trains]):
        room = rows.threshold(t) - potential
        k = int(room.argmin())
        if room[k] < least[0]:
            rounding = np.finfo(float).eps * (len(rows.times) + rows.roundings) * (size[k] + room[k])
            least = (float(room[k]), float(t[k]), float(rounding))
    return least


def _room(rows: PatternRows, w: _Floats) -> tuple[float, float, float]:
    """Return the least distance below the threshold that is proven, or one found that is not above 0; its time, and 0.

    Within 1 ms before a target the distance is divided by the ms left.
    """
    marks = [rows.start, rows.end, *rows.times, *rows.targets, *rows.until(rows.targets)]
    marks += [*(rows.targets + rows.neuron.refractory)]
    if rows.neuron.first_threshold == "printed":
        # The neuron rounds the time at which its printed first threshold rises.
        marks += [(rises := rows.start + rows.neuron.refractory) - 2e-9 - 1e-15 * abs(rises), rises]
    edges: _Floats = np.unique(np.clip(marks, rows.start, rows.end))
    begin, end = (edges[:-1], edges[1:]) if len(edges) > 1 else (edges, edges)
    # A target within an interval, or at its beginning, has fired; silence is required if both its ends ask for it.
    asked = (rows.last(end) + rows.neuron.refractory <= begin) & (end <= rows.until(end))
    if rows.neuron.first_threshold == "printed":
        asked &= ~((end == rises) & ~np.isfinite(rows.last(end)))
    begin, end = begin[asked], end[asked]
    proven, place, found = np.inf, rows.start, np.inf
    for first in range(0, len(begin), BLOCK):
        here = slice(first, first + BLOCK)
        room, at, found = _Curves(rows, w, begin[here], end[here]).least(found)
        if room < proven:
            proven, place = room, at
        if proven <= 0:
            break
    return proven, place, 0.0


class _Curves:
    """The potential in intervals between inputs: ``a * kernel(x) + b * exp(-x / fast)``, x ms after the beginning."""

    def __init__(self, rows: PatternRows, w: _Floats, begin: _Floats, end: _Floats) -> None:
        self.rows, self.begin, self.end = rows, begin, end
        self.left = rows.following(end)
        near = np.flatnonzero((rows.times <= begin[-1]) & (rows.times > begin[0] - rows.reach))
        weights = (rows.values * w[rows.trains])[near]
        counts, age = rows.counting(near, begin, rows.targets, here=True)
        decay = np.where(counts, np.exp(-age / rows.neuron.tau), 0.0)
        kernels = np.where(counts, rows.kernel(age), 0.0)
        # A kernel is off by some roundings of itself, and by those of its exponents.
        exponents = 1 + age / rows.fast
        self.a, self.b = decay @ weights, kernels @ weights
        self.a_size, self.b_size = (decay * exponents) @ np.abs(weights), (kernels * exponents) @ np.abs(weights)
        self.roundings = (len(near) + rows.roundings) * np.finfo(float).eps
        self.rise = rows.rise(begin, rows.last(end))

    def excess(self, k: NDArray[np.intp], x: _Floats) -> tuple[_Floats, _Floats]:
        """Return the potential less the threshold x ms after the beginning of intervals k, and its largest rounding."""
        rows = self.rows
        kernel, decay = rows.kernel(x), np.exp(-x / rows.fast)
        potential = self.a[k] * kernel + self.b[k] * decay
        size = (self.a_size[k] * kernel + self.b_size[k] * decay) * (1 + x / rows.fast)
        theta = rows.neuron.theta_0 + self.rise[k] * np.exp(-x / rows.recovery)
        return potential - theta, self.roundings * (size + theta)

    def least(self, found: float) -> tuple[float, float, float]:
        """Return the least room in these intervals that is proven, or one not above 0; its time; the least found.

        Intervals are halved until what is proven of each is near the least room found here and before.
        """
        k, proven, place = np.arange(len(self.begin)), np.inf, self.rows.start
        low, high = np.zeros(len(k)), self.end - self.begin
        while len(k):
            begin, left = self.begin[k], np.minimum(1.0, self.left[k] - (self.begin[k] + low))
            room = np.full(len(k), np.inf)
            for x in (low, high):
                excess, rounding = self.excess(k, x)
                below = -(excess + rounding)
                worst = int(below.argmin())
                if below[worst] <= 0:
                    return float(below[worst]), float(begin[worst] + x[worst]), found
                here = below / np.minimum(1.0, self.left[k] - (begin + x))
                room = np.minimum(room, here)
            found = min(found, float(room.min()))
            bound = self.bound(k, low, high) / left
            kept = bound >= _PROVEN * found
            if kept.any() and (least_kept := float(bound[kept].min())) < proven:
                proven, place = least_kept, float((begin + low)[kept][bound[kept].argmin()])
            k, low, high = k[~kept], low[~kept], high[~kept]
            middle = low + 0.5 * (high - low)
            if (flat := (middle <= low) | (middle >= high)).any():
                # No time between the two ends: rounding leaves open whether the threshold is reached.
                return 0.0, float((self.begin[k] + low)[flat][0]), found
            k, low, high = np.tile(k, 2), np.append(low, middle), np.append(middle, high)
        return proven, place, found

    def bound(self, k: NDArray[np.intp], low: _Floats, high: _Floats) -> _Floats:
        """Return the distance below the threshold that intervals keep for certain, from ends and curvature."""
        rows = self.rows
        ends = [self.excess(k, x) for x in (low, high)]
        highest, rounding = np.maximum(ends[0][0], ends[1][0]), np.maximum(ends[0][1], ends[1][1])
        decay = np.exp(-low / rows.fast)
        a, b = self.a[k] * np.exp(-low / rows.neuron.tau), self.b[k] * decay + self.a[k] * rows.kernel(low)
        curved = np.abs(a) * rows.steepest * (1 / rows.fast + 1 / rows.neuron.tau) + np.abs(b) / rows.fast**2
        curved += self.rise[k] * np.exp(-low / rows.recovery) / rows.recovery**2
        by_ends = highest + (high - low) ** 2 / 8 * curved
        by_state: _Floats = np.maximum(a, 0) * rows.largest + np.maximum(b, 0) - rows.neuron.theta_0
        least: _Floats = -(np.minimum(by_ends, by_state) + rounding)
        return least
