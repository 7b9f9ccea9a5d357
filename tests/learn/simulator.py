"""A neuron simulated apart from the package: kernels are summed; crossings are bracketed, or sought at grid points.

Slow and plain. An input counts from its own time on and an output spike takes effect at its own time. An input within
1e-6 ms of the end of a refractory time counts as at it; nothing else is rounded.
"""

from __future__ import annotations

import numpy as np

#: Weights that were trained reach the threshold at a target to rounding, mV.
ROUNDING = 5e-12
#: Rounding of a potential's sum, mV. Far from time 0 an output spike at the next representable time is another spike:
#: an input may lie between.
SUM_ROUNDING = 1e-13


def kernel(neuron, ages):
    """The effect of an input, 0 up to the input itself."""
    late, tau = np.maximum(ages, 0), neuron.tau
    if neuron.kernel == "alpha":
        return late / tau * np.exp(-late / tau)
    if neuron.kernel == "exponential":
        return np.where(ages > 0, np.exp(-late / tau), 0.0)
    fast = tau / 4 if neuron.tau_s is None else neuron.tau_s
    top = tau * fast / (tau - fast) * np.log(tau / fast)
    return (np.exp(-late / tau) - np.exp(-late / fast)) / (np.exp(-top / tau) - np.exp(-top / fast))


class Simulated:
    """One neuron on one pattern, in continuous time."""

    def __init__(self, neuron, weights, pattern):
        self.neuron, self.pattern = neuron, pattern
        values = np.ones(len(pattern.times)) if pattern.values is None else pattern.values.astype(float)
        pairs = list(zip(pattern.times, values * np.repeat(weights, pattern.counts), strict=True))
        self.times = np.array([t for t, _ in sorted(pairs)])
        self.weights = np.array([w for _, w in sorted(pairs)])
        self.fired = []

    def above(self, times):
        """Potential less threshold at `times`, behind the spikes so far."""
        neuron, times = self.neuron, np.atleast_1d(times)
        counts = np.ones(len(self.times), bool)
        if neuron.after_spike == "reset" and self.fired:
            counts = self.times > self.fired[-1] + neuron.refractory + 1e-6
        if neuron.after_spike == "ignore":
            for spike in self.fired:
                counts &= ~((self.times > spike + 1e-6) & (self.times <= spike + neuron.refractory + 1e-6))
        kernels = kernel(neuron, times[:, None] - self.times[None, counts])
        rise = 0.0
        last = self.fired[-1] if self.fired else None
        if last is None and neuron.first_threshold == "printed":
            last = self.pattern.start
        if last is not None:
            since = times - last - neuron.refractory
            recovery = 2 * neuron.tau if neuron.tau_rec is None else neuron.tau_rec
            rise = np.where(since >= -1e-9, neuron.theta_plus * np.exp(-np.maximum(since, 0) / recovery), 0.0)
        return kernels @ self.weights[counts] - neuron.theta_0 - rise

    def run(self, until):
        """The output spikes up to `until`; at most a hundred."""
        at = self.pattern.start
        while len(self.fired) < 100:
            spike = self.next(at, until)
            if spike is None:
                break
            self.fired.append(spike)
            at = spike + self.neuron.refractory
        return self.fired

    def next(self, begin, end):
        """The first time from `begin` on at which the potential is at or above the threshold."""
        if begin > end:
            return None
        marks = [begin, end, *self.times, self.pattern.start + self.neuron.refractory]
        marks = np.unique(np.clip(marks, begin, end))
        for low, high in zip(marks, [*marks[1:], end], strict=True):
            inner = low + (high - low) * np.concatenate([np.linspace(0, 1, 200), np.geomspace(1e-9, 0.5, 60)])
            inner = np.unique(np.clip(inner, low, high))
            values = self.above(inner)
            # Of the highest instants the surroundings are looked at more closely.
            for k in np.argsort(values)[-3:]:
                near = np.linspace(inner[max(k - 1, 0)], inner[min(k + 1, len(inner) - 1)], 200)
                inner = np.concatenate([inner, near])
            inner = np.unique(inner)
            values = self.above(inner)
            reached = np.flatnonzero(values >= -ROUNDING)
            if len(reached):
                return self.bracketed(inner, values, int(reached[0]))
        return None

    def bracketed(self, inner, values, k):
        """The crossing before inner[k], where the potential has come up to the threshold to rounding at least."""
        if k == 0:
            return float(inner[0])
        low, high = inner[k - 1], inner[k]
        if values[k] < 0:
            return float(high)
        while high - low > 1e-10 and low < (middle := (low + high) / 2) < high:
            low, high = (low, middle) if self.above(middle)[0] >= -SUM_ROUNDING else (middle, high)
        return float(high)


def on_grid(neuron, weights, pattern, targets, end):
    """The numbers of the grid points at which a neuron fires, and those of the targets.

    Ages are whole numbers of steps less the time of an input since the start, in long double. A potential counts as at
    the threshold from `ROUNDING` below it on, at a target from as far below it as a rounded time may move it.
    """
    pairs = sorted((float(t), float(w)) for train, w in zip(pattern, weights, strict=True) for t in train)
    times, weights = (np.array(column, np.longdouble) for column in zip(*pairs, strict=True))
    step, apart = np.longdouble(neuron.step_ms), 4 * np.spacing(max(abs(pattern.start), abs(end)))
    # An input at the double nearest to a point is at the point.
    points = np.round(((times - pattern.start) / step).astype(float))
    since = np.where(
        times == pattern.start + points * neuron.step_ms, points * step, times - np.longdouble(pattern.start)
    )
    wanted, fired = [round((t - pattern.start) / neuron.step_ms) for t in targets], []
    recovery = 2 * neuron.tau if neuron.tau_rec is None else neuron.tau_rec
    for k in range(round((end - pattern.start) / neuron.step_ms) + 1):
        now, last = k * step, fired[-1] * step if fired else None
        if last is not None and now - last <= neuron.refractory + 1e-9 + apart:
            continue
        counts = np.ones(len(since), bool)
        if neuron.after_spike == "reset" and fired:
            counts = since > last + neuron.refractory + 1e-6
        if neuron.after_spike == "ignore":
            for spike in fired:
                counts &= ~((since > spike * step + 1e-6) & (since <= spike * step + neuron.refractory + 1e-6))
        potential = float(kernel(neuron, (now - since)[counts]) @ weights[counts])
        if last is None and neuron.first_threshold == "printed":
            last = np.longdouble(0)
        recovering = -1.0 if last is None else float(now - last) - neuron.refractory
        rise = neuron.theta_plus * np.exp(-max(recovering, 0) / recovery) if recovering >= -1e-9 - apart else 0.0
        rounding = ROUNDING + (4 * abs(potential) / neuron.tau * apart if k in wanted else 0.0)
        if potential >= neuron.theta_0 + rise - rounding:
            fired.append(k)
    return fired, wanted


def misfire(neuron, weights, pattern, targets, end):
    """The spikes of the simulated neuron where they are not one at each target; None where they are."""
    if neuron.time == "grid":
        fired, wanted = on_grid(neuron, weights, pattern, targets, end)
        return None if fired == wanted else f"fires at points {fired}, not at {wanted}"
    fired = Simulated(neuron, weights, pattern).run(end)
    if len(fired) != len(targets):
        return f"fires at {fired[:9]}, not at {targets}"
    off = np.abs(np.array(fired) - np.array(targets)).max(initial=0)
    return f"fires {off} ms beside a target" if off > 1e-6 + 4 * np.spacing(abs(end)) else None
