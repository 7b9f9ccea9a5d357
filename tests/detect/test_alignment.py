"""Labels come back to what the sensor felt, on the training part alone, and only where a recipe asks for it."""

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from discs import recipe, tare, touches
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import taxel
from taxel.detect import Example, Fold, Part, fit, judge, run, score
from taxel.detect.alignment import align
from taxel.detect.fit import Fitter

#: Each touch has a stretch of its own, ms: it is felt in the middle, unrelated inputs fire at both ends.
STRETCH = 400.0
Labels = list[NDArray[np.int64]]


@st.composite
def felt(draw: Callable[..., list[list[float]]]) -> tuple[list[taxel.SpikeTrains], Labels, Labels, int, float]:
    """Draw patterns with one train that follows each touch, when it was felt, and labels up to 40 ms off."""
    latency_ms = draw(st.sampled_from([0.0, 2.5]))
    unrelated, place = draw(st.integers(0, 4)), draw(st.integers(0, 4))
    patterns, onsets, labels = [], [], []
    for _ in range(draw(st.integers(1, 3))):
        start = begin = draw(st.sampled_from([0.0, -5e3, 1e9]))
        times: list[list[float]] = [[] for _ in range(unrelated + 1)]
        true, given_ = [], []
        for _ in range(draw(st.integers(1, 8))):
            begin += draw(st.sampled_from([0.0, 100.0, 3.6e6]))
            true.append(begin + draw(st.integers(1900, 2100)) / 10.0)
            given_.append(true[-1] + draw(st.integers(-40_000, 40_000)) / 1000.0)
            times[place % (unrelated + 1)].append(true[-1] + latency_ms)
            for other in set(range(unrelated + 1)) - {place % (unrelated + 1)}:
                ends = st.floats(0.0, 60.0) | st.floats(340.0, 400.0)
                times[other] += sorted(begin + t for t in draw(st.lists(ends, max_size=6, unique=True)))
            begin += STRETCH
        patterns.append(taxel.SpikeTrains.from_lists(times, start=start, stop=begin))
        onsets.append(np.rint(np.array(true) * 1000).astype(np.int64))
        labels.append(np.rint(np.array(given_) * 1000).astype(np.int64))
    return patterns, onsets, labels, place % (unrelated + 1), latency_ms


@given(felt())
def test_labels_that_are_off_come_back_to_what_was_felt(drawn) -> None:
    patterns, onsets, labels, place, latency_ms = drawn
    found = align(patterns, "contact", labels, None, latency_ms)
    assert found.train == place
    assert not found.unpaired.any()
    for k, true in enumerate(onsets):
        assert np.abs(found.felt(k) - true).max() <= 1, "to the microsecond of a clock at 1e9 ms"
    moved = (np.concatenate(onsets) - np.concatenate(labels)) / 1000.0
    assert found.moved_ms == pytest.approx(moved, abs=0.0011)
    assert found.median_ms == pytest.approx(np.median(moved), abs=0.0011)
    assert abs(found.largest_ms) == pytest.approx(np.abs(moved).max(), abs=0.0011)


def test_of_trains_that_are_alike_the_nearest_is_taken_and_of_these_the_first() -> None:
    onsets = np.arange(10) * 1000.0 + 500.0
    labels = [np.rint(1000 * onsets).astype(np.int64)]
    trains = [onsets + 9.0, onsets[:8], onsets + 1.5, onsets, np.arange(0.0, 10_000.0, 10.0), []]
    patterns = [taxel.SpikeTrains.from_lists(trains, stop=10_000.0)]
    assert align(patterns, "a", labels, None, 0.0).train == 2
    without = [taxel.SpikeTrains.from_lists([*trains[:2], *trains[4:]], stop=10_000.0)]
    assert align(without, "a", labels, None, 0.0).train == 0, "which finds most"
    assert align([taxel.SpikeTrains.from_lists(trains[4:], stop=10_000.0)], "a", labels, None, 0.0).train is None


@pytest.mark.parametrize("spikes", [[[], []], [[3000.0], []], [[], np.arange(0.0, 4000.0, 3.0)]])
def test_where_no_input_follows_the_labels_they_stay_as_given(spikes: list[list[float]]) -> None:
    labels = [np.array([1_000_000, 1_400_000])]
    found = align([taxel.SpikeTrains.from_lists(spikes, stop=4000.0)], "a", labels, None, 0.0)
    assert (found.train, found.moved_ms.tolist()) == (None, [0.0, 0.0])
    assert found.felt(0).tolist() == labels[0].tolist()
    assert repr(found) == "Alignment(a: 2 labels as given)"


def examples(*seeds: int, jitter_ms: float = 0.0) -> list[Example]:
    random = np.random.default_rng(seeds)
    made = []
    for seed in seeds:
        events, truth = touches(seed)
        off = {
            label: np.asarray(t) + np.rint(random.uniform(-jitter_ms, jitter_ms, len(t)) * 1000).astype(np.int64)
            for label, t in truth.items()
        }
        made.append(Example(events, off, tare()))
    return made


def weights(readout: taxel.Readout) -> dict[str, list[float]]:
    return {label: neuron.weights.tolist() for label, neuron in readout.neurons.items()}


@pytest.mark.filterwarnings("ignore:.* (cannot be learnt|come too late)")
def test_labels_that_are_off_teach_what_exact_ones_do() -> None:
    plan = dataclasses.replace(recipe(), align=True)
    exact, off = examples(1, 2, 3), examples(1, 2, 3, jitter_ms=20.0)
    assert weights(fit(off, plan)) == weights(fit(exact, plan))
    assert weights(fit(off, recipe())) != weights(fit(exact, recipe()))
    events, truth = touches(9)
    readout = fit(off, plan)
    own = score(run(readout, events, tare=tare()), truth, 10.0)
    assert (own.missed, own.false) == (0, 0)
    # `t` is when the sensor felt it: what the aligned labels are, not what was given.
    spread = [one for label in readout.labels for one in own[label].errors_ms - np.median(own[label].errors_ms)]
    assert np.abs(spread).max() < 1.0


def test_the_part_that_is_tested_moves_no_label() -> None:
    data = examples(1, 2, 9, jitter_ms=20.0)
    plan = dataclasses.replace(recipe(), align=True)
    fold = Fold([Part(0), Part(1)], [Part(2)])
    one = judge(data, plan, [fold]).trained[0]
    other = judge([*data[:2], *examples(7, jitter_ms=40.0)], plan, [fold]).trained[0]
    assert one.readout == other.readout == fit(data[:2], plan)
    assert {label: a.to_dict() for label, a in one.alignments.items()} == {
        label: a.to_dict() for label, a in Fitter(data[:2], plan).fit().alignments.items()
    }
    assert set(one.alignments["contact"].example) == {0, 1}
