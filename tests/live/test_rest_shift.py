"""Whether the taxels rest elsewhere after a gap: told once, and not where a load lies or nothing was interrupted."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.cli._rest_shift import RestShift

SHAPE = (12, 12)
REST, NOISE = np.full(SHAPE, 500.0), np.full(SHAPE, 1.0)


def told(shift: NDArray[np.float64], *, gap_s: float = 2.5, floor: float = 10.0, looks: int = 60) -> list[str]:
    """Return what is told of taxels that rest, are silent so long, and then rest this much elsewhere."""
    rng, watch = np.random.default_rng(3), RestShift(floor)
    rows = [(0.0, REST)] * 20 + [(s, REST) for s in np.arange(0.1, gap_s, 0.1)] + [(0.0, REST + shift)] * looks
    looked = [watch.look(s, values + rng.normal(0, 1, SHAPE), REST, NOISE, "counts") for s, values in rows]
    return [line for line in looked if line]


@pytest.mark.parametrize("floor", [10.0, 0.0])
def test_a_rest_that_shifted_in_a_gap_is_told_once_with_how_many_taxels_and_how_far(floor: float) -> None:
    shift = np.where(np.arange(144).reshape(SHAPE) < 76, 32.0, 0.0) * np.where(np.arange(12) % 2, 1, -1)
    (line,) = told(shift, floor=floor)
    assert line.startswith("after a gap of 2.4 s 76 of 144 taxels rest elsewhere than by the tare, by up to 3"), line
    assert "start anew with --tare SECONDS" in line


def test_nothing_is_told_without_a_gap_a_shift_or_rest() -> None:
    everywhere, press = np.full(SHAPE, 32.0), np.zeros(SHAPE)
    press[3:6, 3:6] = 200.0
    assert told(everywhere, gap_s=0.5) == []
    assert told(np.zeros(SHAPE)) == []
    assert told(press) == []
    # Values that do not hold still are those of a press.
    rng, watch = np.random.default_rng(3), RestShift(10.0)
    watch.look(2.0, REST, REST, NOISE, "counts")
    assert not any(watch.look(0.0, REST + rng.uniform(0, 99, SHAPE), REST, NOISE, "counts") for _ in range(50))
