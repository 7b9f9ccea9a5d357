"""What the tests of the rules that learn by epochs share: patterns, and the formulas in plain NumPy."""

from functools import cache

import numpy as np

from taxel import SpikeTrains


def patterns(seed, trains=40, count=3, targets=1, duration=200.0, spikes=1):
    """Patterns of `spikes` spikes a train at most, with targets at least 15 ms apart."""
    random = np.random.default_rng(seed)
    shown, wanted = [], []
    for _ in range(count):
        lists = [np.sort(random.uniform(0, duration, random.integers(1, spikes + 1))) for _ in range(trains)]
        shown.append(SpikeTrains.from_lists(lists, stop=duration))
        at = np.sort(random.uniform(40, duration - 5, targets))
        while np.any(np.diff(at) < 15):
            at = np.sort(random.uniform(40, duration - 5, targets))
        wanted.append(at)
    return shown, wanted


@cache
def peak(slow, fast):
    """The factor that makes the difference of two exponentials peak at 1, found by looking closer and closer."""
    low, high = 0.0, 20.0 * slow
    for _ in range(30):
        t = np.linspace(low, high, 1001)
        at = np.argmax(np.exp(-t / slow) - np.exp(-t / fast))
        low, high = t[max(at - 1, 0)], t[min(at + 1, 1000)]
    return 1 / (np.exp(-t / slow) - np.exp(-t / fast)).max()


def kernel(s, tau, tau_s):
    s = np.asarray(s, float)
    return np.where(s > 0, peak(tau, tau_s) * (np.exp(-s / tau) - np.exp(-s / tau_s)), 0.0)


def summed(pattern, t, factor, after=-np.inf):
    """Sum over the inputs of each train of `factor(t - t_ij)`."""
    return np.array([np.sum(factor(t - train[train > after])) for train in pattern])


def right_sides(pattern, targets, fired, factor):
    """Sum over targets less sum over output spikes."""
    zero = np.zeros(len(pattern))
    return sum((summed(pattern, t, factor) for t in targets), zero) - sum(
        (summed(pattern, t, factor) for t in fired), zero
    )


def change_and_formula(learner, factor, targets=3, seed=1, weights=(-1, 4)):
    """The change of drawn weights, the formula of it, and the weights and output spikes."""
    (pattern,), (wanted,) = patterns(seed, trains=60, count=1, targets=targets, spikes=3)
    start = np.random.default_rng(seed).uniform(*weights, 60)
    change, fired = learner.change(start, pattern, wanted)
    assert len(fired) > 0
    return change, right_sides(pattern, wanted, fired, factor), start, fired


def is_right(targets, fired, within=1.0):
    return len(targets) == len(fired) and bool(np.all(np.abs(np.asarray(targets) - fired) <= within))
