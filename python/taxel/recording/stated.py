"""Applies a layout file to a recording: its sensor, its unit, its times, readings that fall, and rest before them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.errors import refused
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.layout import Layout
from taxel.frames import Frames
from taxel.reading import after_zeros
from taxel.recording.frames import times_at
from taxel.recording.source import SourceView

#: Units that say nothing: what a table or a stream of numbers holds.
_UNSAID = ("counts", "as sent")


def check_size(path: Path, size: tuple[int, ...], array: Array) -> None:
    """Refuse a given array of other rows and columns than a file's frames.

    Raises
    ------
    ProblemError : other rows or columns
    """
    if size != array.shape:
        shape = " x ".join(map(str, size))
        raise refused("array", f" has {array.rows} x {array.columns} taxels; the frames of {path} have {shape}")


def is_row_of(stated: Array, array: Array) -> bool:
    """Return whether a sensor is a row of as many channels as another has taxels, as tables and arrays hold a grid."""
    is_row = stated.shape == (1, array.rows * array.columns) and stated.taxels == stated.columns
    return is_row and array.rows > 1 and not stated._is_measured


def on_array(source: SourceView, array: Array) -> SourceView:
    """Return the same source on another description of its sensor, of as many taxels; their names stay."""
    names = source.array.names
    return source.stated(array=replace(array, names=names) if array.names is None and names is not None else array)


def apply_layout(source: SourceView, layout: Layout, *, given: bool) -> SourceView:
    """Return a source with what its layout says of it; it says nothing of streams of numbers.

    Parameters
    ----------
    source : SourceView
    layout : Layout
    given : bool
        Whether it was named for this recording; else it is beside it, and fills only what a file that states its sensor
        lacks.

    Raises
    ------
    FormatError : the layout is of another number of taxels, or contradicts the file (names the layout)
    """
    if source.facts.columns:
        return source
    facts = source.facts
    kind, name = facts.kind, facts.name
    strict = given or kind not in _STATING
    try:
        array = _array(source, layout)
    except ProblemError as error:
        if strict:
            raise FormatError(f"{layout.path}: {name}: {first_line(error)}") from None
        array = facts.array
    if strict and facts.heel and layout.heel not in ("", facts.heel):
        raise FormatError(f"{layout.path}: states heel {layout.heel}, but {name} states {facts.heel}")
    same = source if array == facts.array else on_array(source, array)
    same = same.stated(side=facts.side or layout.side, heel=facts.heel or layout.heel)
    if facts.has_events:
        if strict and (layout.turned is not None or layout.unit or layout.rate_hz or layout.zeros_before_s):
            of_frames = "falls, unit, rate_hz and zeros_before_s are only for frames"
            raise FormatError(f"{layout.path}: {name} contains events; {of_frames}")
        return same
    was = facts.turned
    if strict and was is not None and layout.falls is not None and layout.turned != was:
        falls = "false" if layout.turned is None else f"{layout.turned:g}"
        raise FormatError(
            f"{layout.path}: states falls = {falls}, but the readings of {name} were already inverted with falls = "
            f"{was:g}; remove falls from the layout file"
        )
    full = layout.turned if was is None else None
    if full is None and layout.unit is None and layout.rate_hz is None and layout.zeros_before_s is None:
        return same
    # Read at once, so that a layout that contradicts the file is refused where the file is opened.
    table = same.table
    assert isinstance(table, Frames)  # the facts say so
    frames = _read(table, layout, full, name, strict=strict)
    untimed = not facts.timed and layout.rate_hz is None
    if layout.zeros_before_s is not None:
        if untimed:
            raise FormatError(
                f"{layout.path}: zeros_before_s needs times, but {name} has none; to give times, write rate_hz"
            )
        frames = after_zeros(frames, layout.zeros_before_s)
    turned = was if full is None else full
    return SourceView(same.in_memory(frames, timed=not untimed, turned=turned))


def _array(source: SourceView, layout: Layout) -> Array:
    """Return the sensor of a recording as its layout says, which may not contradict the file."""
    facts = source.facts
    stated = facts.array
    array = layout.array(stated.rows * stated.columns, stated, facts.side)
    if facts.has_events and array.shape != stated.shape:
        raise ProblemError(
            f"the layout states {array.rows} x {array.columns} taxels; the events have {stated.rows} x {stated.columns}"
        )
    if min(stated.shape) > 1 and array.shape != stated.shape:
        raise ProblemError(
            f"the layout states {array.rows} x {array.columns} taxels; the file states {stated.rows} x {stated.columns}"
        )
    if not array._is_measured:
        with_names = (
            stated if array.shape == stated.shape else replace(array, pitch_mm=stated.pitch_mm, name=stated.name)
        )
        return with_names if stated.places is None or array.shape == stated.shape else array
    if stated._is_measured and (stated.pitch_mm, stated.places) != (array.pitch_mm, array.places):
        raise ProblemError(f"the layout states taxels {array._apart()}; the file states {stated._apart()}")
    return array


#: Kinds of files that state their sensor, unit, times, and whether readings were inverted, as far as these are known.
_STATING = ("mcap", "npz", "h5")


def _read(table: Frames, layout: Layout, full: float | None, name: str, *, strict: bool) -> Frames:
    """Return frames in the unit and at the rate that a layout says, turned to `full` less the reading if it is given.

    If it is not `strict`, the unit and the times of the file stay where it has them.
    """
    unit, t, values = table.unit, table.t, table.values
    if layout.unit is not None:
        if unit in _UNSAID:
            unit = layout.unit
        elif strict and unit != layout.unit:
            raise FormatError(f"{layout.path}: states the unit {layout.unit}, but {name} is in {unit}")
    if layout.rate_hz is not None:
        if np.array_equal(t, np.arange(len(t))):
            try:
                t = times_at(t, layout.rate_hz)
            except ProblemError as error:
                raise FormatError(f"{layout.path}: {name}: {error}") from None
        elif strict and len(t) > 1 and abs(layout.rate_hz * (step := float(np.median(np.diff(t)))) / 1e6 - 1) > _SLACK:
            raise FormatError(
                f"{layout.path}: states {layout.rate_hz:g} Hz, but the times of {name} give {1e6 / step:g} Hz"
            )
    if full is not None:
        with np.errstate(over="ignore"):
            risen = np.float32(full) - values
        if (large := np.isinf(risen)).any():
            raise FormatError(
                f"{layout.path}: falls is {layout.falls}, but {name} contains {shown(values[large][0].item())}, and "
                "the difference does not fit 32 bits"
            )
        values = frozen(risen)
    return Frames(values, t, unit=unit, array=table.array)


#: The share by which a rate that a layout says may differ from that of a file's own times.
_SLACK = 0.05
