"""The SRM0 neuron of 6.4 to 6.8, written out and stepped finely: the oracle of its tests."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


class Plain:
    """6.4 to 6.8 as they stand, one kernel at a time."""

    def __init__(self, neuron, weights, trains):
        self.n = neuron
        pairs = sorted((s, n) for n, train in enumerate(trains) for s in train)
        self.s = np.array([s for s, _ in pairs])
        self.w = np.array([weights[n] for _, n in pairs])
        self.start = trains.start

    def potential(self, t, spikes):
        d, alive = t - self.s, self.s < t
        for spike in spikes:
            end = spike + self.n.refractory
            if self.n.after_spike == "reset":
                alive &= self.s > end
            if self.n.after_spike == "ignore":
                alive &= ~((spike < self.s) & (self.s <= end))
        d = d[alive]
        return float((self.w[alive] * self.kernel(d)).sum())

    def kernel(self, d):
        tau = self.n.tau
        if self.n.kernel == "alpha":
            return d / tau * np.exp(-d / tau)
        if self.n.kernel == "exponential":
            return np.exp(-d / tau)
        tau_s = tau / 4 if self.n.tau_s is None else self.n.tau_s
        peak = tau * tau_s / (tau - tau_s) * np.log(tau / tau_s)
        value = np.exp(-d / tau) - np.exp(-d / tau_s)
        return value / (np.exp(-peak / tau) - np.exp(-peak / tau_s))

    def threshold(self, t, spikes):
        spike = spikes[-1] if spikes else (self.start if self.n.first_threshold == "printed" else -np.inf)
        since = t - spike - self.n.refractory
        rec = 2 * self.n.tau if self.n.tau_rec is None else self.n.tau_rec
        return self.n.theta_0 + (self.n.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0)

    def above(self, t, spikes):
        return self.potential(t, spikes) - self.threshold(t, spikes)

    def run_grid(self, stop, step):
        spikes = []
        for k in range(int((stop - self.start) / step + 1e-9) + 1):
            t = self.start + k * step
            if spikes and t <= spikes[-1] + self.n.refractory + 1e-9:
                continue
            if self.above(t, spikes) >= 0:
                spikes.append(t)
        return spikes

    def run_continuous(self, stop):
        """Steps of 0.05 ms between all instants at which something changes; each crossing by Brent's method."""
        spikes, t = [], self.start
        while t < stop:
            marks = {*self.s[self.s > t], stop}
            if self.n.first_threshold == "printed" and not spikes:
                marks.add(self.start + self.n.refractory)
            marks = np.array(sorted(m for m in marks if m > t))
            points = np.unique(np.concatenate([marks, np.arange(t, stop, 0.05)[1:]]))
            before = t
            for point in points:
                if self.above(point, spikes) >= 0:
                    at = before
                    if self.above(before, spikes) < 0:
                        at = brentq(lambda x: self.above(x, spikes), before, point, xtol=1e-13)
                    spikes.append(float(at))
                    break
                before = point
            else:
                return spikes
            t = spikes[-1] + self.n.refractory
            while t < stop and self.above(t, spikes) >= 0:
                spikes.append(t)
                t += self.n.refractory
        return spikes
