"""What a pressure lab reads first, against SciPy: area, peak, sum and centre of pressure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from taxel import Array, Frames


def drawn(seed: int) -> Frames:
    rng = np.random.default_rng(seed)
    values = rng.normal(1, 4, (6, 5, 7)) * (rng.random((6, 5, 7)) < 0.5)
    values[2] = 0
    array = Array(5, 7, pitch_mm=2.5)
    return Frames(values, np.arange(6), unit="N", array=array)


@given(st.integers(0, 10**6), st.sampled_from([0.0, 1.5]))
def test_area_peak_sum_and_centre_are_scipy_s(seed: int, above: float) -> None:
    frames = drawn(seed)
    for k, frame in enumerate(frames.values.astype(np.float64)):
        loaded = frame > above
        assert frames.area(above)[k] == loaded.sum() * 6.25
        assert frames.peak()[k] == frame.max()
        assert frames.total()[k] == pytest.approx(frame.sum(), abs=1e-9)
        if not loaded.any():
            assert np.isnan(frames.centre(above)[k]).all()
        else:
            y, x = ndimage.center_of_mass(np.where(loaded, frame, 0.0))
            np.testing.assert_allclose(frames.centre(above)[k], [2.5 * x, 2.5 * y], 1e-9, 1e-9)
