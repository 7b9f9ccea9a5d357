"""The study of FA-1's properties: each variant lacks one property and no other."""

from __future__ import annotations

import numpy as np

from taxel import Frames
from taxel_studies import fa1
from taxel_studies.spike_codes import PERIOD_US, SIDE


def frames() -> Frames:
    t = np.arange(300) * PERIOD_US
    bump = 60 * np.exp(-((np.mgrid[:SIDE, :SIDE] - 9.5) ** 2).sum(0) / 20)
    return Frames((bump * np.sin(np.pi * np.arange(300) / 300)[:, None, None]).astype(np.float32), t, unit="ticks")


def test_each_property_is_taken_away_alone() -> None:
    summary = {without: fa1.spikes(frames(), without, 0.3) for without in fa1.VARIANTS}
    whole, n = summary["all"], SIDE**2
    assert len(whole) == 2 * n
    assert len(summary["polarity"]) == n
    # Without polarity the same spikes, on one train a taxel.
    for taxel_ in (0, 205, 390):
        assert np.array_equal(summary["polarity"][taxel_], np.sort(np.concatenate([whole[taxel_], whole[n + taxel_]])))
    assert len(summary["threshold"].times) > 1.5 * len(whole.times)
    # Without spread, taxels with equal readings give equal spikes.
    even, drawn = summary["spread"], whole
    pairs = [(SIDE * k + k, SIDE * k + SIDE - 1 - k) for k in range(4, 9)]
    assert all(np.array_equal(even[a], even[b]) for a, b in pairs)
    assert not all(np.array_equal(drawn[a], drawn[b]) for a, b in pairs)


def test_a_drop_is_heard_by_every_variant() -> None:
    params = {"radius_mm": 30.0, "drop_mm": 150.0, "listen_ms": 5.0, "spread": 0.3}
    summary = fa1.realise(params, seed=1)
    assert all(sum(map(len, summary[without])) > 20 for without in fa1.VARIANTS)
