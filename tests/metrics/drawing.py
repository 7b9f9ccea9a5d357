"""Trains and patterns that several tests draw."""

import itertools

import numpy as np
from hypothesis import strategies as st

from taxel import SpikeTrains

#: A window of 500 ms; times on whole ms among them, so that some coincide and some lie at its edges.
STOP = 500.0
times = st.lists(st.integers(0, 500).map(float) | st.floats(0, STOP, allow_subnormal=False), max_size=12).map(sorted)


def patterns(trains, most=6):
    """Patterns of so many trains."""
    time = st.integers(0, 50).map(float) | st.floats(0, 50).map(lambda t: round(t, 6))
    train = st.lists(time, max_size=most).map(sorted)
    lists = st.lists(train, min_size=trains, max_size=trains)
    return lists.map(lambda times: SpikeTrains.from_lists(times, 0.0, STOP))


def poisson(random, count, spikes, stop=1000.0):
    """Draw trains of about so many spikes."""
    return [np.sort(random.uniform(0, stop, random.poisson(spikes))) for _ in range(count)]


def pattern(random, trains, spikes, stop=100.0):
    """Draw one pattern."""
    return SpikeTrains.from_lists(poisson(random, trains, spikes, stop), 0.0, stop)


def smoothed(train, t, tau):
    """5.8 at these times."""
    past = t[:, None] - np.asarray(train, float)[None, :]
    return np.where(past >= 0, np.exp(-np.maximum(past, 0) / tau), 0.0).sum(1)


def pieces(a, b, tau):
    """Fine points between all steps, and on until nothing is left, and their weights (Gauss and Legendre)."""
    x, w = np.polynomial.legendre.leggauss(12)
    steps = np.unique(np.concatenate([a, b]))
    last = steps[-1] if len(steps) else 0.0
    edges = np.concatenate([np.linspace(p, q, 40) for p, q in itertools.pairwise(steps)] + [[last]])
    edges = np.unique(np.concatenate([edges, last + tau * np.linspace(0, 60, 200)]))
    half = np.diff(edges) / 2
    return ((edges[:-1] + half)[:, None] + half[:, None] * x).ravel(), (half[:, None] * w).ravel()
