"""The noise floor of a sensor that is not a board, from the noise of its taxels at rest; and a touch in that rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taxel._core import ProblemError
from taxel.detect import recipes
from taxel.detect.examples import Example
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.rest import BY_UNIT, NOISE_FLOOR, SHARE, TIMES_NOISE
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

#: The number of loaded taxels of the smallest touch.
TOUCH = 2.0
#: This share of a tare, at its beginning, holds no touch.
_EARLY = 0.25
#: A taxel varies more than its noise at the beginning from so many times that on, and this part of the noise floor.
_VARIES, _OF_FLOOR = 3.0, 6.0
#: At least this share of the range above rest: taxels without noise drift and creep.
_SHARE_OF_RANGE = 0.01
#: The same with one kind of touch, where any load is one: so a drift of several times a small noise is none.
_SHARE_OF_ONE_KIND = 0.03
#: The third quartile of normal noise is so many standard deviations above its median.
_THIRD_QUARTILE = 0.6745
#: The noise of channels is looked at until so long before each label but those of ends, for so long, us, if there are
#: so many frames.
_BEFORE_US, _LOOK_US, _LEAST_FRAMES = 20_000, 250_000, 8


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
        noise = example.tare.noise[np.isfinite(example.tare.noise)]
        floors.append(max(floor_at_rest(noise), _SHARE_OF_RANGE * _reach(source, example.tare)))
    return float(f"{max(floors):.3g}") if max(floors, default=0.0) > 0.0 else None


def _reach(frames: Frames, tare: Tare) -> float:
    """Return the largest value above rest that 90 % of the taxels have at most."""
    above = np.fmax.reduce(frames.values, axis=0, initial=-np.inf) - tare.rest
    return float(np.quantile(above[np.isfinite(above) & np.isfinite(tare.noise)], SHARE))


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
    noises, floors = [], [floor]
    for example in examples:
        source = example.source
        if not isinstance(source, Frames) or example.tare is None or not len(source):
            continue
        if kinds == 1:
            floors.append(_SHARE_OF_ONE_KIND * _reach(source, example.tare))
        if example.tare.note != BY_UNIT:
            continue
        begins = [times for label, times in example.labels.items() if recipes.neuron_of("touch", label) != "lift"]
        for t in np.concatenate([*begins, np.empty(0, np.int64)]).tolist():
            values = source.between(t - _BEFORE_US - _LOOK_US, t - _BEFORE_US).values
            if len(values) >= _LEAST_FRAMES:
                middle, above = np.nanquantile(values, (0.5, 0.75), axis=0)
                noises.append(float(np.nanmedian(above - middle)) / _THIRD_QUARTILE)
    return float(f"{max(*floors, TIMES_NOISE * float(np.median(noises or [0.0]))):.3g}")


def floor_of(examples: Sequence[Example]) -> float:
    """Return the noise floor of plain rules: as it is measured, else that of the board's fast presets.

    Parameters
    ----------
    examples : sequence of Example
        As of `measured_floor`.
    """
    return measured_floor(examples) or NOISE_FLOOR


def held_by_tare(examples: Sequence[Example]) -> int:
    """Return how many taxels vary far more in the tare of an example than at its beginning, as a touch is in it.

    If there are several examples, it is the largest number. A tare of another recording says nothing: 0.

    Parameters
    ----------
    examples : sequence of Example, checked
    """
    return max((_held(example) for example in examples), default=0)


def _held(example: Example) -> int:
    """Return how many taxels vary far more in a tare than at its beginning."""
    early, tare = early_part(example), example.tare
    if early is None or tare is None:
        return 0
    floor = floor_of([example._replace(tare=early)])
    noise, more = early.noise, floor / _OF_FLOOR
    source = example.source
    if isinstance(source, Frames) and are_counts(source.unit):
        # Few events show neither their noise nor that one more is chance.
        first, last = (len(source.between(each.start_us, each.stop_us)) for each in (early, tare))
        noise = np.maximum(noise, (np.nanmean(early.rest) + 1.0 / (first * noise.size)) ** 0.5)
        more = max(more, last**-0.5)
    return int(np.count_nonzero(tare.noise > _VARIES * noise + more))


def early_part(example: Example) -> Tare | None:
    """Return the beginning of an example's tare, as a touch may end it; None if the tare is of another recording."""
    tare, source = example.tare, example.source
    if tare is None or isinstance(source, SpikeTrains):
        return None
    try:
        tare_again = Tare.take(source, start_us=tare.start_us, stop_us=tare.stop_us)
        early = tare.start_us + round(_EARLY * (tare.stop_us - tare.start_us))
        return (
            Tare.take(source, start_us=tare.start_us, stop_us=early)
            if np.array_equal(tare_again.rest, tare.rest, equal_nan=True)
            else None
        )
    except ProblemError:
        return None
