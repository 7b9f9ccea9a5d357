"""A trained neuron looked at from outside: potentials summed kernel by kernel at very many instants.

Written apart from the package and from `stated`: spikes are put at the targets, and what 6.9 asks is looked at between
them, close together wherever something happens and ever wider apart in pauses.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np


def potential(neuron, weights, pattern, times, fired):
    """The potential (6.7) at `times` behind `fired`, up to the next target."""
    tau, refractory = neuron.tau, neuron.refractory
    tau_s = tau / 4 if neuron.tau_s is None else neuron.tau_s
    total = np.zeros(len(times))
    for train, weight in zip(pattern, weights, strict=True):
        for s in train:
            if neuron.after_spike == "reset" and fired and s <= fired[-1] + refractory + 1e-6:
                continue
            if neuron.after_spike == "ignore" and any(e + 1e-6 < s <= e + refractory + 1e-6 for e in fired):
                continue
            age = np.maximum(times - s, 0.0)
            if neuron.kernel == "alpha":
                value = age / tau * np.exp(-age / tau)
            else:
                top = tau * tau_s / (tau - tau_s) * np.log(tau / tau_s)
                value = (np.exp(-age / tau) - np.exp(-age / tau_s)) / (np.exp(-top / tau) - np.exp(-top / tau_s))
            total += weight * np.where(times > s, value, 0.0)
    return total


def threshold(neuron, times, fired, start):
    """The threshold (6.8) at `times` behind the last of `fired`."""
    last = fired[-1] if fired else (start if neuron.first_threshold == "printed" else None)
    if last is None:
        return np.full(len(times), neuron.theta_0)
    since = times - last - neuron.refractory
    recovery = 2 * neuron.tau if neuron.tau_rec is None else neuron.tau_rec
    return neuron.theta_0 + np.where(since >= -1e-9, neuron.theta_plus * np.exp(-np.maximum(since, 0) / recovery), 0.0)


def instants(begin, end, tau, marks, points=60):
    """Times from begin to end: dense in the first tau behind each mark and before the end, wider and wider between."""
    marks = np.unique(np.clip([begin, end, *marks], begin, end))
    found = [marks]
    for low, high in pairwise(marks):
        steps = np.concatenate([np.linspace(0, 1, points), np.geomspace(1e-9, 1, points)])
        length = high - low
        near = min(length, 20 * tau)
        found += [low + steps * near, high - steps * near, low + np.geomspace(1e-6, 1, points) * length]
    return np.unique(np.clip(np.concatenate(found), begin, end))


def looked_at(neuron, weights, pattern, targets, *, end=None):
    """How far the worst target is missed, the least room below the threshold (over its taper), the least slope."""
    targets = [float(t) for t in targets]
    end = max([pattern.stop, *[targets[-1] + neuron.tau][: len(targets)]]) if end is None else end
    inputs = np.concatenate([*pattern, []])
    missed, room, slope = 0.0, np.inf, np.inf
    for k in range(len(targets) + 1):
        fired = targets[:k]
        begin = fired[-1] + neuron.refractory if fired else pattern.start
        stop = targets[k] if k < len(targets) else end
        if stop < begin:
            continue
        times = instants(begin, stop, neuron.tau, [*inputs, pattern.start + neuron.refractory])
        if k < len(targets):
            at = np.array([stop, stop - 1e-5])
            u = potential(neuron, weights, pattern, at, fired)
            theta = threshold(neuron, at, fired, pattern.start)
            missed = max(missed, abs(u[0] - theta[0]))
            slope = min(slope, ((u[0] - theta[0]) - (u[1] - theta[1])) / 1e-5)
            times = times[times <= stop - 1e-6]
        if len(times):
            u = potential(neuron, weights, pattern, times, fired)
            left = threshold(neuron, times, fired, pattern.start) - u
            if k < len(targets):
                # Near a target the margin falls to 0 with at least the slope that is asked for.
                left = left / np.minimum(1.0, np.maximum(stop - times, 1e-300))
            room = min(room, left.min())
    return missed, room, slope
