"""The feet of a walk: the load of each over time, from one recording of both, or from two of one foot each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel import Frames, ProblemError, Recording
from taxel.recording.opening import sensors

__all__ = ["SIDES", "Foot", "feet_of"]

SIDES = ("left", "right")
#: Times above this, us, count from 1970.
_SINCE_1970_US = 1_000_000_000_000_000


@dataclass(frozen=True, eq=False)
class Foot:
    """Hold one foot's insole over time.

    Parameters
    ----------
    side : {"left", "right", ""}
        "" where nothing says it.
    source : str
        The name of the insole within its recording.
    frames : Frames
        Only those without a missing value.
    t : float64, shape (n,), s
        By the recording's clock.
    force : float64, shape (n,)
        The load of the whole foot, in `unit`.
    unit : str
        "N", or the unit of the values, of which it is then the sum.
    range_end : float, in the unit of the values, optional
        Where the range of a taxel ends, if the file states it.
    """

    side: str
    source: str
    frames: Frames
    t: NDArray[np.float64]
    force: NDArray[np.float64]
    unit: str
    range_end: float | None = None

    @classmethod
    def of(cls, recording: Recording, side: str = "") -> Foot:
        """Return the foot of a recording of one sensor, in N where units, areas or a calibration give N.

        Raises
        ------
        ProblemError : frames without times, or events without intensities
        """
        if not recording.timed:
            raise ProblemError(f"{recording.title}: the frames have no times: state rate_hz in a layout file")
        frames = recording.frames() if recording.calibration is None else recording.calibrated()
        if frames.missing:
            whole = ~np.isnan(frames.values).any(axis=(1, 2))
            frames = Frames(frames.values[whole], frames.t[whole], unit=frames.unit, array=frames.array)
        force, unit = load_of(frames)
        # A calibration's unit is another.
        end = recording.range_end if recording.calibration is None else None
        return cls(side or recording.side, recording.label, frames, frames.t / 1e6, force, unit, end)

    @property
    def is_channel(self) -> bool:
        """Whether it is a single sensor."""
        return self.frames.array.taxels == 1


def load_of(frames: Frames) -> tuple[NDArray[np.float64], str]:
    """Return the load of each frame, and its unit: N where it is known, else that of the values that are added up."""
    force = frames.force()
    return (frames.total(), frames.unit) if force is None else (force, "N")


def feet_of(recordings: Sequence[Recording], side: str = "", *, same_clock: bool = False) -> list[Foot]:
    """Return the feet of one walk, the left one first.

    Parameters
    ----------
    recordings : sequence of Recording
        One of one foot or of both; or two of one walk, the left foot's first.
    side : {"left", "right", ""}
        The foot of a recording of one, where it does not state it.
    same_clock : bool
        Whether the times of two recordings count from the same moment, although they do not say so.

    Raises
    ------
    ProblemError : more than two feet, twice the same foot, or two recordings without a common clock
    """
    found = [one for recording in recordings for one in sensors(recording) if not one.is_stream]
    names = " and ".join(str(one.path) for one in recordings)
    if len(found) > len(SIDES):
        raise ProblemError(f"{names}: {len(found)} sensors; a walk has one or two insoles")
    given = SIDES if len(recordings) > 1 else (side,) if len(found) == 1 else ("", "")
    feet = [Foot.of(one, one.side or own) for one, own in zip(found, given, strict=True)]
    if len(feet) > 1 and {foot.side for foot in feet} != {*SIDES}:
        stated = ", ".join(foot.side or "unknown" for foot in feet)
        raise ProblemError(f"{names}: the feet are {stated}; must be one left and one right")
    begins = [foot.frames.t[0] for foot in feet if len(foot.t)]
    if len(recordings) > 1 and not same_clock and min(begins, default=0) < _SINCE_1970_US:
        raise ProblemError(
            f"{names}: their times count from the beginning of each, so they have no common clock; if both began at "
            "the same moment, say --same-clock"
        )
    return sorted(feet, key=lambda foot: foot.side)
