"""The study of codes: the region that it reads, and that planted latencies are found."""

from __future__ import annotations

import numpy as np

from taxel_studies import codes


def test_a_drop_gives_on_spikes_first_and_more_of_them_from_higher_up():
    params = {"radius_mm": 30.0, "listen_ms": 10.0}
    low, high = (codes.realise({**params, "drop_mm": drop}, seed=1) for drop in (50.0, 200.0))
    half = codes.SIDE**2
    assert len(low) == len(high) == 2 * half
    on, off = ([min(t) for t in part if t] for part in (high[:half], high[half:]))
    assert 0 <= min(on) < 1.5
    assert min(on) < min(off, default=np.inf)
    assert sum(map(len, high)) > sum(map(len, low))
