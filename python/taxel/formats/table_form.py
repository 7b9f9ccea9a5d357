"""The form of a table: how its lines are read, and what each column is, by its first lines and what a layout says.

Where two readings fit about equally, or nothing says when a line was, both layouts are printed and none is taken.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from taxel._base.arguments import shown
from taxel._base.errors import unreadable
from taxel._base.limits import COLUMNS
from taxel._base.messages import counted
from taxel._base.table_text import Text
from taxel.formats import column_names
from taxel.formats.layout import Layout, Table
from taxel.formats.layout_text import refuse_to_choose
from taxel.formats.line_fits import FITS, Fit, fits_in, fits_of
from taxel.formats.lines import MISSING, LineShape, is_number, read_line
from taxel.formats.table_columns import (
    Changes,
    Draft,
    are_events,
    ask_for_events,
    ask_for_unit_of_events,
    said_of,
    taxels_of,
    time_of,
)
from taxel.formats.times import FEW_ODD, ISO, ODD

#: Two readings fit about equally if one fits this share of the other.
_EQUALLY = 0.999
#: A line above a frame: a word and the frame's number, or its time, or both.
_ABOVE_FRAME = re.compile(
    r"\s*(?P<word>[^\W\d_]+)[ \t:=#.]*\d+(?:[.,]\d+)?[ \t]*(?P<unit>[mun]?s)?"
    r"(?:[ \t,;:@(\[]+(?:t|time)?[ \t=:]*(?P<time>\d+(?:[.,]\d+)?)[ \t]*(?P<time_unit>[mun]?s)?[)\]]?)?[ \t,;]*",
    re.IGNORECASE,
)
_PLACE_IN_LIST = re.compile(r"\[\d+\]")


class Columns(NamedTuple):
    """Say which column is what, by its place."""

    time: int | None
    label: int | None
    by: int | None
    taxels: tuple[int, ...]


@dataclass(frozen=True)
class Form:
    """Hold how a table is read.

    Parameters
    ----------
    path : Path
        The table, for errors.
    layout : Layout
        Complete.
    names : tuple of str
        Of all columns; "" for one without a name.
    is_named : bool
        Whether the lines of the table have these names.
    first : int
        The number of the first line of numbers, from 0.
    said : tuple of str
        What was understood beyond the given layout, a text each.
    """

    path: Path
    layout: Layout
    names: tuple[str, ...]
    is_named: bool
    first: int
    said: tuple[str, ...] = ()

    @property
    def table(self) -> Table:
        """How the lines are read."""
        return self.layout.table or Table()

    def called(self, column: int) -> str:
        """Return the name of a column, or its number if it has none."""
        return self.names[column] or f"column {column + 1}"

    @cached_property
    def columns(self) -> Columns:
        """Which column is what, by the layout.

        Raises
        ------
        FormatError : columns that differ from the layout, or a column of times that it does not name
        """
        how, names, path = self.table, self.names, self.path
        time, label, by = (
            None if getattr(how, key) is None else self._place(key, getattr(how, key))
            for key in ("time_column", "label_column", "by")
        )
        left = {self._place("leave_out", column) for column in how.leave_out}
        if time in left:
            raise unreadable(f"column {shown(names[time or 0])} is the time_column, but is also in leave_out", path)
        kept = [k for k in range(len(names)) if k not in {*left, time, label, by}]
        kept = [k for k in kept if how.keep is None or fnmatchcase(names[k], how.keep)]
        if not kept:
            raise unreadable("the layout leaves no column that is a taxel", path)
        timed = next((k for k in kept if time is None and column_names.time_unit(names[k]) is not None), None)
        if timed is not None and (timed == 0 or len(names[timed]) > 1) and how.frame_time is None:
            raise unreadable(
                f"column {shown(names[timed])} contains times, as its name shows; write time_column, or leave_out, in "
                "[table] of the layout file",
                path,
                line=self.first,
            )
        return Columns(time, label, by, tuple(kept))

    def _place(self, key: str, column: str | int) -> int:
        """Return the place of a column of a name or number."""
        names = self.names
        if isinstance(column, int):
            if column > len(names):
                raise unreadable(f"{key} is {column}, but the table has {counted(len(names), 'column')}", self.path)
            return column - 1
        if names.count(column) != 1:
            problem = "is missing" if column not in names else "appears twice; name it by its number"
            there = ", ".join(name or str(k) for k, name in enumerate(names[:20], 1)) + ", ..." * (len(names) > 20)
            raise unreadable(f"column {shown(column)} of {key} {problem}; the columns are {there}", self.path)
        return names.index(column)

    @property
    def shape(self) -> LineShape:
        """What the cells of a line are."""
        how, columns = self.table, self.columns
        is_text = how.time_unit == ISO and columns.time is not None
        numbers = {*columns.taxels, *([] if columns.time is None or is_text else [columns.time])}
        has_own_names = how.lines in ("marked", "json") and self.is_named and not how.columns
        return LineShape(
            len(self.names),
            frozenset(numbers),
            frozenset([columns.time] if columns.time is not None and is_text else []),
            how.lines,
            how.separator,
            how.decimal,
            None if is_text else columns.time,
            frozenset((*MISSING, *([] if how.missing is None else [how.missing]))),
            self.names if has_own_names else (),
        )


def form_of(text: Text, layout: Layout, label_column: str | int | None = None) -> Form:
    """Return how a table is read: as its layout says, or, if it says nothing of the table, as its first lines look.

    Parameters
    ----------
    text : Text
    layout : Layout
    label_column : str or int, optional
        As of `taxel.formats.layout.Table`.

    Raises
    ------
    FormatError : no table of numbers, one that the layout does not fit, or two readings that fit about equally (prints
        the layout of each)
    """
    if layout.table is not None:
        how = layout.table if label_column is None else replace(layout.table, label_column=label_column)
        return _stated(text, replace(layout, table=how), how)
    lines = text.head
    if text.path.suffix.lower() == ".json" and not any(read_line(line, "json") for line in lines[:3]):
        raise unreadable("is one document of JSON; save a line of JSON per frame, or a .csv", text.path)
    begin, time_of_begin = _begin_of_frames(lines)
    is_begin = [bool(begin) and line.lstrip().startswith(begin) for line in lines]
    shown = ["" if above else line for line, above in zip(lines, is_begin, strict=True)]
    size = (layout.rows or 0) * (layout.columns or 0)
    found, may_be_hex = fits_in(shown, text.lines)
    fits = [fit for fit in found if fit.purity >= FITS]
    fits.sort(key=lambda fit: (-fit.score, bool(size) and fit.count != size))
    if not fits:
        why = "contains no table of numbers; if it has one, describe it in [table] of a layout file (docs/files.md)"
        raise unreadable(why, text.path)
    _refuse_lines_above(text, fits[0])
    draft = draft_of(fits[0], shown)
    other = next((fit for fit in fits[1:] if _fits_as_well(fit, fits[0], size)), None)
    if other is not None:
        draft = _decided(draft, draft_of(other, shown))
    fit = draft.fit
    if may_be_hex:
        draft.asked.append(
            ("decimal or hexadecimal numbers", {"decimal numbers": {}, "hexadecimal numbers": {"lines": "hex"}})
        )
    _frames(draft, lines, is_begin, begin, time_of_begin)
    stated = layout.rows is not None or layout.rate_hz is not None or layout.path != text.path
    draft.set(label_column=label_column)
    time = time_of(draft, is_stated=stated)
    if time is None and draft.table.frame_time is None and not stated:
        _without_times(draft, text)
    taxels = taxels_of(draft, time)
    if not taxels:
        raise unreadable("contains no column of readings", text.path)
    draft.set(leave_out=[draft.called(k) for k in sorted(draft.left)])
    if are_events(draft, taxels):
        draft.set(events=True)
        ask_for_unit_of_events(draft, time)
        full = replace(layout, table=draft.table)
    else:
        ask_for_events(draft)
        full = _with_size(replace(layout, table=draft.table), draft, taxels)
    if draft.asked and not (stated and draft.asked[0][0].startswith("the first line")):
        _refuse(text, full, draft)
    return Form(text.path, full, draft.names, any(draft.names), fit.first, (*said_of(draft, time), *draft.said))


def _refuse_lines_above(text: Text, fit: Fit) -> None:
    """Refuse a table above which are many lines of numbers in another number of columns."""
    rows = [line.cells for _, line in fit.lines[: fit.body[0]]]
    odd = sum(len(cells) > 1 and 2 * sum(is_number(cell, fit.decimal) for cell in cells) > len(cells) for cells in rows)
    if odd > max(FEW_ODD, ODD * len(fit.body)):
        why = f"{odd} lines above have numbers in another number of columns than the {len(fit.body)} from here on"
        raise unreadable(why, text.path, line=fit.first + 1)


def _stated(text: Text, layout: Layout, how: Table) -> Form:
    """Return the names of the columns of a table that a layout describes, and its first line of numbers."""
    shown = ["" if k < how.skip_lines or how.is_between(line) else line for k, line in enumerate(text.head)]
    missing = () if how.missing is None else (how.missing,)
    fit = next(fits_of(shown, [(how.lines, how.separator, how.decimal)], missing), None)
    line = how.skip_lines + 1
    if fit is None:
        why = f"no line of numbers between separators {how.separator!r}; write what is right in [table] of the layout"
        raise unreadable(why, text.path, line=line if any(shown) else None)
    draft = draft_of(fit, shown)
    names = tuple(how.columns) or draft.names
    if fit.count > COLUMNS:
        raise unreadable(f"{fit.count} columns; must have at most {COLUMNS}", text.path, line=line)
    if how.columns and not len(draft.names) <= len(names) <= fit.count:
        wrong = f"{counted(len(names), 'name')} for {counted(len(draft.names), 'column')}"
        raise unreadable(wrong, text.path, line=line)
    return Form(text.path, layout, names, any(names), fit.first)


def _fits_as_well(other: Fit, fit: Fit, size: int) -> bool:
    """Return whether another form fits about equally, in another number of columns."""
    fits = other.purity >= _EQUALLY * fit.purity and len(other.body) >= len(fit.body)
    return fits and other.count != fit.count != size and other.kind == fit.kind == "plain"


def _decided(draft: Draft, other: Draft) -> Draft:
    """Return the one of two drafts that the names above the numbers say; ask if they say none."""
    if all(draft.names):
        return draft
    if any(other.names):
        return other
    first, second = (counted(each.fit.count, "column") for each in (draft, other))
    keys = ("separator", "decimal", "skip_lines", "lines")
    changes = {key: getattr(other.table, key) for key in keys} | {"time_column": None, "leave_out": []}
    draft.asked.append((f"{first} or {second}", {first: {}, second: changes}))
    return draft


def draft_of(fit: Fit, lines: Sequence[str]) -> Draft:
    """Return the names above a table, and how its lines are read."""
    above = [(k, list(line.cells)) for k, line in fit.lines[: fit.body[0]]]
    table = Table(separator=fit.separator, decimal=fit.decimal, lines=fit.kind, skip_lines=fit.first)
    if fit.kind != "plain":
        table = replace(table, separator=fit.separator if fit.kind == "hex" else ",")
        own = fit.lines[fit.body[0]][1].names
        # The places in a list are no names.
        own = () if all(map(_PLACE_IN_LIST.fullmatch, own)) else own
        names = own if any(own) else _names_above_marks(fit, lines)
        if not any(own) and any(names):
            table = replace(table, columns=list(names))
        return Draft(fit, table, names, ("",) * fit.count)
    real = fit.count
    while real > 1 and fit.types[real - 1] == "empty":
        real -= 1
    head = [
        (
            k,
            tuple(
                cell.strip("\"'# " if not n else "\"'") for n, cell in enumerate([*cells, *[""] * real][: fit.count])
            ),
        )
        for k, cells in above[-3:]
        if _width(cells) == real or len(cells) == fit.count
    ]
    unnamed = Draft(fit, table, ("",) * real, ("",) * real)
    if not head or head[-1][0] < above[-1][0]:
        return _numbered(unnamed)
    has_units = len(head) > 1 and column_names.are_units(head[-2][1], head[-1][1]) and head[-1][0] > head[-2][0]
    units = head[-1][1] if has_units else ()
    at_names, names = head[-2 if has_units else -1]
    upper = head[-3 if has_units else -2][1] if len(head) > 1 + has_units else ()
    if all(not name or is_number(name, fit.decimal) for name in names):
        return _numbered(unnamed)
    names = names[: max(real, _width(names))]
    named = [name for name in names if name]
    if len(set(named)) < len(named) and any(upper):
        names = tuple(f"{a} {b}".strip() for a, b in zip(upper, names, strict=False))
        return Draft(fit, replace(table, columns=list(names)), names, tuple(map(column_names.unit_of, names)))
    stripped = tuple(unit.strip("[]()") for unit in units[: len(names)]) or tuple(map(column_names.unit_of, names))
    return Draft(fit, replace(table, skip_lines=at_names), names, stripped)


def _numbered(draft: Draft) -> Draft:
    """Return a table without names; whether a first line that numbers the columns is a frame is asked."""
    fit = draft.fit
    first = [float(cell) for cell in fit.lines[fit.body[0]][1].cells if is_number(cell)]
    counts = len(first) == fit.count >= 4 and bool(np.all(np.diff(first) == 1)) and first[0] in (0.0, 1.0)
    if counts and len(fit.body) > 1:
        below = {"skip_lines": fit.lines[fit.body[1]][0]}
        draft.asked.append(("the first line is 1, 2, 3 ...", {"a frame": {}, "numbers of columns": below}))
    return draft


def _names_above_marks(fit: Fit, lines: Sequence[str]) -> tuple[str, ...]:
    """Return names for cells with marks between them; a name may be above several: t,p above 0.1,"[1, 2]"."""
    above = next((lines[k] for k in reversed(range(fit.first)) if lines[k].strip()), "")
    for separator in sorted(";\t,", key=above.count, reverse=True):
        names, groups = read_line(above, "plain", separator), read_line(lines[fit.first], "plain", separator)
        if names is None or groups is None or not above or len(names.cells) != len(groups.cells):
            continue
        inner = [read_line(cell, "marked", ",", fit.decimal) for cell in groups.cells]
        sizes = [0 if line is None else len(line.cells) for line in inner]
        if sum(sizes) == fit.count and not any(is_number(name) for name in names.cells):
            pairs = zip(names.cells, sizes, strict=True)
            return tuple(f"{name}[{k}]" if size > 1 else name for name, size in pairs for k in range(size))
    return ("",) * fit.count


def _width(cells: Sequence[str]) -> int:
    return max((k for k, cell in enumerate(cells, 1) if cell), default=0)


def _begin_of_frames(lines: Sequence[str]) -> tuple[str, str | None]:
    """Return the word that begins a line above every few lines, and the unit of the time in it, None without one."""
    found: dict[str, list[tuple[int, re.Match[str]]]] = {}
    for k, line in enumerate(line for line in lines if line.strip(" \t,;")):
        if above := _ABOVE_FRAME.fullmatch(line):
            found.setdefault(above["word"], []).append((k, above))
    for word, places in found.items():
        steps = np.diff([k for k, _ in places])
        if len(steps) and steps[0] > 1 and Counter(steps.tolist()).most_common(1)[0][1] > 0.5 * len(steps):
            units = {above["time_unit"] or (above["unit"] if above["time"] is None else None) for _, above in places}
            unit = units.pop() if len(units) == 1 else None
            return word, None if unit is None else unit.lower()
    return "", None


def lines_between_blanks(fit: Fit, lines: Sequence[str], *, from_begin: bool) -> int:
    """Return how many lines of numbers are between two empty lines each, 0 if that differs or none are.

    What is behind the last may be a part, and so may what is before the first, unless lines are all `from_begin`.
    """
    empty = np.cumsum([not line.strip(" \t\r,;") for line in lines])
    before = empty[[fit.lines[k][0] for k in fit.body]]
    ends = np.flatnonzero(np.diff(before)) + 1
    sizes = set(np.diff([0, *ends] if from_begin else ends).tolist())
    return sizes.pop() if len(ends) > 1 and len(sizes) == 1 else 0


def _frames(draft: Draft, lines: Sequence[str], is_begin: Sequence[bool], begin: str, time: str | None) -> None:
    """Say how many lines a frame has: those between lines of text, or between empty lines."""
    if begin:
        draft.set(frame_begin=begin, frame_time=time, skip_lines=min(is_begin.index(True), draft.fit.first))
        draft.said.append(f"frames begin at lines {begin!r}")
    elif (size := lines_between_blanks(draft.fit, lines, from_begin=True)) > 1:
        draft.set(frame_end="blank")
        draft.said.append(f"{size} lines per frame, between empty lines")


def _without_times(draft: Draft, text: Text) -> None:
    """Ask what lines without times are: frames one after the other, or the rows of one frame."""
    fit = draft.fit
    odd = len(fit.lines) - len(fit.body)
    count = sum(1 for line in text.lines() if line.strip(" \t\r,;")) - odd
    if draft.table.has_lines or count < 2:
        draft.asked.append(("it has no times", {"frames without times": {}}))
        return
    together = {f"rows of one frame: frame_lines = {count}": {"frame_lines": count, "frame_end": None}}
    draft.asked.append((f"{counted(count, 'line')}, no times", {"a frame per line, without times": {}, **together}))


def _with_size(layout: Layout, draft: Draft, taxels: Sequence[int]) -> Layout:
    """Return the layout with its unit, its axes (which are asked), and rows and columns that the names state."""
    unit = next((draft.units[k] for k in taxels if draft.units[k]), "")
    full = replace(layout, unit=layout.unit or unit or None)
    names = [draft.names[k] for k in taxels]
    if any(names) and column_names.axes_of(names) is not None:
        if layout.axis is None:
            choices: dict[str, Changes] = {
                'axis = "z"; or "x", "y"': {"axis": "z"},
                'axis = "all": each axis a source': {"axis": "all"},
                'axis = "shear": the length of x and y': {"axis": "shear"},
            }
            draft.asked.append(("taxels with the axes x, y and z", choices))
        return full
    places = column_names.places_of(names) if any(names) and not layout.rows else None
    if places is not None and min(places) > 1:
        full = replace(full, rows=places[0], columns=places[1])
    # Lines that are parts of a frame whose size is known; a line with a time of its own is a frame.
    size, is_part = (layout.rows or 0) * (layout.columns or 0), draft.table.time_column is None
    if is_part and size > len(taxels) and size % len(taxels) == 0 and not draft.table.has_lines:
        full = replace(full, table=replace(draft.table, frame_lines=size // len(taxels)))
    return full


def _refuse(text: Text, layout: Layout, draft: Draft) -> NoReturn:
    """Refuse a table that can be read in two ways, with the layout of each."""
    why, choices = draft.asked[0]
    also = "".join(f"; also open: {other}" for other, _ in draft.asked[1:])
    unread = [draft.names[k] for k, why in draft.left.items() if why.startswith("times in")]
    also += "".join(f"; {name} has times in a form that taxel does not read" for name in unread)
    ways = f"can be read in {len(choices)} ways ({why})" if len(choices) > 1 else why
    refuse_to_choose(text.path, f"{ways}{also}", {name: _changed(layout, each) for name, each in choices.items()})


def _changed(layout: Layout, changes: Changes) -> Layout:
    """Return a layout with other keys, of its own or of its table."""
    table = layout.table or Table()
    known = {each.name for each in fields(Table)}
    left = [column for column in table.leave_out if column not in changes.get("read", ())]
    of_table = {"leave_out": [*left, *changes.get("left", ())], **{k: v for k, v in changes.items() if k in known}}
    own = {key: value for key, value in changes.items() if key not in (*known, "left", "read")}
    return replace(layout, table=replace(table, **of_table), **own)
