"""What lines of a live source are, by the first of them and what is stated: columns, time, lines of a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.formats.column_names import time_unit
from taxel.formats.form import Form, place_of, places_of
from taxel.formats.layout import Layout, PrintedFrames
from taxel.formats.line_fits import FITS, fits_in
from taxel.formats.parts import sensors_in
from taxel.formats.roles import SURE
from taxel.formats.table_columns import Draft, ask_for_lines_of_one_time, by_key, find_taxels, said_of, time_of
from taxel.formats.table_form import draft_of, lines_between_blanks
from taxel.formats.times import ISO, UNITS_US


def form_of_lines(
    lines: Sequence[str],
    stated: PrintedFrames,
    size: int | None,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    *,
    are_taxels: bool = True,
) -> Form | None:
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
    are_taxels : bool
        Whether columns are taxels; else they are quantities, each with a name.

    Raises
    ------
    ProblemError : columns that are not there, or lines that can be read in two ways, or are of several sensors
    """
    draft = _reading_of_lines(lines, stated, size)
    if draft is None:
        return None
    fit, keys = draft.fit, dict[str, str]()
    # A last column may be empty throughout.
    names = (*draft.names, *[""] * (draft.fit.count - len(draft.names)))
    own = fit.lines[fit.body[0]][1].names if fit.kind in ("marked", "json") else ()
    left = {place_of(names, "leave_out", column) for column in stated.leave_out}
    times = () if stated.time is None else places_of(names, "time", stated.time.partition(":")[0])
    per_frame = 0 if stated.frame_end is not None else stated.frame_lines or 1
    of_line = None if size is None else size // (stated.frame_lines or 1)
    is_whole = fit.count - len({*left, *times}) == of_line and not any(map(time_unit, names))
    if (
        stated.frame_end is None
        and stated.frame_lines is None
        and not is_whole
        and (group := lines_between_blanks(fit, lines, from_begin=False)) > 1
    ):
        per_frame, keys["frame_end"] = group, "blank"
        draft.said.append(f"{group} lines per frame, between empty lines")
    draft.set(frame_lines=stated.frame_lines, frame_end=keys.get("frame_end", stated.frame_end))
    if times:
        draft.set(time_column=stated.time and stated.time.partition(":")[0])
        draft.be("time", "stated", *times, certainty=SURE)
        _set_unit(draft, times, stated.time, unit_of)
    elif not is_whole:
        time = time_of(draft, by_name=not are_taxels)
        if time is not None and time not in left:
            times = places_of(names, "time", draft.table.time_column or 0)
            ask_for_lines_of_one_time(draft, time)
            _set_unit(draft, times, None, unit_of, is_sure=not are_taxels)
            keys["time"] = f"{draft.table.time_column}:{draft.table.time_unit}".removesuffix(":s" * (len(times) > 1))
        else:
            draft.set(time_column=None)
    time = next(iter(times), None)
    if is_whole or stated.leave_out or stated.columns or not are_taxels:
        draft.questions.clear()
        draft.be("no taxel", "texts", *(k for k in range(len(draft.names)) if fit.types[k] == "text"))
        taxels = [k for k in range(len(draft.names)) if k not in {*left, *times, *draft.left}]
    else:
        find_taxels(draft)
        by_key(draft, time, lambda: lines)
        taxels = draft.taxels
    if not taxels:
        raise ProblemError("lines have no column of values, only times and columns that are left out")
    unclear = [question.why for question in draft.questions]
    if draft.table.taxel_column is not None:
        unclear.append(f"column {draft.table.taxel_column} names the taxel of each line")
    if unclear:
        raise ProblemError(f"{unclear[0]}: state what it is by time=COLUMN:UNIT, leave_out= or frame_lines=")
    gone = sorted(set(draft.left) - left - {*times} - {*taxels})
    if gone and are_taxels:
        keys["leave_out"] = ":".join([*map(str, stated.leave_out), *(str(k + 1) for k in gone)])
    draft.set(leave_out=[k + 1 for k in range(len(names)) if k not in {*times, *taxels}], label_column=None)
    said = tuple(said_of(draft, time))
    return Form(draft.table, names, fit.first, said, own if any(own) else (), per_frame, keys)


def _reading_of_lines(lines: Sequence[str], stated: PrintedFrames, size: int | None) -> Draft | None:
    """Return lines as the form reads them that fits best, with the stated names of columns; None if none fits."""
    if several := sensors_in(lines):
        right = "a live source is of one; print each to a place of its own"
        raise ProblemError(f"lines are of {', '.join(several)} in turn: {right}")
    wanted = stated_count(stated, size)
    found, _ = fits_in(lines, lambda: lines, wanted)
    fits = sorted(found, key=lambda fit: (wanted is not None and fit.count != wanted, -fit.score))
    if not fits or fits[0].purity < FITS * (not stated.leave_out):
        return None
    draft = draft_of(fits[0], lines, Layout(Path(stated.place)))
    if stated.columns:
        if len(stated.columns) != len(draft.names):
            here = f"lines have {counted(len(draft.names), 'column')}"
            raise ProblemError(f"columns={':'.join(map(str, stated.columns))}: {here}; must be as many")
        draft = replace(draft, names=tuple(map(str, stated.columns)))
    draft.questions.clear()
    return draft


def stated_count(stated: PrintedFrames, size: int | None) -> int | None:
    """Return how many columns lines have, if what is stated of them says it."""
    if stated.columns:
        return len(stated.columns)
    if size is None or stated.frame_end is not None:
        return None
    clocks = 0 if stated.time is None else 2 if "+" in stated.time else 1
    return size // (stated.frame_lines or 1) + clocks + len(stated.leave_out)


def _set_unit(
    draft: Draft,
    times: Sequence[int],
    stated: str | None,
    unit_of: Callable[[NDArray[np.float64], Sequence[int]], str],
    *,
    is_sure: bool = False,
) -> None:
    """Set the unit of times: as it is stated, by the name of the column, by arrival, or, if not stated, as it looks."""
    fit, time, (column, _, unit) = draft.fit, times[0], (stated or "").partition(":")
    if len(times) > 1 or fit.types[time] == "time":
        draft.set(time_unit=draft.table.time_unit if stated is None else "s" if len(times) > 1 else ISO)
        return
    unit = unit or time_unit(draft.names[time]) or unit_of(fit.numbers(time), [fit.lines[k][0] for k in fit.body])
    if stated is not None and unit not in (*UNITS_US, ISO):
        known = ", ".join((*UNITS_US, ISO))
        raise ProblemError(f"time={stated}: the unit must be one of {known}, for example time={column}:ms")
    if unit or is_sure:
        draft.set(time_unit=unit or draft.table.time_unit)
        draft.answer("time_unit")
