"""The ages of a touch in whole frames: kinds of touch are told at any rate."""

from __future__ import annotations

import numpy as np
import pytest
from draws import seeds
from hypothesis import given, settings
from hypothesis import strategies as st
from touching import of_two_sizes

from taxel import Array, Events, Frames, SpikeTrains, Tare
from taxel.detect import Example, Recipe, run, score
from taxel.detect.ages import Ages, in_frames, later_us
from taxel.detect.fit import Fitter

KINDS = ("small", "large")


@pytest.mark.parametrize(
    ("rate", "jitter", "rise_s", "start_us"),
    [
        (25, 0, 0.02, 0),
        *(pytest.param(rate, 0, 0.02, 0, marks=pytest.mark.slow) for rate in (60, 100, 1000)),
        (100, 0, 0.02, 1_795_000_000_000_000),
        pytest.param(100, 0.2, 0.02, 0, marks=pytest.mark.slow),
        (250, 0.1, 0.02, 0),
        (100, 0, 0.3, 0),
    ],
)
def test_kinds_are_told_at_any_rate(rate: float, jitter: float, rise_s: float, start_us: int) -> None:
    learnt, unseen = (of_two_sizes(seed, rate, jitter, rise_s, start_us) for seed in (1, 2))
    rest_us = start_us + 1_200_000
    examples = [Example(frames, labels, Tare.take(frames, stop_us=rest_us)) for frames, labels in (learnt, unseen)]
    readout = Fitter(examples[:1], Recipe.load("touch", labels=KINDS, noise_floor=0.012)).fit().readout
    result = score(run(readout, unseen[0], tare=examples[1].tare), unseen[1])
    assert result.missed + result.false <= 1, result


def test_the_board_keeps_the_recipe_and_slower_events_take_whole_frames() -> None:
    recipe = Recipe.load("touch", labels=("contact", *KINDS))
    events = Events([0, 100], [0, 1], [0, 0], [True, True], array=Array(2, 2))
    assert in_frames(recipe, [Example(events, {})], [(192.0, 1)]) is recipe
    assert in_frames(recipe, [Example(events, {})], [(None, 1)]) is recipe
    slow = in_frames(recipe, [Example(events, {})], [(10_000.0, 1)])
    assert slow.neurons["small"]["delay_ms"] == 10.0
    assert slow.neurons["small"]["kernel"] == "alpha"
    assert slow.points_of("contact") == recipe.points_of("contact")


@pytest.mark.parametrize("seed", seeds(2, quick=1))
def test_kinds_are_told_where_a_tenth_of_the_frames_is_lost(seed: int) -> None:
    examples = []
    for drawn in (seed + 1, seed + 11):
        frames, labels = of_two_sizes(drawn, 100)
        kept = np.random.default_rng(drawn).uniform(size=len(frames)) > 0.1
        some = Frames(frames.values[kept], frames.t[kept], unit="mV", array=frames.array)
        examples.append(Example(some, labels, Tare.take(some, stop_us=1_200_000)))
    readout = Fitter(examples[:1], Recipe.load("touch", labels=KINDS, noise_floor=0.012)).fit().readout
    result = score(run(readout, examples[1].source, tare=examples[1].tare), examples[1].labels)
    assert result.missed <= 2, result
    assert result.false == 0, result


@settings(max_examples=settings.default.max_examples // 6)
@given(st.floats(0.3, 200.0))
def test_each_delay_has_one_frame(frame_ms: float) -> None:
    recipe = Recipe.load("touch", labels=KINDS)
    t = np.rint(1e3 * frame_ms * np.arange(5)).astype(np.int64)
    examples, clocks = [Example(Frames(np.zeros((5, 2, 2)), t), {})], [(None, 1)]
    made = in_frames(recipe, examples, clocks)
    assert in_frames(made, examples, clocks) == made
    period_ms = float(np.median(np.diff(t))) / 1e3
    neuron = made.neurons["small"]
    delays = [one["delay_ms"] for one in (neuron, *neuron["choose"])]
    assert delays == sorted(set(delays))
    for part, those in (("moments", delays[:1]), ("later", delays[1:])):
        ages = made.encoder.parts[part].ages_ms
        for delay_ms in those:
            begin = ages.index(delay_ms)
            reached = [k for k in range(2000) if ages[begin] <= k * period_ms < ages[begin + 1]]
            assert len(reached) == 1


def test_the_sample_that_has_an_age_is_found_in_each_touch() -> None:
    ages = Ages(range(2), (0.0, 5.0))
    onsets, later = np.array([100.0, 200.0, 300.0]), np.array([0.0, 3.2, 0.0])
    # The third touch ends before it has the age.
    trains = SpikeTrains.from_lists([onsets, (onsets + 5.0 + later)[:2]], stop=400.0)
    assert later_us(trains, ages, onsets, 5.0).tolist() == [0, 3200, 0]
