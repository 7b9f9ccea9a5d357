"""The study of touch: its parts on cases with known answers, and the recipe that it shows."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel_studies import touch, touch_rivals


def test_the_discriminant_finds_the_direction_of_two_clouds() -> None:
    """With equal covariances the best direction is known; more dimensions than samples do little harm."""
    rng = np.random.default_rng(1)
    classes = np.arange(200) % 2
    move = np.zeros(400)
    move[:4] = 3.0

    def cloud(of: np.ndarray) -> np.ndarray:
        return (rng.normal(size=(len(of), 400)) + np.outer(of, move)).astype(np.float32)

    tell, new = touch_rivals.lda(cloud(classes), classes), cloud(classes)
    best = ((new - move / 2) @ move > 0) == classes
    assert np.mean(tell(new) == classes) > np.mean(best) - 0.1
    for kind in (0, 1):
        assert np.mean(tell(cloud(np.full(2000, kind))) == kind) > 0.85


def test_the_frame_around_a_touch_has_its_centre_in_the_middle_and_nothing_beyond_the_edge() -> None:
    values = np.zeros((3, 20, 40))
    values[0, 3:6, 30:33] = 9.0
    values[1, 0, 0] = 9.0
    values[2, 10, 20] = 3.0  # not loaded: the middle of the array is used
    inside, corner, nothing = touch_rivals.around(taxel.Frames(values, [0, 1, 2], unit="ticks")).reshape(3, 16, 16)
    assert np.argwhere(inside).mean(axis=0).tolist() == [8.0, 8.0]
    assert np.count_nonzero(inside) == 9
    assert np.argwhere(corner).tolist() == [[8, 8]]
    assert np.argwhere(nothing).tolist() == [[8, 8]]


@pytest.mark.slow
def test_the_spheres_are_told_apart_from_labels_alone() -> None:
    params = {**touch.PARAMETERS, "train": 100, "test": 40}
    found = touch.realise(params, 300)
    assert found["neuron"][params["times_ms"].index(10.0)] >= 0.9
    assert 3.0 < np.median(found["said_ms"]) < 8.0
