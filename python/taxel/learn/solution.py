"""The check of a solution: that a fitted neuron fires at its targets and nowhere else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.errors import refused
from taxel.learn._checked import checked_examples, fitted
from taxel.learn._exact import ExactPotential
from taxel.learn._statement import AT_EDGE, BLOCK, PatternRows, pattern_rows
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import ConeX, Margin
from taxel.spikes import SpikeTrains

#: A potential this far below the threshold reaches it, in thresholds (1e-12 mV at 0.3 mV).
_TOUCH = 1e-12 / 0.3
#: The share of the least room found that is proven.
_PROVEN = 0.8
#: If the rounding of a potential is not below this share of its distance from the threshold, it is computed exactly.
_VAGUE = 0.02
#: The most exponentials that are computed exactly in a check (a few seconds), intervals of a block, halvings of one.
_EXPONENTIALS, _INTERVALS, _HALVINGS = 100_000, 1_000_000, 200
_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Checked:
    """Tell whether a fitted neuron fires at its targets and nowhere else, and by how much; true if that is proven.

    Parameters
    ----------
    holds : bool
        Whether it provably does, with every weight within its bounds: nothing is `wrong` and nothing `unproven`.
    missed_mv : float, mV
        The largest distance of the potential from the threshold at a target.
    room_mv : float, mV
        A distance that the potential is proven to keep below the threshold wherever silence is required: at least 0.8
        of the least one, unless the check reaches its limits. Within the last millisecond before a target, where it
        falls to 0, it is divided by the ms left. On a grid it is the least one at the grid points. Where it is not
        above 0, it is the distance found, or none is proven.
    slope : float, mV/ms
        The least slope at which the potential crosses the threshold at a target; infinite without targets or on a grid.
    wrong : str or None
        The first pattern and time at which something is proven to be wrong.
    unproven : str or None
        The first pattern and time at which neither can be proven, in the time that the check allows itself.
    """

    holds: bool
    missed_mv: float
    room_mv: float
    slope: float
    wrong: str | None
    unproven: str | None

    def __bool__(self) -> bool:
        return self.holds


def check_solution(cone: ConeX | ConeR, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> Checked:
    """Check that a fitted neuron fires at every target and nowhere else, computed again in plain NumPy.

    Spikes are put at the targets. Then the neuron fires at them if its potential reaches the threshold at each (6.9a),
    and nowhere else if it stays below at all other times outside the refractory times (6.9b), up to the horizon. Both
    are linear in the weights, which must be within their bounds (6.9c).

    In continuous time silence is proven at every instant, not at samples: between two inputs the potential is one curve
    of the kernel's family, whose second derivative is bounded. An interval whose ends and curvature leave no room is
    halved, and a potential that floats cannot tell from the threshold is computed to 50 digits. Halvings and digits are
    limited, to a few seconds in all; what is then still open is `unproven`. A target counts as met if the first
    crossing is at most 1e-6 ms before or behind it, as `ConeX` has it.

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
    Thesis 6.3.2, equations 6.7 to 6.9. Compiled code of taxel takes no part. Windows of silence (`ConeR.fit`) are not
    read: silence is checked everywhere. Cost: inputs times the inputs of the last 50 `tau`.

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
        raise refused("cone", f" is {cone.status_}, so it has no weights to check")
    trained, times, _ = checked_examples(cone, len(w), patterns, targets)
    all_rows = pattern_rows(cone, cone.neuron_, trained, times, margin=Margin(0.0, 0.0))
    missed, room, slope = 0.0, np.inf, np.inf
    lb, ub = (np.broadcast_to(np.asarray(bound, np.float64), len(w)) for bound in (cone.lb, cone.ub))
    out = np.flatnonzero((w < lb) | (w > ub))[:1]
    wrong = [f"weight {n}: {w[n]} mV is outside its bounds, {lb[n]} to {ub[n]} mV" for n in out]
    unproven: list[str] = []
    touch, exponentials = _TOUCH * cone.neuron_.theta_0, _EXPONENTIALS
    for p, rows in enumerate(all_rows):
        exact = ExactPotential(rows, w, exponentials)
        least = _on_grid(rows, w, exact, touch) if rows.on_grid else _room(rows, w, exact, touch)
        room = min(room, least.room)
        if least.silent is False:
            wrong.append(
                f"pattern {p}: the potential reaches the threshold at {least.at:.6f} ms, where silence is required"
            )
        elif least.silent is None:
            unproven.append(
                f"pattern {p}: whether the potential stays below the threshold at {least.at:.6f} ms is not proven"
            )
        for k, t in enumerate(rows.targets):
            off, fires = _at_target(rows, w, exact, k, touch)
            missed = max(missed, abs(off))
            if fires is False:
                wrong.append(
                    f"pattern {p}: the neuron does not fire at target {k} ({t:g} ms), because its potential is "
                    f"{-off:.1e} mV below the threshold"
                )
            elif fires is None:
                unproven.append(f"pattern {p}: whether the neuron fires at target {k} ({t:g} ms) is not proven")
            if rows.on_grid and not rows.is_point(float(t)):
                wrong.append(
                    f"pattern {p}: target {k} ({t:g} ms) is between two time steps; a neuron fires only at a time step"
                )
            if not rows.on_grid:
                slope = min(slope, float(-rows.slope(k)[0] @ w + rows.fall(k)))
        exponentials = exact.left
    reasons = (wrong[0] if wrong else None, unproven[0] if unproven else None)
    return Checked(not wrong and not unproven, missed, float(room), slope, *reasons)


class _Least(NamedTuple):
    """The least distance below the threshold, its time, and whether silence holds; None: that is not proven."""

    room: float
    at: float
    silent: bool | None


def _vague(excess: _Floats, rounding: _Floats) -> NDArray[np.bool_]:
    """Return where rounding is a considerable part of an excess, or either is not a number."""
    return ~(rounding < _VAGUE * np.abs(excess))


def _at_target(rows: PatternRows, w: _Floats, exact: ExactPotential, k: int, touch: float) -> tuple[float, bool | None]:
    """Return the potential less the threshold at a target, and whether the neuron fires there; None: not proven."""
    coefficients, sizes = rows.target(k)
    off = float(coefficients @ w - rows.threshold(rows.targets[k : k + 1])[0])
    rounding = (np.abs(w) @ sizes + rows.neuron.theta_0) * np.finfo(float).eps * (len(rows.times) + len(w))
    if rows.on_grid or off + touch > rounding:
        # On a grid the neuron allows for the rounding of a point's time.
        return off, bool(off >= -touch - rounding)
    t = float(rows.targets[k])
    if off + touch >= -rounding and (found := exact.excess(t, 0.0, _last(rows, k), here=False)) is not None:
        off = found[0]
    # As the potential rises, it may reach the threshold up to 1e-6 ms later.
    inputs = np.unique(rows.times[(rows.times > t) & (rows.times < t + AT_EDGE)])
    answers = set()
    for begin, end in pairwise([t, *inputs.tolist(), t + AT_EDGE]):
        answers.add(fires := _reaches(rows, w, exact, k, (begin, end), touch))
        if fires:
            return off, True
    return off, None if None in answers else False


def _last(rows: PatternRows, k: int) -> float:
    """Return the target before target k; minus infinity where there is none."""
    return float(rows.targets[k - 1]) if k > 0 else -np.inf


def _reaches(
    rows: PatternRows, w: _Floats, exact: ExactPotential, k: int, interval: tuple[float, float], touch: float
) -> bool | None:
    """Return whether the potential reaches the threshold in an interval between inputs behind target k; None: open.

    The neuron has not fired at target k. Ends and curvature decide; what floats leave open is halved in 50 digits.
    """
    (begin, end), last, theta_0 = interval, _last(rows, k), rows.neuron.theta_0
    highest, curvature = -np.inf, 0.0
    for t in interval:
        coefficients, sizes = rows.row(t, rows.targets[:k])
        rise = float(rows.rise(np.array([t]), np.array([last]))[0])
        rounding = (np.abs(w) @ sizes + theta_0 + rise) * np.finfo(float).eps
        rounding *= len(rows.times) + len(w) + rows.roundings
        excess = float(coefficients @ w) - theta_0 - rise + touch
        if excess > rounding:
            return True
        highest, curvature = max(highest, excess + rounding), max(curvature, rise / rows.recovery**2)
    before = rows.times < end
    age = np.maximum(begin - rows.times[before], 0.0)
    curved = np.exp(-age / rows.neuron.tau) * rows.steepest * (1 / rows.fast + 1 / rows.neuron.tau)
    curved += rows.kernel(age) / rows.fast**2
    curvature += float(curved @ np.abs(rows.values * w[rows.trains])[before])
    if highest + (end - begin) ** 2 / 8 * curvature < 0:
        return False
    parts = [(0.0, end - begin)]
    for _ in range(_HALVINGS):
        if not parts:
            return False
        low, high = parts.pop()
        highest = -np.inf
        for x in (low, high):
            found = exact.excess(begin, x, last, here=begin + x > float(rows.targets[k]))
            if found is None:
                return None
            if found[0] + touch >= found[1]:
                return True
            highest = max(highest, found[0] + touch + found[1])
        if highest + (high - low) ** 2 / 8 * curvature >= 0:
            middle = low + 0.5 * (high - low)
            parts += [(low, middle), (middle, high)]
    return None


def _on_grid(rows: PatternRows, w: _Floats, exact: ExactPotential, touch: float) -> _Least:
    """Return the least distance below the threshold over the silent grid points, at which no potential may touch it."""
    least = _Least(np.inf, rows.start, True)
    for t, potential, size in rows.potentials(rows.values * w[rows.trains]):
        room = rows.threshold(t) - potential
        rounding = np.finfo(float).eps * (len(rows.times) + rows.roundings) * (size + np.abs(room))
        for j in np.flatnonzero(np.abs(room - touch) <= rounding):
            found = exact.excess(float(t[j]), 0.0, float(rows.last(t[j : j + 1])[0]), here=False)
            if found is not None:
                room[j], rounding[j] = -found[0], found[1]
        k = int(room.argmin())
        reached = np.flatnonzero(room - touch <= -rounding)[:1]
        open_ones = np.flatnonzero(room - touch <= rounding)[:1]
        if len(reached):
            return _Least(float(room[k]), float(t[reached[0]]), False)
        room_here = min(least.room, float(room[k]))
        if len(open_ones) and least.silent:
            least = _Least(room_here, float(t[open_ones[0]]), None)
        elif room[k] < least.room:
            least = _Least(room_here, float(t[k]) if least.silent else least.at, least.silent)
    return least


def _room(rows: PatternRows, w: _Floats, exact: ExactPotential, touch: float) -> _Least:
    """Return the least distance below the threshold that is proven, or one found that is not above 0, and its time.

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
    allowed = (rows.last(end) + rows.neuron.refractory <= begin) & (end <= rows.until(end))
    if rows.neuron.first_threshold == "printed":
        allowed &= ~((end == rises) & ~np.isfinite(rows.last(end)))
    begin, end = begin[allowed], end[allowed]
    least, found = _Least(np.inf, rows.start, True), np.inf
    for first in range(0, len(begin), BLOCK):
        here = slice(first, first + BLOCK)
        margin, found = _Curves(rows, w, exact, begin[here], end[here]).least(found, touch)
        if margin.silent is False:
            return margin
        if least.silent and (margin.silent is None or margin.room < least.room):
            least = margin
    return least


class _Curves:
    """The potential in intervals between inputs: ``a * kernel(x) + b * exp(-x / fast)``, x ms after the beginning."""

    def __init__(self, rows: PatternRows, w: _Floats, exact: ExactPotential, begin: _Floats, end: _Floats) -> None:
        self.rows, self.exact, self.begin, self.end = rows, exact, begin, end
        self.last, self.left = rows.last(end), rows.following(end)
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
        self.rise = rows.rise(begin, self.last)

    def excess(self, k: NDArray[np.intp], x: _Floats) -> _Floats:
        """Return the potential less the threshold x ms after the beginning of intervals k, and its largest rounding."""
        rows = self.rows
        kernel, decay = rows.kernel(x), np.exp(-x / rows.fast)
        potential = self.a[k] * kernel + self.b[k] * decay
        size = (self.a_size[k] * kernel + self.b_size[k] * decay) * (1 + x / rows.fast)
        theta = rows.neuron.theta_0 + self.rise[k] * np.exp(-x / rows.recovery)
        excess, rounding = potential - theta, self.roundings * (size + theta)
        for j in np.flatnonzero(_vague(excess, rounding)) if self.exact.left > 0 else ():
            found = self.exact.excess(float(self.begin[k[j]]), float(x[j]), float(self.last[k[j]]), here=True)
            if found is not None:
                excess[j], rounding[j] = found
        return np.array([excess, rounding])

    def least(self, found: float, touch: float) -> tuple[_Least, float]:
        """Return the least room in these intervals that is proven, or one not above 0; the least found here and before.

        Intervals are halved until what is proven of each is near the least room found here and before. Where the neuron
        may fire although the potential stays below its threshold, silence is not proven; in the last millisecond before
        a target it may come that near.
        """
        k, least, intervals = np.arange(len(self.begin)), _Least(np.inf, self.rows.start, True), 0
        low, high = np.zeros(len(k)), self.end - self.begin
        at_low, at_high = self.excess(k, low), self.excess(k, high)
        for _ in range(_HALVINGS):
            begin, left = self.begin[k], np.minimum(1.0, self.left[k] - (self.begin[k] + low))
            for x, (excess, rounding) in ((low, at_low), (high, at_high)):
                reached = np.flatnonzero((excess >= rounding) & np.isfinite(rounding))
                if len(reached):
                    worst = reached[(excess - rounding)[reached].argmax()]
                    return _Least(float(-excess[worst]), float(begin[worst] + x[worst]), False), found
                room = -(excess + rounding) / np.minimum(1.0, self.left[k] - (begin + x))
                found = min(found, float(room.min(initial=np.inf, where=room > 0)))
            bound, settled = self.bound(k, (low, at_low), (high, at_high))
            bound /= left
            kept = (bound >= _PROVEN * found) | settled
            if kept.any():
                near = kept & (bound <= np.where(left < 1.0, 0.0, touch))
                candidates = near if near.any() else kept
                j = int(np.flatnonzero(candidates)[bound[candidates].argmin()])
                if bound[j] < least.room or (near.any() and least.silent):
                    silent = None if near.any() else least.silent
                    least = _Least(min(least.room, float(bound[j])), float(begin[j] + low[j]), silent)
            k, low, high, at_low, at_high = k[~kept], low[~kept], high[~kept], at_low[:, ~kept], at_high[:, ~kept]
            intervals += len(k)
            if not len(k) or intervals > _INTERVALS:
                break
            middle = low + 0.5 * (high - low)
            between = self.excess(k, middle)
            k, low, high = np.tile(k, 2), np.append(low, middle), np.append(middle, high)
            at_low, at_high = np.hstack([at_low, between]), np.hstack([between, at_high])
        if len(k) and least.silent:
            least = _Least(min(0.0, float(bound.min())), float(self.begin[k[0]] + low[0]), None)
        return least, found

    def bound(
        self, k: NDArray[np.intp], lower: tuple[_Floats, _Floats], higher: tuple[_Floats, _Floats]
    ) -> tuple[_Floats, NDArray[np.bool_]]:
        """Return the distance below the threshold that intervals keep for certain, from ends and curvature.

        Also whether rounding decides and is more than curvature, so that halves would prove no more. An end is its x
        and, at x, the potential less the threshold and its rounding.
        """
        rows, (low, at_low), (high, at_high) = self.rows, lower, higher
        decay = np.exp(-low / rows.fast)
        a, b = self.a[k] * np.exp(-low / rows.neuron.tau), self.b[k] * decay + self.a[k] * rows.kernel(low)
        rounding = 2 * self.roundings * (self.a_size[k] + self.b_size[k] + rows.neuron.theta_0)
        curved = (np.abs(a) + rounding) * rows.steepest * (1 / rows.fast + 1 / rows.neuron.tau)
        curved += (np.abs(b) + rounding) / rows.fast**2
        curved += self.rise[k] * np.exp(-low / rows.recovery) / rows.recovery**2
        curve = (high - low) ** 2 / 8 * curved
        by_ends = np.maximum(at_low.sum(axis=0), at_high.sum(axis=0)) + curve
        by_state = np.maximum(a, 0) * rows.largest + np.maximum(b, 0) - rows.neuron.theta_0 + rounding
        # A value that is not a number is not proven, and its halves are not numbers.
        below = np.nan_to_num(-np.minimum(by_ends, by_state), nan=-np.inf)
        settled = [_vague(*end) & ~(curve > end[1]) for end in (at_low, at_high)]
        return below, settled[0] | settled[1]
