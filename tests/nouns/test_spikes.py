"""SpikeTrains: laws of slicing and of conversions, and an error for every nonsense."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

from taxel import SpikeTrains

from .trains import some

mpl.use("Agg")


@given(some())
def test_neo_takes_our_trains_in_ms(trains: SpikeTrains) -> None:
    pytest.importorskip("neo")
    for n, own in enumerate(trains.to_neo()):
        assert np.allclose(own.rescale("s").magnitude * 1000, trains[n], rtol=0, atol=1e-9)
        assert (float(own.t_start), float(own.t_stop)) == (trains.start, trains.stop)
        if trains.values is not None:
            values = trains.values[trains.offsets[n] : trains.offsets[n + 1]]
            assert np.array_equal(own.array_annotations["value"], values)


@given(some(), st.lists(st.floats(0, 50), min_size=1, max_size=4, unique=True))
def test_delayed_trains_are_the_trains_later_delay_after_delay(trains: SpikeTrains, delays: list[float]) -> None:
    delays.sort()
    later = trains.delayed(delays)
    assert len(later) == len(delays) * len(trains)
    assert (later.start, later.stop) == (trains.start, trains.stop + delays[-1])
    assert later.kind == trains.kind
    for d, delay in enumerate(delays):
        for n in range(len(trains)):
            k = d * len(trains) + n
            assert np.array_equal(later[k], trains[n] + delay)
            if trains.values is not None:
                own = trains.values[trains.offsets[n] : trains.offsets[n + 1]]
                assert np.array_equal(later.values[later.offsets[k] : later.offsets[k + 1]], own)
    assert trains.delayed([0.0]) == trains


@given(some())
def test_splitting_by_sign_keeps_every_spike_once(trains: SpikeTrains) -> None:
    if trains.kind == "graded":
        with refused(argument="trains"):
            trains.split_by_sign()
        return
    split = trains.split_by_sign()
    if trains.values is None:
        assert split == trains
        return
    assert len(split) == 2 * len(trains)
    assert not split.signed
    for n in range(len(trains)):
        values = trains.values[trains.offsets[n] : trains.offsets[n + 1]]
        assert np.array_equal(split[n], trains[n][values > 0])
        assert np.array_equal(split[n + len(trains)], trains[n][values <= 0])
