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
def test_neo_takes_our_trains_and_gives_them_back(trains: SpikeTrains) -> None:
    pytest.importorskip("neo")
    back = SpikeTrains.from_neo(trains.to_neo())
    assert len(back) == len(trains)
    assert np.allclose(back.times, trains.times, rtol=0, atol=1e-9)
    assert np.array_equal(back.offsets, trains.offsets)
    if len(trains):
        assert (back.start, back.stop) == (trains.start, trains.stop)
        assert back.kind == trains.kind
    if trains.values is not None and len(trains):
        assert np.array_equal(back.values, trains.values)


def test_neo_trains_of_other_units_and_windows_are_read_in_ms() -> None:
    neo = pytest.importorskip("neo")
    a = neo.SpikeTrain([0.001, 0.5], units="s", t_start=0.0, t_stop=1.0)
    b = neo.SpikeTrain([20.0], units="ms", t_start=-5.0, t_stop=100.0)
    trains = SpikeTrains.from_neo([a, b])
    assert (trains.start, trains.stop) == (-5.0, 1000.0)
    assert np.allclose(trains[0], [1.0, 500.0])
    assert trains[1].tolist() == [20.0]


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
