"""What lines of a live source are, by the first of them and what is stated: columns, time, lines of a frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.formats.column_names import time_unit
from taxel.formats.layout import PrintedFrames
from taxel.formats.line_fits import FITS, fits_in
from taxel.formats.lines import MISSING, LineShape
from taxel.formats.table_columns import Draft, said_of, taxels_of, time_of
from taxel.formats.table_form import draft_of, lines_between_blanks
from taxel.formats.times import ISO, UNITS_US


@dataclass(frozen=True)
class LineForm:
    """Hold how lines that are read as they arrive make frames, or rows of numbers.

    Parameters
    ----------
    shape : LineShape
    columns : tuple of str
        The names of all columns; "" for one without a name.
    clocks : tuple of (int, float)
        The columns whose sum is the time, each with its unit, us; none: the time of arrival.
    taxels : tuple of int
        The columns with values.
    lines : int
        Number of lines of a frame, 0 if only an empty line shows it.
    ends_blank : bool
        Whether an empty line ends a frame.
    keys : dict
        What was understood beyond what is stated, as keys of a source.
    said : tuple of str
        The same for people, with what was left out and why, a text each.
    """

    shape: LineShape
    columns: tuple[str, ...]
    clocks: tuple[tuple[int, float], ...]
    taxels: tuple[int, ...]
    lines: int
    ends_blank: bool
    keys: Mapping[str, str]
    said: tuple[str, ...]


def form_of_lines(
    lines: Sequence[str],
    stated: PrintedFrames,
    size: int | None,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    *,
    are_frames: bool = True,
) -> LineForm | None:
    """Return how lines of a live source are read: as is stated, and else as the first ones look; None if none is read.

    Parameters
    ----------
    lines : sequence of str
        The first ones.
    stated : PrintedFrames
    size : int, optional
        Number of taxels, if it is stated: then all columns of that number are taxels.
    unit_of : callable
        Returns the unit of a column of times (and the lines that these are of) by the arrival of lines; "" if it does
        not show.
    are_frames : bool
        Whether columns are taxels; else they are quantities, each with a name.

    Raises
    ------
    ProblemError : columns that are not there, or lines that can be read in two ways
    """
    draft = _reading_of_lines(lines, stated, size)
    if draft is None:
        return None
    fit = draft.fit
    places = {name: k for k, name in reversed([*enumerate(draft.names)]) if name}
    left = {_place("leave_out", column, places, fit.count) for column in stated.leave_out}
    clocks = _stated_clocks(draft, stated.time, places, unit_of)
    keys, per_frame = dict[str, str](), stated.frame_lines or 1
    ends_blank = stated.frame_end is not None
    of_line = None if size is None else size // per_frame
    is_whole = fit.count - len(left | {k for k, _ in clocks}) == of_line and not any(map(time_unit, draft.names))
    if (
        not ends_blank
        and stated.frame_lines is None
        and not is_whole
        and (group := lines_between_blanks(fit, lines, from_begin=False)) > 1
    ):
        per_frame, ends_blank, keys["frame_end"] = group, True, "blank"
        draft.said.append(f"{group} lines per frame, between empty lines")
    elif ends_blank:
        per_frame = 0
    if not clocks and not is_whole:
        time = time_of(draft, is_stated=not are_frames)
        if time is not None and time not in left:
            clocks = _found_clock(draft, time, unit_of, keys, is_sure=not are_frames)
    at = {k for k, _ in clocks}
    if is_whole or stated.leave_out or stated.columns or not are_frames:
        draft.asked.clear()
        draft.left.update((k, "texts") for k, kind in enumerate(fit.types[: len(draft.names)]) if kind == "text")
        taxels = [k for k in range(len(draft.names)) if k not in {*left, *at, *draft.left}]
    else:
        taxels = [k for k in taxels_of(draft, next(iter(at), None)) if k not in left]
    if not taxels:
        raise ProblemError("lines have no column of values, only times and columns that are left out")
    if draft.asked:
        raise ProblemError(f"{draft.asked[0][0]}: state what it is by time=COLUMN:UNIT, leave_out= or frame_lines=")
    gone = sorted(set(draft.left) - left - at - set(taxels))
    if gone and are_frames:
        keys["leave_out"] = ":".join([*map(str, stated.leave_out), *(str(k + 1) for k in gone)])
    dated = frozenset(k for k in at if fit.types[k] == "time")
    numeric = frozenset((*taxels, *(at - dated)))
    own = draft.fit.lines[draft.fit.body[0]][1].names if fit.kind in ("marked", "json") else ()
    clock = next(iter(at - dated), None)
    names = own if any(own) else ()
    shape = LineShape(fit.count, numeric, dated, fit.kind, fit.separator, fit.decimal, clock, frozenset(MISSING), names)
    said = tuple(said_of(draft, next(iter(at), None)))
    return LineForm(shape, draft.names, clocks, tuple(taxels), per_frame, ends_blank, keys, said)


def _reading_of_lines(lines: Sequence[str], stated: PrintedFrames, size: int | None) -> Draft | None:
    """Return lines as the form reads them that fits best, with the stated names of columns; None if none fits."""
    wanted = stated_count(stated, size)
    found, _ = fits_in(lines, lambda: lines, wanted)
    fits = sorted(found, key=lambda fit: (wanted is not None and fit.count != wanted, -fit.score))
    if not fits or fits[0].purity < FITS * (not stated.leave_out):
        return None
    draft = draft_of(fits[0], lines)
    if stated.columns:
        if len(stated.columns) != len(draft.names):
            here = f"lines have {counted(len(draft.names), 'column')}"
            raise ProblemError(f"columns={':'.join(map(str, stated.columns))}: {here}; must be as many")
        draft.names = tuple(map(str, stated.columns))
    draft.asked.clear()
    return draft


def stated_count(stated: PrintedFrames, size: int | None) -> int | None:
    """Return how many columns lines have, if what is stated of them says it."""
    if stated.columns:
        return len(stated.columns)
    if size is None or stated.frame_end is not None:
        return None
    clocks = 0 if stated.time is None else 2 if "+" in stated.time else 1
    return size // (stated.frame_lines or 1) + clocks + len(stated.leave_out)


def _place(key: str, column: str | int, places: Mapping[str, int], count: int) -> int:
    """Return the place of a column that is stated by its name, or its number from 1."""
    if column in places:
        return places[str(column)]
    if not str(column).isdecimal():
        names = f"; the columns are {', '.join(places)}" * bool(places)
        raise ProblemError(f"{key}={column}: this column is missing{names}")
    if not 1 <= int(column) <= count:
        raise ProblemError(f"{key}={column}: lines have {counted(count, 'column')}")
    return int(column) - 1


def _stated_clocks(
    draft: Draft,
    time: str | None,
    places: Mapping[str, int],
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
) -> tuple[tuple[int, float], ...]:
    """Return the columns of the time that is stated, with their units, us; without a unit it is found."""
    fit = draft.fit
    if time is None:
        return ()
    if "+" in time:
        seconds, nanoseconds = (_place("time", column, places, fit.count) for column in time.split("+", 1))
        return ((seconds, UNITS_US["s"]), (nanoseconds, UNITS_US["ns"]))
    column, _, unit = time.partition(":")
    place = _place("time", column, places, fit.count)
    if unit == ISO or (not unit and fit.types[place] == "time"):
        return ((place, UNITS_US["s"]),)
    if not unit:
        unit = time_unit(draft.names[place]) or unit_of(fit.numbers(place), [fit.lines[k][0] for k in fit.body])
    if unit not in UNITS_US:
        known = ", ".join((*UNITS_US, ISO))
        raise ProblemError(f"time={time}: the unit must be one of {known}, for example time={column}:ms")
    return ((place, UNITS_US[unit]),)


def _found_clock(
    draft: Draft,
    time: int,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    keys: dict[str, str],
    *,
    is_sure: bool,
) -> tuple[tuple[int, float], ...]:
    """Return the column of times that was found, with its unit, us: by its name, by arrival, or as it looks."""
    fit, unit = draft.fit, draft.table.time_unit
    if unit != ISO and not time_unit(draft.names[time]):
        by_arrival = unit_of(fit.numbers(time), [fit.lines[k][0] for k in fit.body])
        if by_arrival or is_sure:
            unit = by_arrival or unit
            draft.asked = [each for each in draft.asked if not each[0].startswith("the unit of the time")]
    draft.set(time_unit=unit)
    keys["time"] = f"{draft.called(time)}:{unit}"
    return ((time, UNITS_US["s" if unit == ISO else unit]),)
