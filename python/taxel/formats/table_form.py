"""The form of a table: how its lines are read, and what each column is, by its first lines and what a layout says.

Where two readings fit about equally, or nothing says when a line was, both layouts are printed and none is taken.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from taxel._base.errors import placed, unreadable
from taxel._base.limits import COLUMNS
from taxel._base.messages import counted, first_line
from taxel._base.table_text import Text
from taxel._core import FormatError, ProblemError
from taxel.formats import column_names
from taxel.formats.form import Form, places_of
from taxel.formats.layout import Layout, Table
from taxel.formats.line_fits import FITS, THOUSAND, Fit, fits_in
from taxel.formats.lines import OTHER, is_number, number_of, read_line
from taxel.formats.roles import OF_AXES, SURE, Changes, refuse_open
from taxel.formats.table_columns import (
    Draft,
    are_events,
    ask_for_lines_of_one_time,
    by_key,
    by_values,
    find_taxels,
    said_of,
    say_contradictions,
    time_of,
)
from taxel.formats.times import FEW_ODD, ODD, unit_of_times

#: Two readings fit about equally if one fits this share of the other.
_EQUALLY = 0.999
#: A line above a frame: a word and the frame's number, or its time, or both.
_ABOVE_FRAME = re.compile(
    r"\s*(?P<word>[^\W\d_]+)[ \t:=#.]*(?P<number>\d+(?:[.,]\d+)?)[ \t]*(?P<unit>[mun]?s)?"
    r"(?:[ \t,;:@(\[]+(?:t|time)?[ \t=:]*(?P<time>\d+(?:[.,]\d+)?)[ \t]*(?P<time_unit>[mun]?s)?[)\]]?)?[ \t,;]*",
    re.IGNORECASE,
)
_ONE_DOCUMENT = "is one document of JSON; save a line of JSON per frame, or a .csv"
#: An array as NumPy prints it that has more values than it prints.
_CUT = re.compile(r"\d\.?[\s,]+\.\.\.[\s,]+[-+.\d]")
_PLACE_IN_LIST = re.compile(r"\[\d+\]")
#: The mark of a comment before names.
_COMMENT = re.compile(r"(?:#+|(?:[%;!*]|//)+(?=\s|$))\s*")


def form_of(text: Text, layout: Layout) -> tuple[Form, Layout]:
    """Return how a table is read, as its layout says, or, if it says nothing of the table, as its first lines look.

    Parameters
    ----------
    text : Text
    layout : Layout

    Returns
    -------
    form : Form
    layout : Layout
        Complete.

    Raises
    ------
    FormatError : no table of numbers, one that the layout does not fit, or two readings that fit about equally (prints
        the layout of each)
    """
    try:
        form, full = _found(text, layout)
        if not form.taxels:
            raise unreadable("the layout leaves no column that is a taxel", text.path)
    except FormatError as error:
        raise placed(error, text.path) from None
    except ProblemError as error:
        raise unreadable(first_line(error), text.path) from None
    return form, full


def _found(text: Text, layout: Layout) -> tuple[Form, Layout]:
    """Return the form of a table as the layout states it, and else as it fits its lines best; and the whole layout."""
    lines, stated = text.head, layout.table or Table()
    if text.path.suffix.lower() == ".json" and not any(read_line(line, "json") for line in lines[:3]):
        raise unreadable(_ONE_DOCUMENT, text.path)
    begin, units = (
        (stated.frame_begin or "", [stated.frame_time or ""]) if stated.has_lines else _begin_of_frames(lines)
    )
    is_begin = [bool(begin) and line.lstrip().startswith(begin) for line in lines]
    above = is_begin.index(True) if any(is_begin) else 0
    is_above = [
        is_first or k < stated.skip_lines or (k < above and any(map(str.isdigit, line)))
        for k, (is_first, line) in enumerate(zip(is_begin, lines, strict=True))
    ]
    shown_lines = ["" if above else line for line, above in zip(lines, is_above, strict=True)]
    cut = next((k for k, line in enumerate(lines) if "..." in line and _CUT.search(line)), None)
    if cut is not None:
        right = "save them whole, as numpy.set_printoptions(threshold=sys.maxsize) prints them"
        raise unreadable(f"an array is cut by ..., and its values are lost; {right}", text.path, line=cut + 1)
    draft = _draft(text, layout, shown_lines)
    _frames(draft, shown_lines, is_begin, begin, [unit for unit in units if unit])
    time = time_of(draft)
    _ask_of_thousands(draft, time)
    # Lines of a live source arrive at a time.
    is_laid_out = any(each is not None for each in (layout.rows, layout.rate_hz, layout.source))
    if time is None and draft.table.frame_time is None and not is_laid_out:
        _without_times(draft, text)
    find_taxels(draft)
    if not draft.taxels:
        raise unreadable("contains no column of readings", text.path)
    by_key(draft, time, text.lines)
    if time is not None and draft.table.taxel_column is None:
        ask_for_lines_of_one_time(draft, time)
    are = are_events(draft, time)
    if not are and draft.table.taxel_column is None:
        by_values(draft, time, text)
        say_contradictions(draft, text)
    if not draft.is_stated("leave_out", "keep"):
        left = (k for k, role in enumerate(draft.roles) if role.is_left and role.certainty != SURE)
        of_taxel = places_of(draft.names, "", draft.table.taxel_column) if draft.table.taxel_column else ()
        draft.set(leave_out=[draft.called(k) for k in left if k not in of_taxel])
    full = replace(layout, table=draft.table)
    full = full if are else _with_size(full, draft)
    unread = [draft.called(k) for k, why in draft.left.items() if why.startswith("times in")]
    if unread and time is None and draft.table.frame_time is None:
        right = "write them as 2024-05-01T10:00:00.25, or state rate_hz and leave_out in a layout file"
        raise unreadable(f"column {unread[0]} has times in a form that taxel does not read; {right}", text.path)
    refuse_open(text.path, "can be read in", full, draft.roles, draft.questions)
    draft.table = full.table or draft.table
    return draft.form((*said_of(draft, time), *draft.said)), full


def _draft(text: Text, layout: Layout, lines: Sequence[str]) -> Draft:
    """Return how lines are cells and what they are called, as the layout states it or as fits best."""
    stated = layout.table or Table()
    size = (layout.rows or 0) * (layout.columns or 0)
    found, may_be_hex = fits_in(lines, text.lines, stated=layout)
    found = [fit for fit in found if text.typed is None or fit.separator == "\t"]
    is_stated = not layout.stated.isdisjoint(("separator", "lines", "skip_lines"))
    fits = [fit for fit in found if is_stated or fit.purity >= FITS]
    fits.sort(key=lambda fit: (-fit.score, bool(size) and fit.count != size))
    if not fits and is_stated:
        why = (
            f"no line of numbers between separators {stated.separator!r}; write what is right in [table] of the layout"
        )
        raise unreadable(why, text.path, line=stated.skip_lines + 1 if any(lines) else None)
    if not fits:
        why = "contains no table of numbers; if it has one, describe it in [table] of a layout file (docs/files.md)"
        raise unreadable(why, text.path)
    if fits[0].kind == "json" and len(fits[0].lines) == 1 and not is_stated:
        raise unreadable(_ONE_DOCUMENT, text.path)
    if not is_stated:
        _refuse_lines_above(text, fits[0])
    draft = draft_of(fits[0], lines, layout)
    other = next((fit for fit in fits[1:] if _fits_as_well(fit, fits[0], size)), None)
    if other is not None and not draft.is_stated("separator"):
        draft = _decided(draft, draft_of(other, lines, layout))
    if may_be_hex:
        kinds = {"decimal numbers": {"lines": "plain"}, "hexadecimal numbers": {"lines": "hex"}}
        draft.ask("decimal or hexadecimal numbers", "lines", kinds)
    if draft.fit.count > COLUMNS:
        why = f"{draft.fit.count} columns; must have at most {COLUMNS}"
        raise unreadable(why, text.path, line=stated.skip_lines + 1)
    return draft


def _refuse_lines_above(text: Text, fit: Fit) -> None:
    """Refuse a table above which are many lines of numbers in another number of columns."""
    rows = [line.cells for _, line in fit.lines[: fit.body[0]]]
    odd = sum(
        len(cells) > 1 and 2 * sum(is_number(cell, fit.decimal, fit.thousands) for cell in cells) > len(cells)
        for cells in rows
    )
    if odd > max(FEW_ODD, ODD * len(fit.body)):
        why = f"{odd} lines above have numbers in another number of columns than the {len(fit.body)} from here on"
        raise unreadable(why, text.path, line=fit.first + 1)


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
    keys = ("separator", "decimal", "thousands", "skip_lines", "lines")
    ways = {name: {key: getattr(each.table, key) for key in keys} for name, each in ((first, draft), (second, other))}
    # What was found of one reading is not left out of the other.
    ways[second] |= {"time_column": None, "leave_out": []}
    draft.ask(f"{first} or {second}", "separator", ways)
    return draft


def draft_of(fit: Fit, lines: Sequence[str], layout: Layout) -> Draft:
    """Return the names of a table, as they are stated or as they are above it, and how its lines are read.

    Raises
    ------
    FormatError : another number of names is stated
    """
    draft, stated = _called(fit, lines, layout), layout.table or Table()
    if stated.columns or draft.is_stated("skip_lines"):
        draft.set(skip_lines=stated.skip_lines)
    if not stated.columns:
        return draft
    names = tuple(map(str, stated.columns))
    if not len(draft.names) <= len(names) <= fit.count:
        here = f"{counted(len(names), 'name')} for {counted(len(draft.names), 'column')}"
        raise unreadable(here, line=stated.skip_lines + 1)
    return replace(draft, names=names, units=())


def _called(fit: Fit, lines: Sequence[str], layout: Layout) -> Draft:
    """Return the names above a table, and how its lines are read."""
    above = [(k, list(line.cells)) for k, line in fit.lines[: fit.body[0]] if not _is_rule(line.cells)]
    keys = {key: getattr(fit, key) for key in ("separator", "decimal", "thousands")}
    table = replace(layout.table or Table(), **keys, lines=fit.kind, skip_lines=fit.first)
    if fit.kind != "plain":
        table = replace(table, separator=fit.separator if fit.kind == "hex" else ",")
        # The places in a list are no names.
        own = () if all(map(_PLACE_IN_LIST.fullmatch, fit.own)) else fit.own
        names = own or _names_above_marks(fit, lines)
        if not own and any(names):
            table = replace(table, columns=list(names))
        return Draft(fit, table, names, (), layout)
    real = fit.count
    while real > 1 and fit.types[real - 1] == "empty":
        real -= 1
    head = [(k, row) for k, cells in above[-3:] if (row := _names_in(cells, fit.count, real))]
    unnamed = Draft(fit, table, ("",) * real, (), layout)
    if not head or head[-1][0] < above[-1][0]:
        return _numbered(unnamed)
    has_units = len(head) > 1 and column_names.are_units(head[-2][1], head[-1][1])
    units = head.pop()[1] if has_units else ()
    at_names, names = head[-1]
    if all(not name or is_number(name, fit.decimal) for name in names):
        return _numbered(unnamed)
    names = names[: max(real, _width(names))]
    named = [name for name in names if name]
    if len(set(named)) < len(named) and len(head) > 1 and any(head[-2][1]):
        names = tuple(_below(head[-2][1], names))
        return Draft(fit, replace(table, columns=list(names)), names, (), layout)
    stripped = tuple(unit.strip("[]()") for unit in units[: len(names)])
    return Draft(fit, replace(table, skip_lines=at_names), names, stripped, layout)


def _ask_of_thousands(draft: Draft, time: int | None) -> None:
    """Ask whether all numbers with a mark have thousands or three decimals, where nothing else in the table says it."""
    fit, mark, other = draft.fit, draft.fit.thousands or draft.fit.decimal, OTHER[draft.fit.decimal]
    columns = [[cell for cell in fit.cells(k) if is_number(cell, fit.decimal, fit.thousands)] for k in range(fit.count)]
    marked = [[cell for cell in column if mark in cell] for column in columns]
    if fit.kind != "plain" or not any(marked) or not all(THOUSAND.fullmatch(cell) for row in marked for cell in row):
        return
    # Numbers below a thousand have no mark, and those with decimals have one.
    have_both = any(
        with_mark and any(number_of(cell, ".", None) for cell in column if cell not in with_mark)
        for column, with_mark in zip(columns, marked, strict=True)
    )
    # Where commas are decimal, semicolons separate, and programs in English write commas.
    is_usual = fit.separator == ";" if mark == "," else fit.separator != ";"
    example = next(filter(None, marked))[0]
    if fit.thousands is not None and not have_both:
        choices = {f"thousands by {mark!r}": {"decimal": fit.decimal, "thousands": mark}}
        draft.ask(f"{example} may be a thousand", "decimal thousands", choices)
    elif fit.thousands is None and (have_both or not is_usual):
        changes = {"decimal": other, "thousands": mark}
        if time is not None and fit.types[time] == "number" and column_names.time_unit(draft.names[time]) == "":
            numbers = replace(fit, decimal=other, thousands=mark).numbers(time)
            changes["time_unit"] = unit_of_times(numbers)[0]
        why = f"{example} has decimals, or is a thousand"
        decimals = {"decimal": fit.decimal}
        choices = {f"decimals by {mark!r}": decimals, f"thousands by {mark!r}": changes}
        draft.ask(why, "decimal thousands", choices, first=True)


def _is_rule(cells: Sequence[str]) -> bool:
    """Return whether a line is drawn below the names."""
    return {*"".join(cells)} <= {*"-=_+|: "}


def _names_in(cells: Sequence[str], count: int, real: int) -> tuple[str, ...]:
    """Return the cells of a line above a table without quotes and the mark of a comment; none of another width."""
    first = _COMMENT.sub("", cells[0].strip("\"'"), count=1)
    cells = cells[1:] if not first and len(cells) == count + 1 else [first, *cells[1:]]
    if _width(cells) != real and len(cells) != count:
        return ()
    return tuple(cell.strip("\"'") for cell in [*cells, *[""] * real][:count])


def _below(upper: Sequence[str], names: Sequence[str]) -> Iterator[str]:
    """Yield names with those of a line above, of which one may be above several."""
    last = ""
    for above, name in zip(upper, names, strict=False):
        last = above or (last if name and column_names.time_unit(name) is None else "")
        yield f"{last} {name}".strip()


def _numbered(draft: Draft) -> Draft:
    """Return a table without names; whether a first line that numbers the columns is a frame is asked.

    Those of pandas are none: nothing is above the numbers of its lines.
    """
    fit = draft.fit
    cells = fit.lines[fit.body[0]][1].cells
    first = [float(cell) for cell in cells if is_number(cell)]
    counts = len(first) > 1 and bool(np.all(np.diff(first) == 1)) and first[0] in (0.0, 1.0)
    if not counts or len(fit.body) < 2:
        return draft
    below = fit.lines[fit.body[1]][0]
    if not cells[0] and len(first) == fit.count - 1 and fit.types[0] == "number":
        return replace(draft, fit=replace(fit, body=fit.body[1:]), table=replace(draft.table, skip_lines=below))
    if len(first) == fit.count >= 4:
        first_frame = fit.lines[fit.body[0]][0]
        choices = {"a frame": {"skip_lines": first_frame}, "numbers of columns": {"skip_lines": below}}
        draft.ask("the first line is 1, 2, 3 ...", "skip_lines rows", choices)
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
            units = [column_names.UNIT_BEHIND.search(cell) for cell in groups.cells]
            called = [
                name if unit is None else f"{name} [{unit[1]}]" for name, unit in zip(names.cells, units, strict=True)
            ]
            pairs = zip(called, sizes, strict=True)
            return tuple(f"{name}[{k}]" if size > 1 else name for name, size in pairs for k in range(size))
    return ("",) * fit.count


def _width(cells: Sequence[str]) -> int:
    return max((k for k, cell in enumerate(cells, 1) if cell), default=0)


def _begin_of_frames(lines: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the word that begins a line above every few lines, and the units in which the time in it may be."""
    found: dict[str, list[tuple[int, re.Match[str]]]] = {}
    for k, line in enumerate(line for line in lines if line.strip(" \t,;")):
        if above := _ABOVE_FRAME.fullmatch(line):
            found.setdefault(above["word"], []).append((k, above))
    for word, places in found.items():
        steps = np.diff([k for k, _ in places])
        if len(steps) and steps[0] > 1 and Counter(steps.tolist()).most_common(1)[0][1] > 0.5 * len(steps):
            units = {above["time_unit"] or (above["unit"] if above["time"] is None else None) for _, above in places}
            unit = units.pop() if len(units) == 1 else None
            if unit is None and column_names.is_time(word) and all(above["time"] is None for _, above in places):
                times = np.array([float(above["number"].replace(",", ".")) for _, above in places])
                one, several = unit_of_times(times)
                return word, [*several] or [one]
            return word, [] if unit is None else [unit.lower()]
    return "", []


def _lines_between_blanks(draft: Draft, lines: Sequence[str]) -> int:
    """Return how many lines of numbers are between two empty lines each, 0 if that differs or none are.

    What is behind the last may be a part, and so may what is before the first of a live source.
    """
    fit, from_begin = draft.fit, draft.layout.source is None
    empty = np.cumsum([not line.strip(" \t\r,;") for line in lines])
    before = empty[[fit.lines[k][0] for k in fit.body]]
    ends = np.flatnonzero(np.diff(before)) + 1
    sizes = set(np.diff([0, *ends] if from_begin else ends).tolist())
    return sizes.pop() if len(ends) > 1 and len(sizes) == 1 else 0


def find_blanks(draft: Draft, lines: Sequence[str]) -> None:
    """Say how many lines a frame has, if empty lines show it."""
    if (size := _lines_between_blanks(draft, lines)) > 1:
        draft.set(frame_end="blank")
        draft.lines = size
        draft.said.append(f"{size} lines per frame, between empty lines")


def _frames(draft: Draft, lines: Sequence[str], is_begin: Sequence[bool], begin: str, units: Sequence[str]) -> None:
    """Say how many lines a frame has: those between lines of text, which are empty here, or between empty lines."""
    if draft.is_stated("frame_lines", "frame_end", "frame_begin"):
        is_between = draft.table.frame_lines is None
        draft.lines = _lines_between_blanks(draft, lines) if is_between else draft.lines
        return
    if begin:
        first = min(is_begin.index(True), draft.fit.first)
        draft.set(frame_begin=begin, frame_time=next(iter(units), None), skip_lines=first)
        draft.lines = _lines_between_blanks(draft, lines)
        draft.said.append(f"frames begin at lines {begin!r}")
        if len(units) > 1:
            draft.ask("the unit of the time", "frame_time", {unit: {"frame_time": unit} for unit in units})
    else:
        find_blanks(draft, lines)


def _without_times(draft: Draft, text: Text) -> None:
    """Ask what lines without times are: frames one after the other, or the rows of one frame."""
    keys, count = "time_column frame_lines", len(draft.fit.body)
    if draft.table.has_lines or count < 2 or text.goes_on:
        draft.ask("it has no times", keys, {"frames without times": {"time_column": 0}})
        return
    choices: dict[str, Changes] = {
        "a frame per line, without times": {"frame_lines": 1},
        f"rows of one frame: frame_lines = {count}": {"frame_lines": count, "frame_end": None},
    }
    draft.ask(f"{counted(count, 'line')}, no times", keys, choices)


def _with_size(layout: Layout, draft: Draft) -> Layout:
    """Return the layout with its unit, its axes (which are asked), and rows and columns that the names state."""
    taxels = draft.taxels
    unit = next((draft.units[k] for k in taxels if draft.units[k]), "")
    full = replace(layout, unit=layout.unit or unit or None)
    names = [draft.names[k] for k in taxels]
    if any(names) and column_names.axes_of(names) is not None:
        draft.add(OF_AXES, *taxels)
        return full
    places = draft.size or (column_names.places_of(names) if any(names) and not layout.rows else None)
    if places is not None and min(places) > 1:
        full = replace(full, rows=places[0], columns=places[1])
    # Lines that are parts of a frame whose size is known; a line with a time of its own is a frame.
    size, is_part = (layout.rows or 0) * (layout.columns or 0), draft.table.time_column is None
    if is_part and size > len(taxels) and size % len(taxels) == 0 and not draft.table.has_lines:
        full = replace(full, table=replace(draft.table, frame_lines=size // len(taxels)))
    return full
