"""The noise floor of a sensor that is not a board: from the noise of its taxels at rest, in its own unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel.detect.examples import Example
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import NOISE_FLOOR, SHARE, TIMES_NOISE

#: At least this share of the range above rest: taxels without noise drift and creep.
_SHARE_OF_RANGE = 0.01


def floor_at_rest(noise: NDArray[np.float64]) -> float:
    """Return the noise floor by the noise of taxels at rest, of which there is one at least, in its unit."""
    return TIMES_NOISE * float(np.quantile(noise, SHARE))


def measured_floor(examples: Sequence[Example]) -> float | None:
    """Return the noise floor of frames of a sensor, in its unit; None of a board's, whose registers set it.

    Six standard deviations of the noise in the tare, and a hundredth of the largest value above rest at least, both
    those that 90 % of the taxels have at most; the largest of all examples, to three digits.

    Parameters
    ----------
    examples : sequence of Example
        Those without a tare say nothing.
    """
    floors = []
    for example in examples:
        source = recorded(example.source)
        if not isinstance(source, Frames) or source.unit == "ticks":
            return None
        if example.tare is None or np.isnan(example.tare.noise).all() or not len(source):
            continue
        above = np.fmax.reduce(source.values, axis=0, initial=-np.inf) - example.tare.rest
        known = np.isfinite(above) & np.isfinite(example.tare.noise)
        reach = float(np.quantile(above[known], SHARE))
        floors.append(max(floor_at_rest(example.tare.noise[known]), _SHARE_OF_RANGE * reach))
    return float(f"{max(floors):.3g}") if max(floors, default=0.0) > 0.0 else None


def floor_of(examples: Sequence[Example]) -> float:
    """Return the noise floor of plain rules: as it is measured, else that of the board's fast presets.

    Parameters
    ----------
    examples : sequence of Example
        As of `measured_floor`.
    """
    return measured_floor(examples) or NOISE_FLOOR
