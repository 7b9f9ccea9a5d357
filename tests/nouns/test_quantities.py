"""Times that say what they are in are converted or refused, wherever times are taken."""

from __future__ import annotations

from typing import Any, ClassVar
from unittest.mock import ANY

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import Array, Detections, Events, Frames, SpikeTrains, Tare
from taxel._base.arguments import bare, column, floats, integer, number

pq = pytest.importorskip("quantities")
neo = pytest.importorskip("neo")

S, MS, US, V = pq.s, pq.ms, pq.us, pq.V


class Plain:
    """A quantity as pint and astropy have it: `to` instead of `rescale`, and no array."""

    FACTORS: ClassVar[dict[str, Any]] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "dimensionless": None}

    def __init__(self, value: Any, unit: str) -> None:
        self.magnitude, self._unit = value, unit

    @property
    def units(self) -> str:
        return self._unit

    def to(self, unit: str) -> Plain:
        return Plain(np.asarray(self.magnitude) * self.FACTORS[self._unit] / self.FACTORS[unit], unit)


class Mute:
    """A quantity that cannot be converted, and cannot say what it is."""

    unit = "s"

    def __array__(self, *_: Any, **__: Any) -> Any:
        return np.array([1.0])


times = st.lists(st.floats(-1e6, 1e6), max_size=20).map(lambda t: np.sort(np.array(t)))


@given(times, st.sampled_from(["s", "ms", "us", "ns", "h"]))
def test_a_neo_train_is_heard_in_its_own_unit(t: np.ndarray, unit: str) -> None:
    span = {"t_start": -1e6, "t_stop": 1e6}
    train = neo.SpikeTrain(t, units=unit, **span)
    wanted = train.rescale("ms").magnitude
    start, stop = (float(pq.Quantity(v, unit).rescale("ms")) for v in span.values())
    trains = SpikeTrains.from_lists([train, []], start, stop)
    np.testing.assert_allclose(trains[0], wanted, 1e-15)
    assert trains == SpikeTrains.from_lists([train, []], pq.Quantity(-1e6, unit), pq.Quantity(1e6, unit))
    other = np.sort(wanted + 1.0)
    for metric, given_ in (("victor_purpura", {"q": 0.1}), ("van_rossum", {"tau": 10.0})):
        distance = getattr(taxel.metrics, metric)
        assert distance(train, pq.Quantity(other, "ms"), **given_) == pytest.approx(
            distance(wanted, other, **given_), 1e-9
        )
        both = taxel.metrics.pairwise(metric, [train, pq.Quantity(other, "ms")], **given_)
        np.testing.assert_allclose(both, taxel.metrics.pairwise(metric, [wanted, other], **given_), 1e-9, 1e-9)


ARRAY = Array(1, 2)
EVENTS = Events([0, 5000], [0, 1], [0, 0], [1, 0], array=ARRAY, intensity=[3, 4], markers=[(2000, True)])
FRAMES = Frames(np.arange(6.0).reshape(3, 1, 2), [0, 1000, 2000], unit="N")
TRAINS = SpikeTrains.from_lists([[1.0, 4.0], [2.0]], stop=10.0)
FOUND = Detections(["a"], [1000], [2000])
NEURON = taxel.Neuron(tau=5.0)


def taught(targets: Any) -> list[float]:
    cone = taxel.learn.ConeR(neuron=taxel.Neuron(tau=9.0, refractory=0.5), lb=-9.0, ub=9.0)
    return cone.fit([TRAINS], [targets]).weights_.round(6).tolist()


#: Each function that takes times: a call, and its times, in us.
PLACES: dict[str, tuple[Any, Any]] = {
    "trains": (lambda t: SpikeTrains(t, [0, 2], 0.0, 9.0), [1000, 3000]),
    "start": (lambda t: SpikeTrains([5.0], [0, 1], t, 9.0), 2000),
    "stop": (lambda t: SpikeTrains.from_lists([[5.0]], stop=t), 7000),
    "from_lists": (lambda t: SpikeTrains.from_lists([t, t]), [1000, 3000]),
    "delayed": (TRAINS.delayed, [0, 2000]),
    "trains between": (lambda t: TRAINS.between(0.0, t), 3000),
    "distance": (lambda t: taxel.metrics.van_rossum([1.0], t, tau=9.0), [1000, 3000]),
    "tau": (lambda t: taxel.metrics.van_rossum([1.0], [2.0], tau=t), 9000),
    "targets": (taught, [2500, 4500]),
    "run": (lambda t: NEURON.run([0.5, 0.5], SpikeTrains.from_lists([t, []], stop=20.0)).tolist(), [1000, 3000]),
    "potential": (lambda t: NEURON.potential([0.5, 0.5], TRAINS, t).tolist(), [1000, 3000]),
    "score window": (lambda t: taxel.detect.score(FOUND, {"a": [1500]}, window_ms=t).to_dict(), 3000),
}
#: The same for functions with times in us.
PLACES_US: dict[str, tuple[Any, Any]] = {
    "events": (lambda t: Events(t, [0, 1], [0, 0], [1, 0], array=ARRAY), [0, 5000]),
    "markers": (lambda t: Events([], [], [], [], array=ARRAY, markers=[(t, True)]), 2000),
    "events between": (lambda t: EVENTS.between(t, 9000), 1000),
    "held": (lambda t: Frames.from_events(EVENTS, t), 1000),
    "held from": (lambda t: Frames.from_events(EVENTS, 1000, t), 1000),
    "frames": (lambda t: Frames(FRAMES.values, t), [0, 1000, 2000]),
    "frames between": (lambda t: FRAMES.between(t, 9000), 1000),
    "detections": (lambda t: Detections(["a"], t, [2000]), [1000]),
    "known": (lambda t: Detections(["a"], [0], t), [1000]),
    "found between": (lambda t: FOUND.between(0, t), 3000),
    "tare": (lambda t: Tare.take(FRAMES, stop_us=t), 2000),
    "truth": (lambda t: taxel.detect.score(FOUND, {"a": t}, window_ms=3).to_dict(), [1500]),
    "truth of one": (lambda t: taxel.detect.score(FOUND, t, window_ms=3).to_dict(), [1500]),
}


def nested(values: Any, make: Any) -> Any:
    """Each number of a list as a quantity of its own."""
    return [make(v) for v in values] if isinstance(values, list) else make(values)


def same(a: Any, b: Any) -> None:
    if isinstance(b, int | float | list | np.ndarray):
        np.testing.assert_allclose(a, b, 1e-12)
    else:
        assert a == b


@pytest.mark.parametrize(
    ("place", "unit"),
    [(p, 1000.0) for p in PLACES.values()] + [(p, 1.0) for p in PLACES_US.values()],
    ids=[*PLACES, *PLACES_US],
)
def test_a_quantity_is_converted_or_refused_everywhere(place: tuple[Any, Any], unit: float) -> None:
    call, us = place
    plain = (np.asarray(us) / unit).tolist() if unit > 1 else us
    wanted = call(plain)
    for quantity in (
        np.asarray(us, float) * US,
        (np.asarray(us) / 1e3 * MS).rescale("s"),
        np.asarray(us, np.int64) / 1e6 * S,
        nested(us, lambda v: v / 1e6 * S),
        nested(us, lambda v: Plain(v / 1e3, "ms")),
        Plain(us, "us"),
    ):
        same(call(quantity), wanted)
    for wrong in (
        np.asarray(us, float) * V,
        np.asarray(us, float) * pq.dimensionless,
        Mute(),
        nested(us, lambda _: Mute()),
    ):
        with refused(argument=ANY):
            call(wrong)
    if isinstance(us, list) and len(us) > 1:
        with refused(argument=ANY):
            call([us[0], us[1] / 1e6 * S, *us[2:]])


@pytest.mark.parametrize(
    "call",
    [
        lambda q: taxel.Neuron(tau=q).run([1.0], SpikeTrains.from_lists([[1.0]])),
        lambda q: taxel.encode.LevelCrossing([q]),
        lambda q: taxel.encode.ChangeEvents(noise_floor=q),
        lambda q: Frames(np.ones((1, 1, 1)) * q, [0]),
        lambda q: SpikeTrains([1.0], [0, 1], 0.0, 2.0, np.ones(1) * q),
        lambda q: SpikeTrains.from_lists([[1.0]], values=[np.ones(1) * q]),
        lambda q: NEURON.run(np.ones(2) * q, TRAINS),
        lambda q: Array(2, q),
    ],
)
def test_where_no_unit_is_meant_a_quantity_is_refused(call: Any) -> None:
    with refused(argument=ANY):
        call(3.0 * V)


def test_what_has_no_dimension_is_a_plain_number() -> None:
    assert number("a", 3 * pq.dimensionless) == 3.0
    assert np.array_equal(floats("a", [5, 7] * S / MS), [5000.0, 7000.0])


@given(st.lists(st.integers(-(2**40), 2**40), min_size=1))
def test_whole_us_stay_whole_through_seconds(us: list[int]) -> None:
    assert column("t", np.array(us) / 1e6 * S, np.int64, "us").tolist() == us
    assert integer("t", us[0] / 1e6 * S, unit="us") == us[0]
    with refused(argument="t"):
        column("t", (np.array(us) + 0.25) / 1e6 * S, np.int64, "us")


def test_what_holds_no_quantity_comes_back_as_it_is() -> None:
    for value in (None, 5, "s", [], [[1.0], (2, [3])], np.arange(3), {"a": 1}, np.array([None, "a"], object)):
        assert bare("a", value, "ms") is value


def test_a_row_of_trains_keeps_what_from_lists_promises() -> None:
    """A place is named by train, also where trains have units."""
    with refused(argument="times"):
        SpikeTrains.from_lists([[1.0] * MS, [1.0] * V])
    lists = [np.array([1.0, 2.0]) * MS, [], [0.003 * S]]
    assert list(map(list, SpikeTrains.from_lists(lists))) == [[1.0, 2.0], [], [3.0]]


def test_a_list_that_holds_itself_is_refused() -> None:
    endless: list[Any] = []
    endless.append(endless)
    with refused(argument="a"):
        bare("a", endless, "ms")
