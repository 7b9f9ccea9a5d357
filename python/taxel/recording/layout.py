"""Applies a layout file to a recording: its sensor, its unit, its times, and readings that fall with pressure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen_whole
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.layout import Layout, packaged
from taxel.frames import Frames
from taxel.recording.contents import Contents, alone, once
from taxel.recording.pictures import times_at

__all__ = ["check_size", "laid_out", "on_array"]

#: Units that say nothing: what a table or a stream of numbers holds.
_UNSAID = ("counts", "as sent")


def check_size(path: Path, size: tuple[int, ...], array: Array) -> None:
    """Refuse a given array of other rows and columns than a file's pictures.

    Raises
    ------
    ProblemError : other rows or columns
    """
    if size != array.shape:
        held = " x ".join(map(str, size))
        raise ProblemError(f"array: {array.rows} x {array.columns} taxels; {path} holds pictures of {held}")


def on_array(of: Contents, array: Array) -> Contents:
    """Return the same recording on another description of its sensor, of as many taxels; their names stay."""
    if array.names is None and of.array.names is not None:
        array = replace(array, names=of.array.names)

    def events() -> Events | None:
        if of.events is None:
            return None
        same = of.events[:]
        same.array = array
        return same

    if of.has_events:
        return of.but(array=array, events=once(events))

    def frames() -> Frames | None:
        own = of.frames
        return own and Frames(own.values.reshape(-1, *array.shape), own.t, unit=own.unit, array=array)

    return of.but(array=array, frames=once(frames))


def laid_out(of: Contents, layout: Layout) -> Contents:
    """Return a recording with what its layout says of it.

    Raises
    ------
    FormatError : the layout is of another number of taxels, or contradicts the file (names the layout)
    """
    if of.sources:
        sources = {n: one if one.columns else laid_out(one.but(sources={}), layout) for n, one in of.sources.items()}
        for name, one in sources.items():
            sources[name] = one.but(sources=sources)
        return alone(sources)
    try:
        array = _array(of, layout)
    except ProblemError as error:
        raise FormatError(f"{layout.place}: {of.name}: {first_line(error)}") from None
    same = of if array == of.array else on_array(of, array)
    if (layout.falls is not False or layout.unit or layout.rate_hz) and same.has_events:
        raise FormatError(f"{layout.place}: {of.name} holds events; falls, unit and rate_hz are of pictures")
    if not same.has_events and same.frames is not None:
        # Read at once, so that a layout that contradicts the file is refused where the file is opened.
        same = same.but(frames=_read(same.frames, layout, of.name, is_alone=of.kind in _ALONE))
    untimed = same.untimed and layout.rate_hz is None
    return same.but(side=of.side or layout.side, heel=layout.heel or of.heel, untimed=untimed)


def _array(of: Contents, layout: Layout) -> Array:
    """Return the sensor of a recording as its layout says, which may not contradict the file."""
    own = of.array
    array = layout.array(own.rows * own.columns, own, of.side)
    if of.has_events and array.shape != own.shape:
        raise ProblemError(f"says {array.rows} x {array.columns} taxels; its events are of {own.rows} x {own.columns}")
    if min(own.shape) > 1 and array.shape != own.shape:
        raise ProblemError(f"says {array.rows} x {array.columns} taxels; the file says {own.rows} x {own.columns}")
    if not array._is_measured:
        kept = own if array.shape == own.shape else replace(array, pitch_mm=own.pitch_mm, name=own.name)
        return kept if own.places is None or array.shape == own.shape else array
    along = own.places is not None and of.kind in _ALONG and own.places == _places_along(of)
    if own._is_measured and not along and (own.pitch_mm, own.places) != (array.pitch_mm, array.places):
        raise ProblemError(f"says taxels {array._apart()}; the file says {own._apart()}")
    return array


#: Formats with a layout that comes along, which another layout may replace.
_ALONG = ("gaitpdb",)


def _places_along(of: Contents) -> object:
    return packaged(of.kind).array(of.array.columns, of.array, of.side).places


#: Kinds of files of one recording, whose times no other one has.
_ALONE = ("table", "arrays", "npz", "h5", "csv")


def _read(own: Frames, layout: Layout, name: str, *, is_alone: bool) -> Frames:
    """Return pictures in the unit, at the rate and in the direction that a layout says.

    No other code holds these pictures yet, so that `own` is changed in place: its times only if it is alone in its
    file.
    """
    unit, t, values = own.unit, own.t, own.values
    if layout.unit is not None:
        if unit not in (*_UNSAID, layout.unit):
            raise FormatError(f"{layout.place}: says unit {layout.unit}; {name} is in {unit}")
        unit = layout.unit
    if layout.rate_hz is not None:
        if _are_numbers(t):
            try:
                t = _times_at(layout.rate_hz, _writable(t) if is_alone else np.empty_like(t))
            except ProblemError as error:
                raise FormatError(f"{layout.place}: {name}: {error}") from None
        elif len(t) > 1 and abs(layout.rate_hz * (step := _median_step(t)) / 1e6 - 1) > _SLACK:
            raise FormatError(f"{layout.place}: says {layout.rate_hz:g} Hz; the times of {name} make {1e6 / step:g} Hz")
    if layout.falls is not False:
        full = 0.0 if layout.falls is True else layout.falls
        values = _writable(values)
        step = max(1, _PIECE // max(1, values[:1].size))
        for begin in range(0, len(values), step):
            part = values[begin : begin + step]
            with np.errstate(over="ignore"):
                risen = np.float32(full) - part
            if (large := np.isinf(risen)).any():
                raise FormatError(
                    f"{layout.place}: falls is {layout.falls}; {name} reads {shown(part[large][0].item())}, and the "
                    "difference does not fit 32 bits"
                )
            part[...] = risen
        frozen_whole(values)
    return Frames(values, t, unit=unit, array=own.array)


def _parts(length: int) -> Iterator[slice]:
    """Yield the parts of a column that are computed one after the other, beside which little memory is taken."""
    return (slice(begin, min(begin + _PIECE, length)) for begin in range(0, length, _PIECE))


def _are_numbers(t: NDArray[np.int64]) -> bool:
    """Return whether times only number the pictures: 0, 1, 2 ..."""
    return all(np.array_equal(t[part], np.arange(part.start, part.stop)) for part in _parts(len(t)))


def _times_at(rate_hz: float, t: NDArray[np.int64]) -> NDArray[np.int64]:
    """Fill a column with the times of pictures at a rate (`times_at`)."""
    # The last is refused before the others change.
    times_at(np.array([len(t) - 1]), rate_hz)
    for part in _parts(len(t)):
        t[part] = times_at(np.arange(part.start, part.stop), rate_hz)
    return frozen_whole(t)


def _median_step(t: NDArray[np.int64]) -> float:
    """Return the median of the steps between times, us, as exact as 32 bits."""
    steps = np.empty(len(t) - 1, np.float32)
    for part in _parts(len(steps)):
        steps[part] = np.diff(t[part.start : part.stop + 1])
    return float(np.median(steps, overwrite_input=True))


def _writable(array: NDArray[Any]) -> NDArray[Any]:
    """Return an array that nobody else has, made writable again; a copy if its memory is not NumPy's."""
    parts, part = list[NDArray[Any]](), array.base
    while isinstance(part, np.ndarray):
        parts.append(part)
        part = part.base
    if part is not None:
        return array.copy()
    for one in (*reversed(parts), array):
        one.setflags(write=True)
    return array


#: Values, or times, that are computed at once.
_PIECE = 1 << 17
#: The share by which a rate that a layout says may differ from that of a file's own times.
_SLACK = 0.05
