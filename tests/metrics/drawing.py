"""Trains and patterns that several tests draw."""

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
