"""Change events against equation 5.7, written once more in plain Python."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.encode import ChangeEvents

from . import oracles
from .scenes import frames_of, spikes_of, wander

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "silent"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "change": ChangeEvents(bits=4),
    "change, last sample": ChangeEvents(previous="last_sample", rounding="floor", period_ms=0.3),
}


@settings(max_examples=40, deadline=None)
@given(
    seed=seeds,
    floor=st.sampled_from([0.5, 3.0, 4.0, 7.3]),
    bits=st.integers(1, 10),
    previous=st.sampled_from(["last_sent", "last_sample"]),
    rounding=st.sampled_from(["truncate", "floor"]),
    ticks=st.booleans(),
)
def test_change_events_are_equation_5_7(seed, floor, bits, previous, rounding, ticks):
    rng = np.random.default_rng(seed)
    t, values = np.arange(300) * 192, wander(rng, ticks=ticks)
    given_parameters = {"noise_floor": floor, "bits": bits, "previous": previous, "rounding": rounding}
    spikes = spikes_of(ChangeEvents(**given_parameters).encode(frames_of(t, values)))
    assert spikes == oracles.change_events(t, values, **given_parameters)
    assert spikes
