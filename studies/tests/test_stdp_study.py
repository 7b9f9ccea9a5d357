"""The study of STDP: its streams are what the protocol says."""

from __future__ import annotations

import numpy as np

from taxel_studies import stdp

SMALL = {**stdp.PARAMETERS, "trains": 200, "seconds": 10}


def test_the_pattern_comes_a_quarter_of_the_time_and_never_twice_in_a_row() -> None:
    for seed in range(5):
        begin = stdp.starts(SMALL, np.random.default_rng(seed))
        assert len(begin) == 50
        assert (np.diff(begin) >= 100).all()
        assert ((begin % 50 == 0) & (begin <= 9950)).all()


def test_rates_hide_the_pattern_and_its_copies_differ_by_the_jitter() -> None:
    rng = np.random.default_rng(1)
    (times, who), begin = stdp.part(SMALL, rng)
    assert (np.diff(times) >= 0).all()
    inside = np.zeros(len(times), bool)
    for start in begin:
        inside |= (times >= start) & (times < start + 50)
    rate = {
        which: np.count_nonzero(mask) / (200 * seconds)
        for which, mask, seconds in (("in", inside, 2.5), ("out", ~inside, 7.5))
    }
    # Between 45 and 64 Hz and 10 of noise, alike in the pattern and out of it.
    assert 45 < rate["out"] < 80
    assert abs(rate["in"] / rate["out"] - 1) < 0.1
    quiet = {**SMALL, "noise_hz": 0.0, "jitter_ms": 0.0}
    (times, who), begin = stdp.part(quiet, np.random.default_rng(1))
    copies = [np.sort(times[(times >= b) & (times < b + 50) & (who < 100)] - b) for b in begin[:10]]
    assert all(np.allclose(copy, copies[0]) for copy in copies)
