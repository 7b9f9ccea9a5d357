"""What lines of a live source are, by the first of them and what is stated: columns, time, lines of a frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel._core import ProblemError
from taxel.formats.column_names import time_unit
from taxel.formats.form import Form, places_of
from taxel.formats.layout import PrintedFrames
from taxel.formats.line_fits import FITS, fits_in
from taxel.formats.parts import sensors_in
from taxel.formats.table_columns import Draft, ask_for_lines_of_one_time, by_key, find_taxels, said_of, time_of
from taxel.formats.table_form import draft_of, find_blanks
from taxel.formats.times import ISO


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
    FormatError : another number of columns than is stated
    """
    if (begin := stated.frame_begin) is not None:
        lines = ["" if line.lstrip().startswith(begin) else line for line in lines]
    draft = _reading_of_lines(lines, stated, size)
    if draft is None:
        return None
    fit, names = draft.fit, draft.names
    left = {*draft.stated_left, *(places_of(names, "by", stated.by) if stated.by else ())}
    times = places_of(names, "time", draft.table.time_column) if draft.table.time_column else ()
    of_line = None if size is None or begin is not None else size // (stated.frame_lines or 1)
    is_whole = fit.count - len({*left, *times}) == of_line and not any(map(time_unit, names))
    if not (is_whole or draft.is_stated("frame_lines", "frame_end", "frame_begin")):
        find_blanks(draft, lines)
    time = None if not times and (is_whole or stated.time) else time_of(draft, by_name=not are_taxels)
    if time is not None:
        is_found, times = not times, places_of(names, "time", draft.table.time_column or 0)
        is_text = fit.types[time] == "time"
        if is_text or (len(times) == 1 and not draft.is_stated("time_unit")):
            at = [fit.lines[k][0] for k in fit.body]
            unit = ISO if is_text else time_unit(names[time]) or unit_of(fit.numbers(time), at)
            draft.set(time_unit=unit or draft.table.time_unit)
            if unit or not are_taxels:
                draft.answer("time_unit")
        if is_found:
            ask_for_lines_of_one_time(draft, time)
    if is_whole or stated.leave_out or stated.columns or not are_taxels:
        draft.questions.clear()
        draft.be("no taxel", "texts", *(k for k in range(len(names)) if fit.types[k] == "text"))
        draft.be("no taxel", "stated", *left)
        draft.be("sensor", "stated", *(left - draft.stated_left))
    else:
        find_taxels(draft)
        by_key(draft, time, lambda: lines)
    if not draft.taxels:
        raise ProblemError("lines have no column of values, only times and columns that are left out")
    unclear = [question.why for question in draft.questions]
    if draft.table.taxel_column is not None:
        unclear.append(f"column {draft.table.taxel_column} names the taxel of each line")
    if unclear:
        raise ProblemError(f"{unclear[0]}: state what it is by time=COLUMN:UNIT, leave_out= or frame_lines=")
    draft.set(leave_out=[k + 1 for k, role in enumerate(draft.roles) if role.is_left and role.role != "sensor"])
    draft.set(label_column=None)
    return draft.form(tuple(said_of(draft, time)))


def _reading_of_lines(lines: Sequence[str], stated: PrintedFrames, size: int | None) -> Draft | None:
    """Return lines as the form reads them that fits best, with the stated names of columns; None if none fits."""
    if several := sensors_in(lines):
        right = "they are split where they come before it is stated what they are: state less of them"
        raise ProblemError(f"lines are of {', '.join(several)} in turn: {right}")
    wanted = stated_count(stated, size)
    found, _ = fits_in(lines, lambda: lines, wanted)
    fits = sorted(found, key=lambda fit: (wanted is not None and fit.count != wanted, -fit.score))
    if not fits or fits[0].purity < FITS * (not stated.leave_out):
        return None
    draft = draft_of(fits[0], lines, stated.layout)
    empty = range(len(draft.names), draft.fit.count)
    names, units = ((*each, *[""] * len(empty)) for each in (draft.names, draft.units))
    draft = replace(draft, names=names, units=units, questions=[])
    draft.be("no taxel", "empty", *empty)
    return draft


def stated_count(stated: PrintedFrames, size: int | None) -> int | None:
    """Return how many columns lines have, if what is stated of them says it."""
    if stated.columns:
        return len(stated.columns)
    if size is None or stated.frame_end is not None or stated.frame_begin is not None:
        return None
    clocks = 0 if stated.time in (None, "0") else 2 if "+" in (stated.time or "") else 1
    return size // (stated.frame_lines or 1) + clocks + len(stated.leave_out) + (stated.by is not None)
