"""The ages of a touch in whole frames: kinds of touch are told at any rate."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from touching import of_two_sizes

from taxel import Frames, Tare
from taxel.detect import Example, Recipe, run, score
from taxel.detect.ages import in_frames
from taxel.detect.fit import Fitter

KINDS = ("small", "large")


@pytest.mark.parametrize(
    ("rate", "jitter", "rise_s", "start_us"),
    [
        (25, 0, 0.02, 1_795_000_000_000_000),
        (250, 0.1, 0.02, 0),
        *(
            pytest.param(rate, jitter, rise, 0, marks=pytest.mark.slow)
            for rate, jitter, rise in (
                (60, 0, 0.02),
                (100, 0, 0.3),
                (100, 0.2, 0.02),
                (1000, 0, 0.02),
            )
        ),
    ],
)
def test_kinds_are_told_at_any_rate(rate: float, jitter: float, rise_s: float, start_us: int) -> None:
    learnt, unseen = (of_two_sizes(seed, rate, jitter, rise_s, start_us) for seed in (1, 2))
    rest_us = start_us + 1_200_000
    examples = [Example(frames, labels, Tare.take(frames, stop_us=rest_us)) for frames, labels in (learnt, unseen)]
    readout = Fitter(examples[:1], Recipe.load("touch", labels=KINDS, noise_floor=0.012)).fit().readout
    result = score(run(readout, unseen[0], tare=examples[1].tare), unseen[1])
    assert result.missed + result.false <= 1, result


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
