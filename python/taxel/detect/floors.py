"""The noise floor of a sensor that is not a board, over all examples, from the noise of its taxels at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taxel.detect import recipes
from taxel.detect.examples import Example
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import BY_UNIT, NOISE_FLOOR, TIMES_NOISE, TOUCH, early, noise_floor, reach
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

__all__ = ["TOUCH", "early_part", "floor_alone", "floor_of", "measured_floor"]

#: With one kind of touch, any load is one: a drift of several times a small noise is none.
_SHARE_OF_ONE_KIND = 0.03
#: The third quartile of normal noise is so many standard deviations above its median.
_THIRD_QUARTILE = 0.6745
#: The noise of channels is looked at until so long before each label but those of ends, for so long, us, if there are
#: so many frames.
_BEFORE_US, _LOOK_US, _LEAST_FRAMES = 20_000, 250_000, 8


def measured_floor(examples: Sequence[Example]) -> float | None:
    """Return the noise floor of frames of a sensor, in its unit; None of a board's, whose registers set it.

    The median of `taxel.recording.analysis.rest.noise_floor` over the examples, as feet and recordings, to three
    digits: one whose noise is larger is no reason to ignore small loads in all others.

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
        if example.tare is not None and (floor := noise_floor(source, example.tare)):
            floors.append(floor)
    return float(f"{np.median(floors):.3g}") if floors else None


def floor_alone(examples: Sequence[Example], floor: float, *, kinds: int) -> float:
    """Return the noise floor of channels, each of which counts alone: by the noise before labels, if that is more.

    A tare by the unit has the noise of the quietest half second, which is less than elsewhere, or none. Other tares
    have the noise of a longer rest, so `floor` is enough.

    Parameters
    ----------
    examples : sequence of Example, checked
    floor : float, in the sensor's unit
        As of `measured_floor`, or stated.
    kinds : int
        How many kinds of touch there are. With one, the floor is at least three hundredths of the largest value
        above rest.
    """
    noises, floors = [0.0], [0.0]
    for example in examples:
        source = example.source
        if not isinstance(source, Frames) or example.tare is None or not len(source):
            continue
        if kinds == 1:
            floors.append(_SHARE_OF_ONE_KIND * reach(source, example.tare))
        if example.tare.note != BY_UNIT:
            continue
        begins = [times for label, times in example.labels.items() if recipes.neuron_of("touch", label) != "lift"]
        for t in np.concatenate([*begins, np.empty(0, np.int64)]).tolist():
            values = source.between(t - _BEFORE_US - _LOOK_US, t - _BEFORE_US).values
            if len(values) >= _LEAST_FRAMES:
                middle, above = np.nanquantile(values, (0.5, 0.75), axis=0)
                noises.append(TIMES_NOISE * float(np.nanmedian(above - middle)) / _THIRD_QUARTILE)
    return float(f"{max(floor, *(float(np.median(each[1:] or each)) for each in (noises, floors))):.3g}")


def floor_of(examples: Sequence[Example]) -> float:
    """Return the noise floor of plain rules: as it is measured, else that of the board's fast presets.

    Parameters
    ----------
    examples : sequence of Example
        As of `measured_floor`.
    """
    return measured_floor(examples) or NOISE_FLOOR


def early_part(example: Example) -> Tare | None:
    """Return the beginning of an example's tare, as a touch may end it; None if the tare is of another recording."""
    if example.tare is None or isinstance(example.source, SpikeTrains):
        return None
    return early(recorded(example.source), example.tare)
