"""Pictures of a recording: its own, or what its taxels held at whole periods; as they were read, or calibrated."""

from __future__ import annotations

import numpy as np

from taxel._base.arguments import number
from taxel._core import ProblemError
from taxel.frames import Frames
from taxel.recording.contents import UNKNOWN, Contents, once
from taxel.recording.fates import after
from taxel.tare import Tare

__all__ = ["FRAMES_HZ", "calibrated", "period_us", "pictures"]

#: Pictures a second where a recording of events is asked for frames without a rate.
FRAMES_HZ = 100.0


def period_us(name: str, rate_hz: float) -> int:
    """Return the whole us of a rate.

    Raises
    ------
    ProblemError : not above 0, or above 1 MHz
    """
    rate = number(name, rate_hz, "Hz")
    if not 0 < rate <= 1e6:
        raise ProblemError(f"{name} is {rate}: must be above 0, at most 1000000")
    if rate < 1e-9:
        raise ProblemError(f"{name} is {rate}: must be 1e-9 or more, a picture in 31 years")
    return round(1e6 / rate)


def pictures(of: Contents, rate_hz: float | None = None, *, name: str = "rate_hz") -> Contents:
    """Return the same recording as pictures.

    Parameters
    ----------
    of : Contents
    rate_hz : float, above 0, optional
        Pictures a second, rounded to whole us; left out, pictures stay, and events are shown 100 times a second.
    name : str
        What errors call the rate.

    Returns
    -------
    Contents
        Of events: what the taxels hold, from what they held at the beginning on, else from 0; of pictures: the last
        one at each time.

    Raises
    ------
    ProblemError : a rate that makes no sense; where the pictures are asked for, events without intensities
    """
    period = None if rate_hz is None else period_us(name, rate_hz)
    return after(
        "pictures",
        of,
        lambda: ["the events between the pictures"] if of.has_events else [],
        events=None,
        frames=once(lambda: _drawn(of, period) if of.has_events else _resampled(of, period)),
        # The first picture holds it.
        held=None if of.has_events else once(lambda: of.held),
    )


def _drawn(of: Contents, period: int | None) -> Frames:
    events = of.events
    assert events is not None  # the caller asked
    # A value of 65 535 stands for one that is not known.
    begins = None if of.held is None else np.where(of.held == UNKNOWN, 0, of.held)
    period = round(1e6 / FRAMES_HZ) if period is None else period
    return Frames.from_events(events, period, *(of.stretch or ()), held=begins)


def _resampled(of: Contents, period: int | None) -> Frames:
    own = of.frames
    assert own is not None  # the caller asked
    if period is None or not len(own):
        return own
    t = np.arange(own.t[0], own.t[-1] + 1, period, dtype=np.int64)
    return Frames(own.values[np.searchsorted(own.t, t, side="right") - 1], t, unit=own.unit, array=own.array)


def calibrated(of: Contents, rate_hz: float | None = None, rest: Tare | None = None) -> Contents:
    """Return the same recording as pictures in N or kPa, by its calibration.

    Parameters
    ----------
    of : Contents
    rate_hz : float, above 0, optional
        As of `pictures`.
    rest : Tare, optional
        Today's rest; the calibration's own where it is left out.

    Raises
    ------
    ProblemError : no calibration, or one of another array
    """
    calibration = of.calibration
    if calibration is None:
        raise ProblemError(
            f"{of.path}: no calibration lies beside it; taxel calibrate makes one, and without one nothing is N or kPa"
        )
    drawn = pictures(of, rate_hz)
    assert drawn.frames is not None  # pictures
    frames = calibration.apply(drawn.frames, rest)
    return after("calibrated", drawn, events=None, frames=frames, held=None, calibration=None)
