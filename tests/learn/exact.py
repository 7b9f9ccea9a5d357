"""The potential less the threshold to 60 digits, summed kernel by kernel: the oracle of what rounding leaves open."""

from __future__ import annotations

from decimal import Context, Decimal, localcontext

import numpy as np

_CONTEXT = Context(prec=60, Emin=-(10**15), Emax=10**15)


def excess(neuron, weights, pattern, t, fired, begin=None):
    """The potential less the threshold at t (a float or a Decimal), behind the spikes `fired`.

    Inputs before t count, those up to `begin` where it is given.
    """
    with localcontext(_CONTEXT):
        now, tau, total = Decimal(t), Decimal(neuron.tau), Decimal(0)
        fast = Decimal(neuron.tau / 4 if neuron.tau_s is None else neuron.tau_s)
        if neuron.kernel == "double_exponential":
            top = (tau / fast).ln() / (1 / fast - 1 / tau)
            scale = 1 / ((-top / tau).exp() - (-top / fast).exp())
        values = np.ones(len(pattern.times)) if pattern.values is None else pattern.values.astype(float)
        for s, value, weight in zip(pattern.times, values, np.repeat(weights, pattern.counts), strict=True):
            age = now - Decimal(float(s))
            if age <= 0 or (begin is not None and s > begin) or not counts(neuron, s, fired):
                continue
            decay = (-age / tau).exp()
            one = age / tau * decay if neuron.kernel == "alpha" else scale * (decay - (-age / fast).exp())
            total += Decimal(float(value)) * Decimal(float(weight)) * one
        return total - threshold(neuron, now, fired, pattern.start)


def counts(neuron, s, fired):
    """Whether an input at s counts; within 1e-6 ms of an edge it is at it."""
    if neuron.after_spike == "reset" and len(fired):
        return s > fired[-1] + neuron.refractory + 1e-6
    return neuron.after_spike != "ignore" or not any(e + 1e-6 < s <= e + neuron.refractory + 1e-6 for e in fired)


def threshold(neuron, now, fired, start):
    theta, since = Decimal(neuron.theta_0), None
    if len(fired) or neuron.first_threshold == "printed":
        since = now - Decimal(fired[-1] if len(fired) else start) - Decimal(neuron.refractory)
    if since is None or since < Decimal("-1e-9"):
        return theta
    recovery = Decimal(2 * neuron.tau if neuron.tau_rec is None else neuron.tau_rec)
    return theta + Decimal(neuron.theta_plus) * (-max(since, Decimal(0)) / recovery).exp()


def reaches(neuron, weights, pattern, targets, k):
    """Whether the potential reaches the threshold at target k, or at an input up to 1e-6 ms behind it."""
    t, fired = targets[k], targets[:k]
    behind = [float(s) for s in np.unique(pattern.times) if t < s < t + 1e-6]
    return any(excess(neuron, weights, pattern, at, fired) >= 0 for at in (t, *behind, t + 1e-6))
