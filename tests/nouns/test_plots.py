"""Pictures: what cannot be drawn is one clear error."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusal import refused

import taxel
import taxel.plot

EVENTS = taxel.Events([0], [1], [2], [True], array=taxel.Array(3, 3))


@pytest.mark.parametrize("wrong", [None, 5, "walk.mcap", EVENTS, object, float("nan")])
@pytest.mark.parametrize("draw", [taxel.plot.overview, taxel.plot.health_map, taxel.Recording])
def test_what_is_no_recording_and_no_health_is_refused_in_one_line(draw: Any, wrong: Any) -> None:
    with refused(argument=next(iter(inspect.signature(draw).parameters))):
        draw(wrong)


def test_the_map_of_frames_is_the_largest_pressure_of_each_taxel(tmp_path: Path) -> None:
    values = np.zeros((20, 3, 4))
    values[5:9, 1, 2], values[7, 0, 3] = 40.0, 15.0
    taxel.convert(taxel.Frames(values, np.arange(20) * 10_000, unit="kPa"), tmp_path / "a.npz")
    _, where, bar = taxel.plot.overview(taxel.open(tmp_path / "a.npz")).axes
    assert np.array_equal(where.images[0].get_array(), values.max(axis=0))
    assert bar.get_ylabel() == "largest (kPa)"
