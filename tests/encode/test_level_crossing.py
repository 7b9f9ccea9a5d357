"""Level crossings against a plain scan, and running ranges against percentiles."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.encode import LevelCrossing, RunningRange

from . import oracles
from .scenes import frames_of, spikes_of, wander

seeds = st.integers(0, 2**32 - 1)

REPAIRED = "read"
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "crossing": LevelCrossing([50.0, 60.0, 70.0], release_share=0.9),
    "crossing that holds": LevelCrossing([55.0, 65.0], hold_ms=0.3, tonic_ms=0.7, tonic_level=65.0),
    "crossing on the running range": LevelCrossing(
        [0.3, 0.6], hold_ms=0.2, tonic_ms=1.1, running_range=RunningRange(window_s=0.02, renew_s=0.005)
    ),
    # The spikes of its first window are late, because the window must be complete first.
    "crossing, first window by itself": LevelCrossing(
        [0.3, 0.6], running_range=RunningRange(window_s=0.02, renew_s=0.005, first_window="itself")
    ),
}


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels: by taxel and level, then the tonic ones by taxel."""
    levels = len(encoder.levels)
    crossings = (taxels[:, None] * levels + np.arange(levels)).ravel()
    return np.concatenate([crossings, *([of * levels + taxels] if encoder.tonic_ms else [])])


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
