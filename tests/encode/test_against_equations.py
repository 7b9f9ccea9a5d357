"""Encoders against their equations, written once more in plain Python."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel import Array, Events, Frames, Tare
from taxel.encode import FA1, ChangeEvents, ContactArea, LevelCrossing, RunningRange, ThresholdIzhikevich

from . import oracles
from .scenes import frames_of, rest, spikes_of, touch, wander

seeds = st.integers(0, 2**32 - 1)


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


def test_the_saturation_of_change_events_is_that_of_their_bits():
    for bits in range(1, 11):
        values = [[0.0], [5000.0], [0.0]]
        spikes = ChangeEvents(noise_floor=1.0, bits=bits).encode(frames_of([0, 100, 200], values))
        assert spikes.values.tolist() == [2**bits - 1, 1 - 2**bits]


def test_a_slow_change_shows_only_against_the_last_sent_value():
    t, values = np.arange(40) * 192, np.arange(40.0)[:, None]
    assert len(ChangeEvents().encode(frames_of(t, values))[0]) == 9
    assert len(ChangeEvents(previous="last_sample").encode(frames_of(t, values))[0]) == 0


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    share=st.sampled_from([None, 1.0, 0.9, 0.7]),
    hold=st.sampled_from([0, 100, 192, 1000, 5000]),
    tonic=st.sampled_from([None, 300, 5000]),
)
def test_level_crossings_are_those_of_a_scan(seed, share, hold, tonic):
    rng = np.random.default_rng(seed)
    t, values = 77 + np.cumsum(rng.choice([192, 100, 3333], 200)), wander(rng, 200)
    levels = [50.0, 60.0, 64.0]
    encoder = LevelCrossing(
        levels,
        release_share=share,
        hold_ms=hold / 1000,
        tonic_ms=None if tonic is None else tonic / 1000,
        tonic_level=None if tonic is None else 60.0,
    )
    spikes = encoder.encode(frames_of(t, values))
    end = t[-1] + hold
    assert spikes.stop == end / 1000
    wanted = oracles.level_crossing(
        t.tolist(), values, levels, int(end), lambda level: level * (share or 1.0), hold, tonic, 60.0
    )
    assert spikes_of(spikes) == wanted


def test_a_release_by_a_distance_lies_that_far_below_the_level():
    values = [[0.0], [5.0], [3.1], [3.0], [2.9], [5.0]]
    spikes = LevelCrossing([5.0], release_by=2.0).encode(frames_of(np.arange(6) * 100, values))
    assert spikes_of(spikes) == [(100, 0, 1), (400, 0, -1), (500, 0, 1)]


@pytest.mark.parametrize("first_window", ["silent", "itself"])
def test_levels_on_the_running_range_are_percentiles_of_the_past_window(first_window):
    rng = np.random.default_rng(7)
    t = 500 + np.arange(900) * 10_000  # 9 s at 100 Hz
    values = np.abs(np.sin(t[:, None] / 4e5 + np.arange(3))) * [1, 30, 0] + rng.normal(0, 0.02, (900, 3)) * [1, 1, 0]
    window = RunningRange(low=10, high=95, window_s=2.0, renew_s=1.0, first_window=first_window)
    levels = [0.1, 0.5]
    encoder = LevelCrossing(levels, release_share=0.7, running_range=window)
    values = values.astype(np.float32)
    ranges = oracles.running_range(t, values, 10, 95, 2_000_000, 1_000_000)
    ranges[:200] = ranges[200] if first_window == "itself" else np.nan
    low, high = ranges[:, 0], ranges[:, 1]
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = np.where(high > low, (values - low) / (high - low), -1.0)
    first = 0 if first_window == "itself" else 200
    wanted = oracles.level_crossing(t[first:].tolist(), shares[first:], levels, int(t[-1]), lambda level: level * 0.7)
    spikes = spikes_of(encoder.encode(frames_of(t, values)))
    assert spikes == wanted
    assert len(spikes) > 30
    assert {train for _, train, _ in spikes} == {0, 1, 2, 3}, "a channel without range is silent"


def test_renewals_go_on_over_a_gap_longer_than_the_window():
    t = np.concatenate([np.arange(300), 2000 + np.arange(300)]) * 10_000
    values = np.concatenate([np.linspace(0, 1, 300), np.linspace(10, 0, 300)])[:, None]
    encoder = LevelCrossing([0.5], running_range=RunningRange(window_s=1.0, renew_s=1.0))
    ranges = oracles.running_range(t, values.astype(np.float32), 10, 95, 1_000_000, 1_000_000)
    shares = (values - ranges[:, 0]) / (ranges[:, 1] - ranges[:, 0])
    wanted = oracles.level_crossing(t[100:].tolist(), shares[100:], [0.5], int(t[-1]))
    assert spikes_of(encoder.encode(frames_of(t, values))) == wanted


@settings(max_examples=15, deadline=None)
@given(
    seed=seeds,
    published=st.sampled_from(["3.4.3", "6.5.1"]),
    begin=st.sampled_from(["settled", "rest"]),
    levels=st.sampled_from([[60.0], [40.0, 55.0, 60.0, 70.0]]),
    spacing=st.sampled_from([100, 192, 2000, 3333]),
)
def test_izhikevich_pairs_are_plain_forward_euler(seed, published, begin, levels, spacing):
    rng = np.random.default_rng(seed)
    samples = 400_000 // spacing
    slow = np.repeat(wander(rng, 9, 3), samples // 9 + 1, axis=0)[:samples]
    t = 31 + np.arange(samples) * spacing
    encoder = ThresholdIzhikevich(levels, published=published, begin=begin)
    spikes = encoder.encode(frames_of(t, slow))
    wanted = oracles.threshold_izhikevich(t, slow, levels, int(spikes.stop * 1000), published, begin)
    assert spikes_of(spikes) == wanted


@pytest.mark.parametrize(("published", "latency"), [("3.4.3", 20.2), ("6.5.1", 15.8)])
def test_the_published_latencies_are_met(published, latency):
    encoder = ThresholdIzhikevich([0.4], published=published)
    t = np.arange(0, 900_000, 100)
    on = (t >= 50_000) & (t < 450_000)
    spikes = encoder.encode(frames_of(t, on[:, None]))
    assert encoder.latency_ms == latency
    assert spikes.times[0] == pytest.approx(50 + latency)
    # The OFF neuron was driven until 50 ms: given time, it answers as a settled one.
    assert spikes.times[1] == pytest.approx(450 + latency, abs=2.0)
    assert spikes.values.tolist() == [1, -1]


def test_an_idle_off_neuron_fires_once_only_if_it_begins_at_rest():
    frames = frames_of(np.arange(0, 200_000, 2000), np.zeros((100, 1)))
    assert len(ThresholdIzhikevich([0.4]).encode(frames).times) == 0
    for published, latency in (("3.4.3", 20.2), ("6.5.1", 15.8)):
        spikes = ThresholdIzhikevich([0.4], published=published, begin="rest").encode(frames)
        assert (spikes.times.tolist(), spikes.values.tolist()) == ([latency], [-1.0])


@pytest.mark.parametrize(("published", "too_short", "enough"), [("3.4.3", 10.0, 21.0), ("6.5.1", 5.0, 16.0)])
def test_an_input_that_goes_too_soon_makes_no_spike(published, too_short, enough):
    encoder = ThresholdIzhikevich([0.4], published=published)
    t = np.arange(0, 400_000, 100)
    for length, spikes in ((too_short, 0), (enough, 1)):
        on = (t >= 50_000) & (t < 50_000 + 1000 * length)
        assert len(encoder.encode(frames_of(t, on[:, None])).split_by_sign()[0]) == spikes


@pytest.mark.parametrize(("published", "latency"), [("3.4.3", 34.0), ("6.5.1", 51.0)])
def test_a_spike_after_a_short_gap_comes_late(published, latency):
    t = np.arange(0, 700_000, 100)
    on = (t >= 50_000) & ~((t >= 450_000) & (t < 470_000))
    spikes = ThresholdIzhikevich([0.4], published=published).encode(frames_of(t, on[:, None])).split_by_sign()
    assert spikes[0][1] - 470 == pytest.approx(latency, abs=3.0)


@settings(max_examples=60, deadline=None)
@given(
    seed=seeds,
    ticks=st.booleans(),
    decay=st.sampled_from(["sample", "ms"]),
    theta=st.sampled_from([None, 0.0, 0.163, 2.0]),
    period=st.sampled_from([0.2, 1.0, 5.0]),
    alpha=st.sampled_from([0.2, 0.7, 1.0, 1.4]),
)
def test_fa1_is_equations_5_1_to_5_5(seed, ticks, decay, theta, period, alpha):
    rng = np.random.default_rng(seed)
    values = wander(rng, 300, 3, ticks) - 5.0  # some below 0
    t = np.arange(300) * round(period * 1000)
    encoder = FA1(alpha=alpha, decay=decay, theta_0=theta, period_ms=period)
    wanted = oracles.fa1(t, values.astype(np.float32), alpha, decay=decay, theta_0=theta, period_ms=period)
    assert spikes_of(encoder.encode(frames_of(t, values))) == wanted


def test_fa1_takes_its_baseline_from_the_range_after_the_power_law():
    rng = np.random.default_rng(3)
    t, values = np.arange(400) * 1000, wander(rng, 400, 2)
    wanted = oracles.fa1(t, values, largest=1000.0)
    assert spikes_of(FA1(range=1000.0).encode(frames_of(t, values))) == wanted
    assert spikes_of(FA1(theta_0=1000.0**0.7 / 1024).encode(frames_of(t, values))) == wanted


def test_fa1_on_ticks_by_table_equals_fa1_on_the_same_numbers_without_it():
    """A fractional value anywhere in a block of channels sends that block past the table."""
    rng = np.random.default_rng(4)
    t, values = np.arange(500) * 1000, wander(rng, 500, 10)
    odd = np.concatenate([values, np.full((500, 1), 0.5)], axis=1)
    direct = FA1().encode(frames_of(t, odd)).select(range(10))
    assert spikes_of(FA1().encode(frames_of(t, values))) == spikes_of(direct)


@settings(max_examples=40, deadline=None)
@given(seed=seeds, rows=st.integers(1, 9), columns=st.integers(1, 12), floor=st.sampled_from([0.0, 3.0]))
def test_contact_area_counts_loaded_taxels_with_loaded_neighbours(seed, rows, columns, floor):
    rng = np.random.default_rng(seed)
    array = Array(rows, columns)
    level = rng.choice([50.0, 56.0, 60.0], (rows, columns))
    tare = Tare.take(Frames([level, level], [0, 1000], array=array))
    lift = np.repeat(rng.integers(0, 12, 12), 5)[:, None, None]
    pictures = np.rint(level + lift * rng.random((60, rows, columns)))
    t = np.arange(60) * 192
    encoder = ContactArea(noise_floor=floor, levels=[1, 2, 4, 8, 16, 32], tare=tare)
    wanted = oracles.contact_area(t, pictures, level, floor, (1, 2, 4, 8, 16, 32))
    assert spikes_of(encoder.encode(Frames(pictures, t, array=array))) == wanted


@settings(max_examples=40, deadline=None)
@given(seed=seeds)
def test_contact_area_of_events_is_reckoned_once_a_stamp(seed):
    rng = np.random.default_rng(seed)
    array = Array(6, 7)
    events = touch(rng, array)
    held, pictures, stamps = np.full((6, 7), -np.inf), [], []
    for k, at in enumerate(events.t):
        if events.present[k]:
            held[events.y[k], events.x[k]] = events.intensity[k]
        if k + 1 == len(events) or events.t[k + 1] != at:
            pictures.append(held.copy())
            stamps.append(at)
    wanted = oracles.contact_area(stamps, pictures, np.full((6, 7), 55.0))
    spikes = ContactArea(tare=rest(array)).encode(events)
    assert len(spikes) == 10
    assert spikes_of(spikes) == wanted


def test_half_a_tick_above_the_floor_loads_a_taxel():
    tare = rest(Array(1, 2), 50)
    for value, rises in ((53.4, 0), (53.5, 1), (54.0, 1)):
        frames = Frames([[[50.0, 50.0]], [[value, value]]], [0, 192], array=tare.array)
        assert len(ContactArea(tare=tare).encode(frames)[0]) == rises


def test_a_lone_taxel_and_one_never_heard_of_are_no_contact():
    array = Array(3, 3)
    tare = Tare.take(Events([0, 0], [0, 1], [0, 0], [1, 1], array=array, intensity=[50, 50]), stop_us=1000)
    assert np.isnan(tare.rest).sum() == 7
    assert np.isnan(tare.rest[2, 2])
    alone = Events([0], [0], [0], [1], array=array, intensity=[90])
    unheard = Events([0, 0], [0, 2], [0, 2], [1, 1], array=array, intensity=[90, 90])
    both = Events([0, 0], [0, 1], [0, 0], [1, 1], array=array, intensity=[90, 90])
    assert [len(ContactArea(tare=tare).encode(e).times) for e in (alone, unheard, both)] == [0, 0, 1]
