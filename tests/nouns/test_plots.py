"""Pictures: what cannot be drawn is one clear error."""

from __future__ import annotations

import inspect
from typing import Any

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
