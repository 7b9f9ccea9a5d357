"""The thesis' distance with a spatial kernel: 5.11 and 5.12 by plain NumPy, and what the readings do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawing import pattern, pieces, smoothed
from refusal import refused

from taxel import Array, SpikeTrains
from taxel.metrics import van_rossum, van_rossum_spatial

ARRAY = Array(2, 3, pitch_mm=1.5)


def spread(x, array, t, tau, sigma, own_train):
    """5.11 at these times: one row a taxel."""
    f = np.array([smoothed(train, t, tau) for train in x])
    y, column = np.divmod(np.arange(array.rows * array.columns), array.columns)
    d = array.pitch_mm * np.hypot(y[:, None] - y, column[:, None] - column)
    g = np.exp(-d / sigma) @ f + (f if own_train == "twice" else 0)
    return g if array.exists is None else g[array.exists.ravel()]


def plain(a, b, array, tau, sigma, own_train):
    """Sum over taxels of the integrals of the square, by a fine rule between all steps."""
    t, w = pieces(a.times, b.times, tau)
    difference = spread(a, array, t, tau, sigma, own_train) - spread(b, array, t, tau, sigma, own_train)
    return float((difference**2 @ w).sum())


@pytest.mark.parametrize("own_train", ["twice", "once"])
@pytest.mark.parametrize("tau", [0.4, 20.0])
def test_it_is_what_5_11_and_5_12_give_in_plain_numpy(own_train, tau):
    random = np.random.default_rng(8)
    a, b = pattern(random, 6, 3.0), pattern(random, 6, 3.0)
    square = plain(a, b, ARRAY, tau, 2.0, own_train)
    parameters = {"array": ARRAY, "tau": tau, "sigma": 2.0, "own_train": own_train}
    assert van_rossum_spatial(a, b, normalisation="none", **parameters) == pytest.approx(math.sqrt(square), rel=1e-9)
    assert van_rossum_spatial(a, b, **parameters) == pytest.approx(math.sqrt(2 * square / tau), rel=1e-9)


def test_on_and_off_trains_are_smoothed_apart_and_missing_taxels_do_not_count():
    one = Array(1, 2, pitch_mm=1.0)
    on = SpikeTrains.from_lists([[1.0], [], [], []], stop=9.0)
    off = SpikeTrains.from_lists([[], [], [1.0], []], stop=9.0)
    silent = SpikeTrains.from_lists([[]] * 4, stop=9.0)
    lone = van_rossum_spatial(on, silent, array=one)
    assert van_rossum_spatial(on, off, array=one) == pytest.approx(math.sqrt(2) * lone)
    signed = SpikeTrains.from_lists([[1.0], []], stop=9.0, values=[[-1.0], []])
    assert van_rossum_spatial(signed, off, array=one) == 0
    lacking = Array(1, 2, pitch_mm=1.0, exists=np.array([[True, False]]))
    half = [x.select([0, 1]) for x in (on, silent)]
    assert van_rossum_spatial(*half, array=lacking) == pytest.approx(2.0)
    with refused():
        van_rossum_spatial(SpikeTrains.from_lists([[], [1.0]]), half[1], array=lacking)
    with refused():
        van_rossum_spatial(on.select([0, 1, 2]), on.select([0, 1, 2]), array=one)
    with refused(argument="sigma"):
        van_rossum_spatial(on, off, array=one, sigma=0.0)


def test_long_patterns_neither_overflow_nor_lose_the_tail():
    a = SpikeTrains.from_lists([np.arange(0, 4000.0, 7.0)], stop=5000.0)
    b = SpikeTrains.from_lists([np.arange(0, 4000.0, 7.0) + 0.5], stop=5000.0)
    one = Array(1, 1, 1.0)
    expected = van_rossum(a[0], b[0], tau=0.4)
    assert van_rossum_spatial(a, b, array=one, own_train="once") == pytest.approx(expected, rel=1e-12)
