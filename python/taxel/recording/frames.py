"""Frames of a recording: its own, or the held values at multiples of a period; raw or calibrated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import number
from taxel._base.columns import frozen
from taxel._base.errors import refused
from taxel._base.limits import TIME_US
from taxel._core import ProblemError
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording import sections
from taxel.recording.contents import (
    Contents,
    Drawn,
    FrameSource,
    RecordedSource,
    Stream,
    refuse_several,
    several,
    with_losses,
)
from taxel.recording.once import UNKNOWN, Once, known
from taxel.tare import Tare

#: The default rate of frames of a recording of events, Hz.
FRAMES_HZ = 100.0


def period_us(name: str, rate_hz: float) -> int:
    """Return the period of a rate in whole us.

    Raises
    ------
    ProblemError : not above 0, or above 1 MHz
    """
    rate = number(name, rate_hz, "Hz")
    if not 0 < rate <= 1e6:
        raise refused(name, f" is {rate}: must be above 0, at most 1000000")
    if rate < 1e-9:
        raise refused(name, f" is {rate}: must be 1e-9 (a frame in 31 years) or more")
    return round(1e6 / rate)


def times_at(number: NDArray[np.int64], rate_hz: float) -> NDArray[np.int64]:
    """Return the times of numbered frames at a rate, us.

    Raises
    ------
    ProblemError : a time that is not within 142 years of 0
    """
    us = number * (1e6 / rate_hz)
    if len(us) and np.abs(us).max() > TIME_US:
        raise ProblemError(
            f"rate_hz is {rate_hz:g}: the time of frame {number[-1]} would be {us[-1] / 1e6:.3g} s; must be within 142 "
            "years of 0"
        )
    t: NDArray[np.int64] = np.rint(us).astype(np.int64)
    return t


def as_frames(source: RecordedSource, rate_hz: float | None = None, *, name: str = "rate_hz") -> FrameSource:
    """Return the same recording as frames.

    Parameters
    ----------
    source : Source
    rate_hz : float, above 0, optional
        Frames a second, with a period rounded to whole us; default: frames are unchanged, events have 100 a second.
    name : str
        The name of the rate in errors.

    Returns
    -------
    FrameSource
        For events: the held values of the taxels, beginning with those at the start of the recording, or with 0; for
        frames: the last one at each time.

    Raises
    ------
    ProblemError : an invalid rate; when the frames are read, events without intensities
    """
    period = None if rate_hz is None else period_us(name, rate_hz)
    if period is not None and source.untimed:
        raise ProblemError(
            f"{source.origin.path}: the frames have no times, so their rate is unknown; to give one, call "
            f"recording.at_rate"
        )
    if isinstance(source, FrameSource):
        return replace(
            source, frame_table=replace(source.frame_table, frames=Once(lambda: _resample(source.table, period)))
        )
    refuse_several(source)
    header = {section: getattr(source, section) for section in ("marks", "timing", "losses")}
    # The first frame includes the held values.
    header["settings"] = sections.Settings(known(None), source.settings.registers, source.settings.register_changes)
    frames = Once(lambda: _draw(source, period))
    return Drawn(source.origin, source.sensor, sections.FrameTable(frames), source.section(sections.Wire), **header)


def _draw(source: RecordedSource, period: int | None) -> Frames:
    events, held, interval = source.table, source.settings.held(), source.timing.interval
    assert isinstance(events, Events)  # the caller checked
    # A value of 65 535 means unknown.
    begins = None if held is None else np.where(held == UNKNOWN, 0, held)
    period = round(1e6 / FRAMES_HZ) if period is None else period
    return Frames.from_events(events, period, *(() if interval is None else interval()), held=begins)


def _resample(frames: Frames, period: int | None) -> Frames:
    if period is None or not len(frames):
        return frames
    t = np.arange(frames.t[0], frames.t[-1] + 1, period, dtype=np.int64)
    return Frames(
        frames.values[np.searchsorted(frames.t, t, side="right") - 1], t, unit=frames.unit, array=frames.array
    )


def at_rate(contents: Contents, rate_hz: float) -> Contents:
    """Return numbered frames with times: frame k at k / rate.

    Raises
    ------
    ProblemError : frames that have times, or an invalid rate
    """
    period_us("rate_hz", rate_hz)
    if not contents.main.untimed:
        raise ProblemError(
            f"{contents.main.origin.path}: the frames have times; a rate is only for frames without times"
        )
    sources = {name: _at_rate(source, rate_hz) for name, source in contents.sources.items()}
    return Contents(several(sources) if contents.is_several else _at_rate(contents.main, rate_hz), sources)


def _at_rate(source: RecordedSource, rate_hz: float) -> RecordedSource:
    if not isinstance(source, FrameSource) or not source.untimed:
        return source

    def frames(table: Frames) -> Frames:
        return Frames(table.values, frozen(times_at(table.t, rate_hz)), unit=table.unit, array=table.array)

    def notes(before: tuple[Note, ...]) -> tuple[Note, ...]:
        return tuple(replace(n, t=None if n.t is None else round(n.t * 1e6 / rate_hz)) for n in before)

    frame_table = replace(source.frame_table, frames=source.frame_table.frames.to(frames), untimed=False)
    return replace(source, frame_table=frame_table, marks=replace(source.marks, notes=source.marks.notes.to(notes)))


def calibrate(source: RecordedSource, rate_hz: float | None = None, rest: Tare | None = None) -> FrameSource:
    """Return the same recording as frames in N or kPa, by its calibration.

    Parameters
    ----------
    source : Source
    rate_hz : float, above 0, optional
        As of `as_frames`.
    rest : Tare, optional
        Today's rest; default: the calibration's own.

    Raises
    ------
    ProblemError : not a calibration, or a calibration of another array
    """
    calibration = source.sensor.calibration()
    if calibration is None:
        raise ProblemError(
            f"{source.origin.path}: no calibration was found beside it, so the values cannot be converted to N or "
            "kPa; to make a calibration, run taxel calibrate"
        )
    drawn = as_frames(source, rate_hz)
    calibrated = replace(
        drawn,
        frame_table=replace(drawn.frame_table, frames=known(calibration.apply(drawn.table, rest))),
        settings=replace(drawn.settings, held=known(None)),
        sensor=replace(drawn.sensor, calibration=known(None)),
    )
    if not isinstance(calibrated, Stream):
        return calibrated
    return with_losses(
        replace(calibrated, stream=sections.SampleColumns(calibrated.stream.columns)), calibrated.stream.received
    )
