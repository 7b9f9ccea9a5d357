"""The potential to 50 digits, at times at which rounding of floats leaves open on which side of the threshold it is."""

from __future__ import annotations

from decimal import MAX_EMAX, MIN_EMIN, Context, Decimal, localcontext
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.learn._statement import AT_EDGE, PatternRows

#: Times are up to 1e15 kernel lengths from the start, which leaves 35 digits of a sum.
_CONTEXT = Context(prec=50, Emin=MIN_EMIN, Emax=MAX_EMAX)
_RELATIVE = Decimal("1e-30")
_Floats = NDArray[np.float64]


class _Terms(NamedTuple):
    """An input, or a sum of inputs, as it grows with each time constant; times its time; and without signs."""

    slow: Decimal
    fast: Decimal
    moment: Decimal
    slow_size: Decimal
    fast_size: Decimal


_NOTHING = _Terms(*[Decimal(0)] * 5)


class ExactPotential:
    """The potential less the threshold of one pattern, for a neuron that fires at the targets.

    An input is ``weight * exp((s - start) / tau)``, computed once; a potential is one exponential times their sum.
    """

    def __init__(self, rows: PatternRows, w: _Floats, exponentials: int) -> None:
        self.rows, self.w = rows, w
        #: How many more exponentials may be computed; 20 terms of a sum count as one.
        self.left = exponentials
        self.terms: dict[int, _Terms] = {}
        self.sums: dict[tuple[int, int], _Terms] = {}

    @cached_property
    def inputs(self) -> tuple[_Floats, _Floats, _Floats, _Floats]:
        """Return times, weights and values of the inputs, in order of time, and sums of the weights before each."""
        rows = self.rows
        kept = np.ones(len(rows.times), bool)
        if rows.neuron.after_spike == "ignore":
            last = rows.last(rows.times)
            kept = (rows.times <= last + AT_EDGE) | (rows.times > last + rows.neuron.refractory + AT_EDGE)
        kept_by_time = np.argsort(rows.times, kind="stable")
        kept_by_time = kept_by_time[kept[kept_by_time]]
        times, weights, values = rows.times[kept_by_time], self.w[rows.trains[kept_by_time]], rows.values[kept_by_time]
        return times, weights, values, np.append(0.0, np.cumsum(np.abs(weights * values)))

    def excess(self, begin: float, x: float, last: float, *, here: bool) -> tuple[float, float] | None:
        """Return the potential less the threshold at ``begin + x`` ms, and its largest rounding; None: too much work.

        Inputs up to `begin` count, those at `begin` itself if `here` is true, after a spike at `last`.
        """
        rows = self.rows
        times, _, _, weights_before = self.inputs
        until = int(np.searchsorted(times, begin, "right" if here else "left"))
        reset = int(np.searchsorted(times, last + rows.neuron.refractory + AT_EDGE, "right"))
        lost = reset if rows.neuron.after_spike == "reset" else 0
        first = max(int(np.searchsorted(times, begin - rows.reach, "right")), lost)
        with localcontext(_CONTEXT):
            self.left -= 3
            sums = self.sum(first, until)
            if sums is None:
                return None
            t, tau, fast = self.time(begin) + Decimal(x), Decimal(rows.neuron.tau), Decimal(rows.fast)
            since = t - Decimal(rows.start)
            decay = (-since / tau).exp()
            potential, size = decay * sums.slow, decay * sums.slow_size
            if rows.rate > 0:
                fall = (-since / fast).exp()
                potential = self.scale * (potential - fall * sums.fast)
                size = self.scale * (size + fall * sums.fast_size)
            elif rows.neuron.kernel == "alpha":
                potential = decay * (since * sums.slow - sums.moment) / tau
                size *= 1 + 2 * abs(since) / tau
            excess = float(potential - self.threshold(begin, t, last))
            rounding = float(_RELATIVE * (1 + size)) + np.finfo(float).eps * abs(excess)
        if first > lost:
            rounding += float((weights_before[first] - weights_before[lost]) * rows.kernel(np.array(rows.reach)))
        return excess, rounding

    def sum(self, first: int, until: int) -> _Terms | None:
        """Return the sum of inputs `first` to `until`; None: too much work."""
        if (first, until) not in self.sums:
            times, weights, values, _ = self.inputs
            new = [i for i in range(first, until) if i not in self.terms]
            self.left -= 2 * len(new) + (until - first) // 20
            if self.left < 0:
                return None
            start, tau, fast = Decimal(self.rows.start), Decimal(self.rows.neuron.tau), Decimal(self.rows.fast)
            for i in new:
                s = self.time(float(times[i])) - start
                weight = Decimal(float(weights[i])) * Decimal(float(values[i]))
                slow = weight * (s / tau).exp()
                quick = weight * (s / fast).exp() if self.rows.rate > 0 else Decimal(0)
                self.terms[i] = _Terms(slow, quick, slow * s, abs(slow), abs(quick))
            columns = zip(*(self.terms[i] for i in range(first, until)), strict=True)
            self.sums[first, until] = (
                _Terms(*(sum(terms, Decimal(0)) for terms in columns)) if until > first else _NOTHING
            )
        return self.sums[first, until] if self.left >= 0 else None

    def time(self, t: float) -> Decimal:
        """Return a time; that of a grid point is a whole number of steps after the start."""
        rows = self.rows
        if rows.on_grid:
            points = round((t - rows.start) / rows.neuron.step_ms)
            if t == rows.start + points * rows.neuron.step_ms:
                return Decimal(rows.start) + points * Decimal(rows.neuron.step_ms)
        return Decimal(t)

    def threshold(self, begin: float, t: Decimal, last: float) -> Decimal:
        """Return the threshold at t after a spike at `last`, as it is from `begin` on."""
        neuron, theta = self.rows.neuron, Decimal(self.rows.neuron.theta_0)
        if self.rows.rise(np.array([begin]), np.array([last]))[0] == 0:
            return theta
        since = t - self.time(max(last, self.rows.start)) - Decimal(neuron.refractory)
        return theta + Decimal(neuron.theta_plus) * (-since / Decimal(self.rows.recovery)).exp()

    @cached_property
    def scale(self) -> Decimal:
        """Return the factor of the double exponential that makes its largest value 1."""
        tau, fast = Decimal(self.rows.neuron.tau), Decimal(self.rows.fast)
        peak = (tau / fast).ln() / (1 / fast - 1 / tau)
        return 1 / ((-peak / tau).exp() - (-peak / fast).exp())
