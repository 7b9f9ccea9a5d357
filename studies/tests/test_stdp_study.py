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


def test_no_input_is_silent_for_longer_than_the_pattern() -> None:
    times, who = stdp.background({**SMALL, "seconds": 5}, np.random.default_rng(2))
    longest = max(np.diff(times[who == n]).max() for n in range(200))
    assert longest <= 52.0


def test_pieces_hold_all_spikes_once() -> None:
    p = {**SMALL, "seconds": 3}
    spikes, _ = stdp.part(p, np.random.default_rng(3))
    result = list(stdp.pieces(p, spikes, 5000.0))
    assert [(one.start, one.stop) for one in result] == [(5000 + 1000 * k, 6000 + 1000 * k) for k in range(3)]
    assert sum(len(one.times) for one in result) == len(spikes[0])
