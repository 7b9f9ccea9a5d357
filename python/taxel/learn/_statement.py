"""The problems 6.9 to 6.14 stated from spikes and kernels, in plain NumPy, for the checks of fits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel._core import ProblemError
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import ConeX, Margin
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains

#: An input this far from the end of a refractory time counts as at it, and a spike this far from its target, ms.
AT_EDGE = 1e-6
#: The end of the silence before a target: how long before it, ms, in continuous time and on a grid.
BEFORE_TARGET, BEFORE_TARGETS_POINT = 0.1 * AT_EDGE, 0.99 * AT_EDGE
#: Grid points that are computed at once.
BLOCK = 256
_Floats = NDArray[np.float64]


def pattern_rows(
    cone: ConeX | ConeR,
    neuron: Neuron,
    patterns: Sequence[SpikeTrains],
    targets: Sequence[_Floats],
    *,
    margin: Margin,
    windows: Sequence[_Floats | None] | None = None,
) -> list[PatternRows]:
    """Return the rows of each pattern, up to the learner's horizon."""
    count = len(patterns)
    horizons = [None] * count if cone.horizon is None else np.broadcast_to(np.asarray(cone.horizon, float), count)
    silences = [None] * count if windows is None else windows
    given = zip(patterns, targets, horizons, silences, strict=True)
    return [PatternRows(neuron, *example, margin=margin) for example in given]


class Stated:
    """The objective of a learner on its examples: 6.14 (6.11 without C and D), and the rows of its targets.

    The sizes of a row, which its rounding depends on, are those of its coefficients without signs.
    """

    def __init__(self, cone: ConeX | ConeR, patterns: list[PatternRows], trains: int) -> None:
        self.cone, self.patterns, neuron = cone, patterns, patterns[0].neuron
        self.lb, self.ub = (np.broadcast_to(np.asarray(bound, np.float64), trains) for bound in (cone.lb, cone.ub))
        # 6.12 at each target, 6.10 behind it: coefficients, and their sizes.
        self.names = [(p, k) for p, rows in enumerate(patterns) for k in range(len(rows.targets))]
        delay = 0.1 * neuron.tau if cone.delta_t_ms is None else cone.delta_t_ms
        at = [patterns[p].target(k) for p, k in self.names]
        behind = [patterns[p].row(patterns[p].targets[k] + delay, patterns[p].targets[:k]) for p, k in self.names]
        self.at, self.at_sizes = np.reshape(at, (-1, 2, trains)).swapaxes(0, 1)
        self.behind, self.behind_sizes = np.reshape(behind, (-1, 2, trains)).swapaxes(0, 1)
        self.theta = np.concatenate([rows.threshold(rows.targets) for rows in patterns])
        self.wanted = cone.kappa * self.theta
        #: Of the distances in B.
        self.power = 2 if cone.form_b == "square" else 1
        # The factors of 6.14: each lambda over the sum of all and over the largest value of its term.
        most = np.maximum(np.abs(self.lb), np.abs(self.ub))
        shares = np.zeros(5)
        shares[: len(cone.lambdas)] = np.array(cone.lambdas) / max(np.sum(cone.lambdas), np.finfo(float).tiny)
        above = [rows.above(np.abs(rows.values) * most[rows.trains])[0] for rows in patterns] if shares[4] > 0 else []
        largest = np.array(
            [
                most.sum(),
                np.linalg.norm(most) ** (2 if cone.norm == "square" else 1),
                ((np.abs(self.behind) @ most + self.wanted) ** self.power).sum(),
                (np.abs(self.at) @ most + self.theta).sum(),
                sum(above),
            ]
        )
        divided = [cone.divide_b_by, *((cone.divide_c_by, cone.divide_d_by) if isinstance(cone, ConeR) else ())]
        for term, by in enumerate(divided, start=2):
            if by == "targets":
                largest[term] = max(len(self.theta), term == 4)
        self.factors = np.divide(shares, largest, out=np.zeros(5), where=largest > 0)
        # The most terms of a sum, and the most roundings of a kernel's age.
        inputs = max(len(rows.times) for rows in patterns)
        self.terms = inputs + trains + len(self.theta) + max(rows.roundings for rows in patterns)

    @property
    def sides(self) -> tuple[str, str]:
        """Return the sides that count in B and in C."""
        return (self.cone.sides_b, self.cone.sides_c) if isinstance(self.cone, ConeR) else ("both", "both")

    def objective(self, w: _Floats) -> tuple[float, float]:
        """Return 6.14 at these weights, and its largest rounding error."""
        (sides_b, sides_c), sizes = self.sides, np.abs(w)
        l1, l2, b, c, d = self.factors
        x, e = self.behind @ w - self.wanted, self.at @ w - self.theta
        x = np.minimum(x, 0.0) if sides_b == "below" else x
        e = np.maximum(-e, 0.0) if sides_c == "below" else np.abs(e)
        above = [rows.above(rows.values * w[rows.trains]) for rows in self.patterns] if d > 0 else [np.zeros(2)]
        above, above_size = np.sum(above, axis=0)
        norms = l1 * sizes.sum() + l2 * np.linalg.norm(w) ** (2 if self.cone.norm == "square" else 1)
        value = norms + b * (np.abs(x) ** self.power).sum() + c * e.sum() + d * above
        b_sizes = b * (self.power * np.abs(x) ** (self.power - 1)) @ (self.behind_sizes @ sizes + self.wanted)
        size = value + b_sizes + c * (self.at_sizes @ sizes + self.theta).sum() + d * above_size
        return float(value), float(np.finfo(float).eps * self.terms * size)


class PatternRows:
    """One pattern with its targets, for a neuron that fires at these: the rows of 6.9, 6.10, 6.12 and 6.13.

    A row has one coefficient a train: the sum of the kernels of its inputs. Silence is required up to the horizon
    (default: the later of the pattern's stop and the last target + tau), in the windows if there are any.
    """

    def __init__(
        self,
        neuron: Neuron,
        pattern: SpikeTrains,
        targets: _Floats,
        horizon: float | None = None,
        windows: _Floats | None = None,
        *,
        margin: Margin,
    ) -> None:
        self.neuron, self.start, self.targets, self.margin = neuron, pattern.start, targets, margin
        self.times, self.values = pattern.times, pattern._ones_without().astype(np.float64)
        self.trains, self.counts = np.repeat(np.arange(len(pattern)), pattern.counts), pattern.counts
        self.end = max([pattern.stop, *(targets[-1:] + neuron.tau)]) if horizon is None else float(horizon)
        self.windows = windows
        tau = neuron.tau
        #: The shorter time constant of the kernel, ms, and the double exponential's own numbers.
        self.fast = tau
        if neuron.kernel == "double_exponential":
            self.fast = tau / 4 if neuron.tau_s is None else neuron.tau_s
        self.rate = 1 / self.fast - 1 / tau
        if self.rate > 0:
            peak = np.log(tau / self.fast) / self.rate
            self.scale = 1 / (np.exp(-peak / tau) - np.exp(-peak / self.fast))
        #: The slope of the kernel at its input, 1/ms.
        self.steepest = self.scale * self.rate if self.rate > 0 else 1 / tau
        #: The largest value of the kernel.
        self.largest = float(np.exp(-1.0)) if neuron.kernel == "alpha" else 1.0

    @property
    def on_grid(self) -> bool:
        """Return whether only grid points count."""
        return self.neuron.time == "grid"

    @property
    def roundings(self) -> float:
        """Return the most roundings of a term of a row: of its kernel, and on a grid of its age."""
        kernel = 16.0 + (self.scale if self.rate > 0 else 0.0)
        return kernel + (math.e * (self.end - self.start) / self.fast if self.on_grid else 0.0)

    @cached_property
    def silent(self) -> _Floats:
        """The grid points at which silence is required, ms."""
        step = self.neuron.step_ms
        t = self.start + np.arange(max(np.ceil((self.end - self.start) / step) + 2, 0)) * step
        return t[self.is_silent(t)]

    @cached_property
    def limits(self) -> _Floats:
        """The limit of the potential at these points, mV."""
        return self.limit(self.silent)

    def is_point(self, t: float) -> bool:
        """Return whether a time is a point of the grid."""
        step = self.neuron.step_ms
        return bool(abs(self.start + round((t - self.start) / step) * step - t) <= _rounding(t))

    def is_silent(self, t: _Floats) -> NDArray[np.bool_]:
        """Return whether silence is required at these times, on a grid at these points."""
        ended, last, rounding = self.last(t) + self.neuron.refractory, self.end, _rounding(t)
        silent = t > ended + rounding if self.on_grid else t >= ended
        silent &= (t >= self.start) & (t <= last + (_rounding(last) if self.on_grid else 0.0)) & (t <= self.until(t))
        if self.windows is not None:
            starts, stops = self.windows.reshape(-1, 2, 1).swapaxes(0, 1)
            silent &= ((starts - rounding <= t) & (t <= stops + rounding)).any(axis=0)
        return silent

    def last(self, t: _Floats) -> _Floats:
        """Return the last target before each time; minus infinity where there is none."""
        return _last(self.targets, t)

    def following(self, t: _Floats) -> _Floats:
        """Return the first target at or after each time; infinity where there is none."""
        return np.append(self.targets, np.inf)[np.searchsorted(self.targets, t)]

    def until(self, t: _Floats) -> _Floats:
        """Return the end of the silence before the next target."""
        target = self.following(t)
        before = BEFORE_TARGETS_POINT if self.on_grid else BEFORE_TARGET
        return np.minimum(target - before, np.nextafter(target, -np.inf))

    def threshold(self, t: _Floats) -> _Floats:
        """Return the threshold at these times (6.8), mV."""
        return self.neuron.theta_0 + self.rise(t, self.last(t))

    def rise(self, t: _Floats, last: _Floats) -> _Floats:
        """Return the part of the threshold above theta_0 at these times, each after the last of its targets, mV."""
        neuron = self.neuron
        if neuron.first_threshold == "printed":
            last = np.maximum(last, self.start)
        since, rounding = t - last - neuron.refractory, _rounding(t)
        rise = neuron.theta_plus * np.exp(-np.maximum(since, -rounding) / self.recovery)
        return np.where(since >= -rounding, rise, 0.0)

    @property
    def recovery(self) -> float:
        """Return the time constant with which the threshold recovers, ms."""
        return 2 * self.neuron.tau if self.neuron.tau_rec is None else self.neuron.tau_rec

    def limit(self, t: _Floats, margin: bool = True) -> _Floats:
        """Return the limit of the potential where silence is required: the threshold less the margin, mV."""
        if not margin:
            return self.threshold(t)
        height, slope = self.margin
        if slope == 0:
            return self.threshold(t) - height
        # The margin falls to 0 at a target, as the kernel continued to times before its input does.
        with np.errstate(over="ignore"):
            tapered = -slope / self.steepest * self.kernel(t - self.following(t))
        return self.threshold(t) - np.minimum(height, tapered)

    def target(self, k: int) -> _Floats:
        """Return the row of a target: coefficients, and the sizes of their terms."""
        return self.row(float(self.targets[k]), self.targets[:k])

    def slope(self, k: int) -> _Floats:
        """Return the row of the slope just before a target, 1/ms, negated, and the sizes of its terms."""
        t = float(self.targets[k])
        near = np.flatnonzero(self.times < t)
        counts, age = self.counting(near, np.array([t]), self.targets[:k])
        decay, tau = np.exp(-age / self.neuron.tau), self.neuron.tau
        if self.rate > 0:
            fast = np.exp(-age / self.fast) / self.fast
            falls, sizes = self.scale * (decay / tau - fast), self.scale * (decay / tau + fast)
        else:
            falls, sizes = (age / tau - 1) * decay / tau, (age / tau + 1) * decay / tau
        return self.by_train(near, np.where(counts, falls, 0.0)[0], np.where(counts, sizes, 0.0)[0])

    def fall(self, k: int) -> float:
        """Return how steeply the threshold falls at a target, mV/ms."""
        return float((self.threshold(self.targets[k : k + 1])[0] - self.neuron.theta_0) / self.recovery)

    def row(self, t: float, fired: _Floats) -> _Floats:
        """Return the coefficients of the potential at a time, given spikes at `fired`, and the sizes of their terms."""
        near = np.flatnonzero(self.times < t)
        counts, age = self.counting(near, np.array([t]), fired)
        kernels = np.where(counts, self.kernel(age), 0.0)
        # In continuous time an age is exact to one rounding of itself, on a grid to some of the whole span.
        largest = np.where(kernels > 0, self.largest, 0.0) if self.on_grid else kernels * (1 + age / self.fast)
        return self.by_train(near, kernels[0], largest[0])

    def by_train(self, inputs: NDArray[np.intp], kernels: _Floats, sizes: _Floats) -> _Floats:
        """Return the sums of the inputs' values times kernels by train, and those without signs times sizes."""
        values, trains = self.values[inputs], self.trains[inputs]
        parts = (values * kernels, np.abs(values) * sizes)
        return np.array([np.bincount(trains, part, len(self.counts)) for part in parts])

    def above(self, weights: _Floats) -> _Floats:
        """Return 6.13 for these weights of inputs, the sum of the potential's excess over its limits, and its size."""
        total = np.zeros(2)
        for t, potential, size in self.potentials(weights, self.silent):
            limits = self.limit(t)
            excess = potential - limits
            total += excess[excess > 0].sum(), (size + limits)[excess > 0].sum()
        return total

    def potentials(self, weights: _Floats, instants: _Floats) -> Iterator[tuple[_Floats, _Floats, _Floats]]:
        """Give silent instants in blocks, with the potential for these weights of inputs, and its size."""
        for begin in range(0, len(instants), BLOCK):
            t: _Floats = instants[begin : begin + BLOCK]
            near = np.flatnonzero((self.times < t[-1]) & (self.times > t[0] - self.reach))
            counts, age = self.counting(near, t, self.targets)
            kernels = np.where(counts, self.kernel(age), 0.0)
            size = self.largest * ((kernels > 0).astype(np.float64) @ np.abs(weights[near]))
            yield t, kernels @ weights[near], size

    @property
    def reach(self) -> float:
        """Return the age of an input, ms, above which its kernel is smaller than the rounding of the others."""
        sizes = np.abs(self.values[self.values != 0])
        return (50 + np.log(sizes.max() / sizes.min())) * self.neuron.tau if len(sizes) else 0.0

    def counting(self, inputs: NDArray[np.intp], t: _Floats, fired: _Floats) -> tuple[NDArray[np.bool_], _Floats]:
        """Return which inputs (a column each) count at these times, given spikes at `fired`, and their ages."""
        neuron, s = self.neuron, self.times[inputs]
        counts = s < t[:, None]
        if neuron.after_spike == "reset":
            last = _last(fired, t)
            counts &= s > (last + neuron.refractory + AT_EDGE)[:, None]
        elif neuron.after_spike == "ignore":
            last = _last(fired, s)
            counts &= (s <= last + AT_EDGE) | (s > last + neuron.refractory + AT_EDGE)
        ages = self.since(t)[:, None] - self.since(s) if self.on_grid else t[:, None] - s
        return counts, np.where(counts, ages, 0.0)

    def kernel(self, age: _Floats) -> _Floats:
        """Return the kernel at these ages (6.5)."""
        tau = self.neuron.tau
        decay = np.exp(-age / tau)
        if self.neuron.kernel == "exponential":
            return decay
        return -self.scale * decay * np.expm1(-age * self.rate) if self.rate > 0 else age / tau * decay

    def since(self, t: _Floats) -> _Floats:
        """Return the times since the start, ms; those of grid points are whole numbers of steps, without rounding."""
        points = np.round((t - self.start) / self.neuron.step_ms) * self.neuron.step_ms
        return np.where(t == self.start + points, points, t - self.start)

    def named(self, kind: str, at: float, where: str, *, margin: bool = True) -> tuple[_Floats, _Floats, float]:
        """Return the row of this name: coefficients, sizes, limit; refuse a row that the problem does not have."""
        if kind in ("target", "slope") and at in range(len(self.targets)) and not (kind == "slope" and self.on_grid):
            k = int(at)
            if kind == "target":
                return (*self.target(k), float(self.threshold(self.targets[k : k + 1])[0]))
            return (*self.slope(k), self.fall(k) - (self.margin.slope if margin else 0.0))
        if kind == "silence" and (at in self.silent if self.on_grid else self.is_silent(np.array([at]))[0]):
            return (*self.row(at, self.targets[self.targets < at]), float(self.limit(np.array([at]), margin)[0]))
        raise ProblemError(f"{where} {kind}, {at}: the problem has no such row")


def _last(targets: _Floats, t: _Floats) -> _Floats:
    """Return the last target before each time; minus infinity where there is none."""
    return np.append(-np.inf, targets)[np.searchsorted(targets, t)]


def _rounding(t: float | _Floats) -> _Floats:
    """Return the distance up to which sums of times count as equal, ms."""
    return np.maximum(4 * np.finfo(float).eps * np.abs(t), 1e-9)
