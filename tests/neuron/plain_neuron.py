"""The SRM0 neuron of 6.4 to 6.8, written out and stepped finely: the oracle of its tests."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from simulator import kernel

#: On a grid a potential this far below a level counts as at it, in thresholds.
AT = 1e-11


class Plain:
    """6.4 to 6.8 as they stand, one kernel at a time."""

    def __init__(self, neuron, weights, trains, share=1.0):
        self.n, self.start, self.share = neuron, trains.start, share
        self.s, self.w = trains.times, np.repeat(weights, trains.counts)
        if trains.kind == "graded":
            self.w = self.w * trains.values.astype(float)

    def potential(self, t, spikes):
        d, alive = t - self.s, self.s < t
        for spike in spikes:
            end = spike + self.n.refractory + 1e-6
            if self.n.after_spike == "reset":
                alive &= self.s > end
            if self.n.after_spike == "ignore":
                alive &= ~((spike + 1e-6 < self.s) & (self.s <= end))
        return float((self.w[alive] * kernel(self.n, d[alive])).sum())

    def threshold(self, t, spikes):
        spike = spikes[-1] if spikes else (self.start if self.n.first_threshold == "printed" else -np.inf)
        since = t - spike - self.n.refractory
        rec = 2 * self.n.tau if self.n.tau_rec is None else self.n.tau_rec
        return self.share * (self.n.theta_0 + (self.n.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0))

    def above(self, t, spikes):
        return self.potential(t, spikes) - self.threshold(t, spikes)

    def run_grid(self, stop, step):
        spikes, armed, at = [], True, AT * self.n.theta_0
        for k in range(int((stop - self.start) / step + 1e-9) + 1):
            t = self.start + k * step
            potential, level = self.potential(t, spikes), self.threshold(t, spikes)
            if not armed:
                armed = potential < self.n.rearm * level - at
            elif potential >= level - at and not (spikes and t <= spikes[-1] + self.n.refractory + 1e-9):
                spikes.append(t)
                armed = self.n.rearm is None
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
