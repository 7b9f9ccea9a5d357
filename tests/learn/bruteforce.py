"""The potential summed kernel by kernel, written apart from the package and from `stated`."""

from __future__ import annotations

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
