"""Sampling and the whole question, on touches whose information is known."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel.information import LabelledTrial, answer
from taxel.information.rasters import event_grams, features
from taxel.information.sampling import HeldValues, SampledEvents
from taxel.information.wire_rate import kilobits_per_second


@settings(deadline=None, max_examples=25)
@given(st.lists(st.tuples(st.integers(0, 500), st.integers(0, 3), st.integers(0, 200)), max_size=60), st.data())
def test_held_values_are_those_of_the_frames_that_events_make(rows, data):
    rows.sort()
    t, x, level = (np.array(column, int) for column in (zip(*rows, strict=True) if rows else ([], [], [])))
    events = taxel.Events(t, x, np.zeros(len(t), int), np.ones(len(t), bool), array=taxel.Array(1, 4), intensity=level)
    times = np.sort(np.array(data.draw(st.lists(st.integers(-10, 600), min_size=1, max_size=20)), np.int64))
    found = HeldValues(events).at(times)
    for k, at in enumerate(times):
        expected = np.zeros(4)
        for when, column, value in rows:
            if when <= at:
                expected[column] = value
        assert np.array_equal(found[k], expected)


def test_many_events_are_held_across_kept_states():
    random = np.random.default_rng(1)
    t = np.sort(random.integers(0, 10_000, 9000))
    events = taxel.Events(
        t,
        random.integers(0, 8, 9000),
        np.zeros(9000, int),
        np.ones(9000, bool),
        array=taxel.Array(1, 8),
        intensity=random.integers(0, 999, 9000),
    )
    times = np.array([0, 4_000, 4_001, 9_999, 20_000])
    frames = [taxel.Frames.from_events(events, 1, int(at), int(at) + 1).values[0].ravel() for at in times]
    assert np.array_equal(HeldValues(events).at(times), frames)
    assert np.array_equal(HeldValues(events).at(times[3:]), frames[3:])


def grams_by_hand(spikes, window, tau):
    bins = spikes.bins_to(window)
    raster = np.zeros((spikes.trials, max(1, bins.max(initial=0)), spikes.taxels))
    for k, x, b, v in zip(spikes.trial, spikes.taxel, spikes.bin, spikes.value, strict=True):
        if b < bins[k]:
            raster[k, b, x] += v
    decay = np.exp(-spikes.period_us / 1000 / tau) if tau else 0.0
    for b in range(1, raster.shape[1]):
        raster[:, b] += decay * raster[:, b - 1]
    for k in range(spikes.trials):
        raster[k, bins[k] :] = 0
    flat = raster.reshape(spikes.trials, -1)
    return flat @ flat.T


@pytest.mark.parametrize("tau", [0.0, 4.0, 100.0])
def test_inner_products_by_bins_are_those_of_whole_rasters(tau):
    random = np.random.default_rng(3)
    n, taxels = 12, 5
    first = random.uniform(0, 9_000, n)
    first[4] = np.inf
    length = random.uniform(30_000, 90_000, n)
    trial, taxel, bins = (random.integers(0, high, 150) for high in (n, taxels, 20))
    kept = trial != 4
    order = np.argsort(bins[kept], kind="stable")
    value = random.choice([-1.0, 1.0, 3.0], 150).astype(np.float32)
    spikes = SampledEvents(5000, taxels, *(c[kept][order] for c in (trial, taxel, bins, value)), first, length)
    windows = [4_000.0, 20_000.0, 50_000.0, 200_000.0]
    for window, gram in zip(windows, event_grams(spikes, windows, tau), strict=True):
        assert np.allclose(gram, grams_by_hand(spikes, window, tau), atol=1e-4)
    for window, size in zip(windows, features(spikes, windows), strict=True):
        bins = spikes.bins_to(window)
        rows = zip(spikes.trial, spikes.taxel, spikes.bin, strict=True)
        assert size == max(1, len({(x, b) for k, x, b in rows if b < bins[k]}))


def test_what_a_setting_costs_on_the_wire():
    spikes = SampledEvents(
        1000,
        400,
        np.zeros(301, int),
        np.arange(301),
        np.r_[np.zeros(300, int), 4],
        np.ones(301, np.float32),
        np.array([0.0, np.inf]),
        np.array([np.inf, np.inf]),
    )
    first, end = np.array([0.0]), np.array([np.inf])
    # 301 events; a datagram for the 300 at once, one for the last; two trials of 10 ms.
    assert kilobits_per_second(spikes, 10_000.0, values=False) == pytest.approx((301 * 16 + 2 * 192) / 20.0)
    assert kilobits_per_second(spikes, 10_000.0, values=True) == pytest.approx((301 * 32 + 2 * 192) / 20.0)
    many = SampledEvents(
        1000, 900, np.zeros(900, int), np.arange(900), np.zeros(900, int), np.ones(900, np.float32), first, end
    )
    assert kilobits_per_second(many, 10_000.0, values=False) == pytest.approx((900 * 16 + 2 * 192) / 10.0)


def pulsed(touches):
    """Make trials of (label, group, ((ms, taxel), ...)): each taxel is touched there, for 3 ms."""
    changes, rows = [], []
    for k, (label, group, pulses) in enumerate(touches):
        begin = 100_000 + 200_000 * k
        rows.append((label, group, begin - 500))
        for ms, taxel_ in pulses:
            at = begin + round(1000 * ms)
            changes += [(at, taxel_, 100), (at + 3000, taxel_, 0)]
    t, x, level = (np.array(column) for column in zip(*sorted(changes), strict=True))
    events = taxel.Events(t, x, np.zeros(len(t), int), level > 0, array=taxel.Array(1, 16), intensity=level)
    return [LabelledTrial(events, label, start, stop_us=start + 60_000, group=group) for label, group, start in rows]


def asked(trials, **what):
    few = {"periods_ms": [1, 5], "windows_ms": [20], "taxels": [3], "draws": 1, "shuffles": 19}
    return answer(trials, **(few | what))


def test_bits_that_shuffled_labels_reach_are_told_from_nothing_nowhere():
    # A taxel a session and mostly one label a session: what is left out is unlike all else, and is taken for the label
    # that more of the other sessions have. Its answers are wrong nine times in ten, which a confusion matrix counts as
    # much as right ones.
    random = np.random.default_rng(2)
    touches = []
    for session in range(6):
        for _ in range(20):
            label = "pq"[session % 2 ^ (random.random() < 0.1)]
            touches.append((label, f"session {session}", ((0, session), (random.uniform(1, 5), 15))))
    found = asked(pulsed(touches))
    assert found.full.found.bits > 0.2
    assert found.full.found.right < 0.25
    assert found.empty
    assert [point.verdict.says for point in found.by_period[1:]] == ["nothing"]
    assert any(text.startswith("the bits cannot be distinguished from 0") for text in found.warnings)
    assert any("guessing gives 50 %" in text for text in found.warnings)


def test_a_length_that_tells_as_much_is_warned_of():
    random = np.random.default_rng(3)
    touches = [
        (["short", "long"][k % 2], "", ((random.uniform(0, 4), k % 2), (random.uniform(8, 10), 7))) for k in range(80)
    ]
    trials = [
        dataclasses.replace(trial, stop_us=trial.start_us + 30_000 + 20_000 * (trial.label == "long"))
        for trial in pulsed(touches)
    ]
    assert [text for text in asked(trials, taxels=[]).warnings if text.startswith("the length alone gives")]
