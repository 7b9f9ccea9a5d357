"""A neuron in continuous time, simulated apart from the package: kernels are summed, crossings bracketed.

Slow and plain. An input counts from its own time on and an output spike takes effect at its own time. An input within
1e-6 ms of the end of a refractory time counts as at it; nothing else is rounded.
"""

from __future__ import annotations

import numpy as np

#: Weights that were trained reach the threshold at a target to rounding, mV.
ROUNDING = 5e-12


class Simulated:
    """One neuron on one pattern."""

    def __init__(self, neuron, weights, pattern):
        self.neuron, self.pattern = neuron, pattern
        pairs = [(float(t), float(w)) for train, w in zip(pattern, weights, strict=True) for t in train]
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
        ages = np.maximum(times[:, None] - self.times[None, counts], 0.0)
        if neuron.kernel == "alpha":
            kernels = ages / neuron.tau * np.exp(-ages / neuron.tau)
        else:
            fast = neuron.tau / 4 if neuron.tau_s is None else neuron.tau_s
            top = neuron.tau * fast / (neuron.tau - fast) * np.log(neuron.tau / fast)
            kernels = (np.exp(-ages / neuron.tau) - np.exp(-ages / fast)) / (
                np.exp(-top / neuron.tau) - np.exp(-top / fast)
            )
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
        while high - low > max(1e-10, 2 * np.spacing(abs(high))):
            middle = (low + high) / 2
            low, high = (low, middle) if self.above(middle)[0] >= 0 else (middle, high)
        return float(high)


def misfire(neuron, weights, pattern, targets, end):
    """What the simulated neuron does else than fire once at each target, within 1e-6 ms; None: nothing."""
    fired = Simulated(neuron, weights, pattern).run(end)
    if len(fired) != len(targets):
        return f"fires at {fired[:9]}, not at {targets}"
    off = np.abs(np.array(fired) - np.array(targets)).max(initial=0)
    return f"fires {off} ms beside a target" if off > 1e-6 + 4 * np.spacing(abs(end)) else None
