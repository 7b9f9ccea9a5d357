"""Pictures of a recording: its own, or the held values at multiples of a period; raw or calibrated."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import number
from taxel._base.columns import frozen
from taxel._base.limits import TIME_US
from taxel._core import ProblemError
from taxel.frames import Frames
from taxel.recording.contents import UNKNOWN, Contents, once
from taxel.recording.fates import after
from taxel.tare import Tare

__all__ = ["FRAMES_HZ", "at_rate", "calibrated", "period_us", "pictures", "times_at"]

#: The default rate of pictures of a recording of events, Hz.
FRAMES_HZ = 100.0


def period_us(name: str, rate_hz: float) -> int:
    """Return the period of a rate in whole us.

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


def times_at(number: NDArray[np.int64], rate_hz: float) -> NDArray[np.int64]:
    """Return the times of numbered pictures at a rate, us.

    Raises
    ------
    ProblemError : a time that does not lie within 142 years of 0
    """
    us = number * (1e6 / rate_hz)
    if len(us) and np.abs(us).max() > TIME_US:
        raise ProblemError(
            f"{rate_hz:g} Hz: picture {number[-1]} comes at {us[-1] / 1e6:.3g} s; must lie within 142 years"
        )
    t: NDArray[np.int64] = np.rint(us).astype(np.int64)
    return t


def pictures(of: Contents, rate_hz: float | None = None, *, name: str = "rate_hz") -> Contents:
    """Return the same recording as pictures.

    Parameters
    ----------
    of : Contents
    rate_hz : float, above 0, optional
        Pictures a second, with a period rounded to whole us; default: pictures are unchanged, events have 100 a second.
    name : str
        The name of the rate in errors.

    Returns
    -------
    Contents
        For events: the held values of the taxels, beginning with those at the start of the recording, or with 0; for
        pictures: the last one at each time.

    Raises
    ------
    ProblemError : an invalid rate; when the pictures are read, events without intensities
    """
    period = None if rate_hz is None else period_us(name, rate_hz)
    if period is not None and of.untimed:
        raise ProblemError(f"{of.path}: its pictures have no times, so they have no rate; see recording.at_rate")
    return after(
        "pictures",
        of,
        lambda: ["the events between the pictures"] if of.has_events else [],
        events=None,
        frames=once(lambda: _drawn(of, period) if of.has_events else _resampled(of, period)),
        # The first picture includes the held values.
        held=None if of.has_events else once(lambda: of.held),
    )


def _drawn(of: Contents, period: int | None) -> Frames:
    events = of.events
    assert events is not None  # the caller checked
    # A value of 65 535 stands for an unknown one.
    begins = None if of.held is None else np.where(of.held == UNKNOWN, 0, of.held)
    period = round(1e6 / FRAMES_HZ) if period is None else period
    return Frames.from_events(events, period, *(of.stretch or ()), held=begins)


def _resampled(of: Contents, period: int | None) -> Frames:
    own = of.frames
    assert own is not None  # the caller checked
    if period is None or not len(own):
        return own
    t = np.arange(own.t[0], own.t[-1] + 1, period, dtype=np.int64)
    return Frames(own.values[np.searchsorted(own.t, t, side="right") - 1], t, unit=own.unit, array=own.array)


def at_rate(of: Contents, rate_hz: float) -> Contents:
    """Return numbered pictures with times: picture k at k / rate.

    Raises
    ------
    ProblemError : pictures that have times, or an invalid rate
    """
    period_us("rate_hz", rate_hz)
    if not of.untimed:
        raise ProblemError(f"{of.path}: has times of its own; a rate is of pictures without times")

    def time(t: int) -> int:
        return round(t * 1e6 / rate_hz)

    def frames() -> Frames | None:
        own = of.frames
        if own is None:
            return None
        t = times_at(own.t, rate_hz)
        return Frames(own.values, frozen(t), unit=own.unit, array=own.array)

    def sources() -> Mapping[str, Contents]:
        every: dict[str, Contents] = {}
        for label, one in of.sources.items():
            every[label] = at_rate(one.but(sources={}), rate_hz).but(sources=every)
        return every

    notes = once(lambda: tuple(replace(n, t=None if n.t is None else time(n.t)) for n in of.notes))
    # Not a row of the table of fates: nothing else changes, and nothing is lost.
    return of.but(frames=once(frames), notes=notes, untimed=False, sources=once(sources))


def calibrated(of: Contents, rate_hz: float | None = None, rest: Tare | None = None) -> Contents:
    """Return the same recording as pictures in N or kPa, by its calibration.

    Parameters
    ----------
    of : Contents
    rate_hz : float, above 0, optional
        As of `pictures`.
    rest : Tare, optional
        Today's rest; default: the calibration's own.

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
