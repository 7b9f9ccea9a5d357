"""The FA-1 afferent against equations 5.1 to 5.5, written once more in plain Python."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

from taxel.encode import FA1

from . import oracles
from .scenes import frames_of, spikes_of, wander

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "silent"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "FA-1": FA1(period_ms=0.5),
    "FA-1 of 4 bits": FA1(period_ms=1.0, bits=4),
    "FA-1 by ms": FA1(period_ms=0.2, decay="ms", theta_0=0.3),
}


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    ticks=st.booleans(),
    decay=st.sampled_from(["sample", "ms"]),
    theta=st.sampled_from([None, 0.0, 0.163, 2.0]),
    period=st.sampled_from([0.2, 1.0, 5.0]),
    alpha=st.sampled_from([0.2, 0.7, 1.0, 1.4]),
    bits=st.sampled_from([1, 2, 5, 10]),
)
def test_fa1_is_equations_5_1_to_5_5_and_5_7(seed, ticks, decay, theta, period, alpha, bits):
    rng = np.random.default_rng(seed)
    values = wander(rng, 300, 3, ticks) - 5.0  # some below 0
    t = np.arange(300) * round(period * 1000)
    encoder = FA1(alpha=alpha, decay=decay, theta_0=theta, period_ms=period, bits=bits)
    given_parameters = {"decay": decay, "theta_0": theta, "period_ms": period, "bits": bits}
    wanted = oracles.fa1(t, values.astype(np.float32), alpha, **given_parameters)
    assert spikes_of(encoder.encode(frames_of(t, values))) == wanted


def test_fa1_on_ticks_by_table_equals_fa1_on_the_same_numbers_without_it():
    """A fractional value anywhere in a block of channels sends that block past the table."""
    rng = np.random.default_rng(4)
    t, values = np.arange(500) * 1000, wander(rng, 500, 10)
    odd = np.concatenate([values, np.full((500, 1), 0.5)], axis=1)
    direct = FA1().encode(frames_of(t, odd)).select(range(10))
    assert spikes_of(FA1().encode(frames_of(t, values))) == spikes_of(direct)


def test_fa1_refuses_frames_that_do_not_come_at_its_period():
    with refused(argument="period_ms"):
        FA1().encode(frames_of([0, 1000, 6000], np.zeros((3, 1))))
    FA1(period_ms=0.192).encode(frames_of([0, 100, 300, 500, 700], np.zeros((5, 1))))
