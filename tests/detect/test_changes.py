"""Readings of another day: each change against its formula, of events as of frames; what it chooses and what not."""

import discs
import numpy as np
import pytest

from taxel import Array, Events, Frames, Tare
from taxel.detect import Example, score
from taxel.detect.changes import CHOOSING, TOMORROW, changed
from taxel.detect.choice import chosen
from taxel.detect.fit import Fitter
from taxel.detections import Detections

REST, FLOOR, LOADED_US = np.array([[40.0, 50.0]]), 3.0, 25_000
#: Above rest: the second taxel is loaded more.
ABOVE = np.array([[0, 2], [-2, 1], [9, 20], [8, 3], [0, 40], [0, 0]], np.float32)
T = np.arange(0, 60_000, 10_000)
TARE = Tare.take(Frames(np.broadcast_to(REST, (2, 1, 2)), [0, 10_000], unit="ticks", array=Array(1, 2)), stop_us=20_000)
RIGHT = {
    "gain x 0.8": [[0, 2], [-2, 1], [7.2, 16], [6.4, 3], [0, 32], [0, 0]],
    "gain x 1.25": [[0, 2], [-2, 1], [11.25, 25], [10, 3], [0, 50], [0, 0]],
    "loaded at the start": [[9, 20], [9, 20], [9, 20], *ABOVE[3:].tolist()],
    "a drift of a noise floor a minute": ABOVE + FLOOR * T[:, None] / 60e6,
    "a dead taxel": ABOVE * [1, 0],
    "a stuck taxel": np.column_stack([ABOVE[:, 0], np.full(6, 40.0)]),
}


@pytest.mark.parametrize("name", RIGHT)
def test_frames_read_what_the_formula_of_a_change_says(name):
    frames = Frames((REST + ABOVE[:, None]), T, unit="N", array=Array(1, 2))
    other = changed(Example(frames, {}, TARE), name, FLOOR, LOADED_US).source
    np.testing.assert_allclose(other.values[:, 0] - REST, RIGHT[name], rtol=0, atol=1e-4)
    assert other.unit == "N"


@pytest.mark.parametrize("name", RIGHT)
def test_events_read_the_same_in_whole_ticks(name):
    order = np.random.default_rng(3).permutation(2)
    x, t = np.tile(order, 6), np.repeat(T, 2)
    ticks = (REST + ABOVE)[:, order].ravel()
    present = np.arange(12) != 7
    events = Events(t, x, 0 * x, x == 0, array=Array(1, 2), intensity=ticks, present=present)
    other = changed(Example(events, {}, TARE), name, FLOOR, LOADED_US).source
    right = np.rint((REST + RIGHT[name])[:, order].ravel())
    np.testing.assert_array_equal(other.intensity[present], right[present])
    assert other.intensity[7] == 0
    assert not other.present[7]


def test_noise_is_so_many_times_that_of_the_tare():
    still = np.random.default_rng(5).normal(0.0, 2.0, (20_000, 1, 3))
    frames = Frames(still, 1_000 * np.arange(20_000), array=Array(1, 3))
    tare = Tare.take(frames)
    noisy = changed(Example(frames, {}, tare), "noise x 1.5", 12.0, -np.inf).source
    np.testing.assert_allclose(noisy.values.std(axis=0), 1.5 * still.std(axis=0), rtol=0.02)


def test_a_taxel_without_a_rest_reads_what_it_reads():
    frames = Frames(np.full((4, 1, 2), 7.0), T[:4], array=Array(1, 2))
    tare = TARE._with(Array(1, 2), rest=np.array([[1.0, np.nan]]), noise=np.array([[1.0, np.nan]]))
    for name in CHOOSING | TOMORROW:
        assert (changed(Example(frames, {}, tare), name, 1.0, 15_000).source.values[:, 0, 1] == 7.0).all()


@pytest.mark.parametrize(("name", "better"), [("gain x 0.8", "neuron"), ("a dead taxel", "rule")])
def test_mistakes_with_a_change_choose_but_those_of_tomorrow(name, better):
    events = 1_000_000 * np.arange(1, 101)

    def scores(*missed):
        return [score(Detections(["on"] * (100 - n), events[n:], events[n:]), {"on": events}) for n in missed]

    ways = {name: (scores(1, 0, 1, 0), scores(9, 8, 9, 9))}
    choice = chosen(["on"], 10.0, (scores(1, 1, 1, 1), scores(0, 0, 0, 0)), ways)["on"]
    assert ("rule" if choice.by_rule else "neuron") == better
    assert choice.to_dict()["changed"] == {name: {"neuron": 2, "rule": 35}}


@pytest.mark.filterwarnings("ignore:.*cannot be learnt")
def test_a_change_is_detected_in_as_a_recording_that_reads_so():
    events, labels = discs.touches(5, 10)
    fitter = Fitter([Example(events, labels, discs.tare())], discs.recipe())
    trained, (part,) = fitter.fit(), fitter.whole
    for name, other in fitter._changed.items():
        example = changed(fitter.examples[0], name, fitter.noise_floor, fitter._loads.loaded_us[0])
        found, right = other.detected(trained, part), Fitter([example], discs.recipe()).detected(trained, part)
        assert found[:2] == right[:2]
        assert len(found.by_neurons)
    assert {*fitter._changed} == {*RIGHT}
