"""Tables of text and of spreadsheets of other programs, read by pandas as a layout says, or as they look."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen_whole
from taxel._base.errors import unreadable
from taxel._base.limits import COLUMNS
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import around
from taxel.formats.checks import table as limited
from taxel.formats.column_names import AXES, are_units, axes_of, time_unit
from taxel.formats.layout import Layout, Table
from taxel.formats.lines import MISSING, OddLines, is_number, read_line
from taxel.formats.table_form import guess
from taxel.formats.table_text import SHEETS, TEXTS, Text
from taxel.formats.times import ISO, UNITS_US, is_time, repaired, us_of
from taxel.frames import Frames

__all__ = ["ENDINGS", "Opened", "read_table"]

ENDINGS = (*TEXTS, *SHEETS)
#: Cells that pandas converts at once.
_CELLS = 1 << 22
#: So many odd lines are left out of any table, and of longer ones this share.
_FEW_ODD, _ODD = 2, 0.1
_NUMBER = re.compile(r"[-+]?\d+(?:[.,]\d+)?")


@dataclass(frozen=True, eq=False)
class Opened:
    """Hold what a file of another program says.

    Parameters
    ----------
    sources : mapping from str to Frames or Events
        By name, "" for the only one.
    timed : bool
        Whether the file has times; else frames are numbered: frame k has the time k us.
    layout : Layout
        The layout by which it was read, complete.
    said : str
        How it was read, in one line; "" if the layout says all.
    labels : tuple of (str, int)
        Labels and their times in us, of the column of labels.
    lost : tuple of str
        What was left out, one line each.
    """

    sources: dict[str, Frames | Events]
    timed: bool
    layout: Layout
    said: str = ""
    labels: tuple[tuple[str, int], ...] = ()
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Columns:
    """Hold which column of a table is what, and the number of its first line of numbers, from 0."""

    names: tuple[str, ...]
    is_named: bool
    first: int
    time: int | None
    label: int | None
    by: int | None
    taxels: tuple[int, ...]

    @property
    def count(self) -> int:
        return len(self.names)

    def called(self, column: int) -> str:
        """Return the name of a column, or its number if it has none."""
        return self.names[column] or f"column {column + 1}"

    def left_out(self) -> list[str]:
        """Return the columns that are not read."""
        read = {self.time, self.label, self.by, *self.taxels}
        return [self.called(k) for k in range(self.count) if k not in read]


@dataclass(eq=False)
class _Rows:
    """Hold the rows of a table as they are read."""

    values: NDArray[np.float32]
    times: Any
    labels: list[str] | None
    keys: list[str] | None
    #: The number of the line of each row, none if they are one after the other, and the rows at which frames begin.
    numbers: list[int] = field(default_factory=list)
    begins: list[int] = field(default_factory=list)
    frame_times: list[float] = field(default_factory=list)
    odd: OddLines = field(default_factory=OddLines)


def read_table(path: Path, layout: Layout, array: Array | None = None) -> Opened:
    """Read a table of frames or of events.

    Parameters
    ----------
    path : Path
    layout : Layout
        What it does not say of a table is found in the text, if it has no [table].
    array : Array, optional
        The sensor of events, where the layout does not say it; default: one large enough for them.

    Raises
    ------
    FormatError : no table, one that differs from its layout, or one that can be read in two ways (prints both)
    ImportError : the extra ``tables`` is not installed
    """
    text = Text(path)
    found = guess(text, layout)
    full, how = found.layout, found.layout.table or Table()
    columns = _columns(text, how)
    rows = _read(text, columns, how)
    _refuse_odd(path, rows)
    said = [*found.said, *rows.odd.said()]
    lost = [f"columns that are not taxels: {', '.join(left)}"] if (left := columns.left_out()) else []
    if how.events:
        return _events(path, full, how, columns, rows, array, said, lost)
    values, t, keys, labels = _frames_of_lines(path, full, how, rows, said)
    maybe = np.flatnonzero(np.isnan(values[0, 0])) if values.shape[1] == 1 and len(values) else ()
    empty = [int(k) for k in maybe if np.isnan(values[:, 0, k]).all()]
    if found.said and 0 < len(empty) < values.shape[2]:
        names = [columns.called(columns.taxels[k]) for k in empty]
        numbers = [columns.taxels[k] + 1 for k in empty]
        values = np.delete(values, empty, axis=2)
        columns = replace(columns, taxels=tuple(np.delete(columns.taxels, empty).tolist()))
        how = replace(how, leave_out=[*how.leave_out, *numbers])
        full = replace(full, table=how)
        said.append(f"{', '.join(names)} left out: empty")
    us, order = _times(path, t, how, values, said)
    if order is not None:
        values = values[order]
        keys, labels = ([column[k] for k in order] if column else column for column in (keys, labels))
    sources: dict[str, Frames | Events] = dict(_sources(path, full, columns, values, us, keys))
    size = " and ".join(_size(frames) for frames in sources.values()) if found.said else ""
    marks = _labels(columns, labels, us) if labels else ()
    line = f"{path.name}: read as {size}: {'; '.join(said)}" if found.said else ""
    lost += rows.odd.said()
    return Opened(sources, t is not None, full, line, marks, tuple(lost))


def _size(frames: Frames | Events) -> str:
    rows, columns = frames.array.shape
    return f"{counted(len(frames), 'frame')} of {rows} x {columns} {'taxel' if rows * columns == 1 else 'taxels'}"


#: The number of a line from 0, its cells, and their names.
_Line: TypeAlias = tuple[int, tuple[str, ...], tuple[str, ...]]


def _columns(text: Text, how: Table) -> _Columns:
    """Return which column is what, by the first lines and the layout.

    Raises
    ------
    FormatError : no lines, or columns that differ from the layout
    """
    path = text.path
    names, is_named, first = _head(text, how)
    time, label, by = (
        None if getattr(how, key) is None else _column(path, key, getattr(how, key), names)
        for key in ("time_column", "label_column", "by")
    )
    left = {_column(path, "leave_out", column, names) for column in how.leave_out}
    if time in left:
        raise unreadable(f"column {shown(names[time or 0])} is the time_column, but is also in leave_out", path)
    kept = [k for k in range(len(names)) if k not in {*left, time, label, by}]
    kept = [k for k in kept if how.keep is None or fnmatchcase(names[k], how.keep)]
    if not kept:
        raise unreadable("the layout leaves no column that is a taxel", path)
    timed = next((k for k in kept if time is None and time_unit(names[k]) is not None), None)
    if timed is not None and (timed == 0 or len(names[timed]) > 1) and how.frame_time is None:
        raise unreadable(
            f"column {shown(names[timed])} contains times, as its name shows; write time_column, or leave_out, in "
            "[table] of the layout file",
            path,
            line=first,
        )
    return _Columns(names, is_named, first, time, label, by, tuple(kept))


def _head(text: Text, how: Table) -> tuple[tuple[str, ...], bool, int]:
    """Return the names of all columns, whether the table has names, and the number of the first line below, from 0."""
    path = text.path
    lines = [(k, line) for k, line in enumerate(text.head) if k >= how.skip_lines and not how.is_between(line)]
    if not lines:
        raise unreadable(f"no line follows the {how.skip_lines} skipped lines", path)
    parsed = [(k, read_line(line, how.lines, how.separator, how.decimal)) for k, line in lines]
    rows = [(k, row.cells, row.names) for k, row in parsed if row is not None and any(row.cells)]
    if not rows:
        raise unreadable("contains no line of numbers", path)
    has_names = how.lines == "plain" and not how.columns and _are_names(rows, how)
    names = tuple(cell.strip("\"'") for cell in rows[0][1]) if has_names else tuple(how.columns)
    below = rows[has_names:]
    # A line of units may be between names and numbers.
    if has_names and len(below) > 1 and are_units(names, below[0][1]):
        below = below[1:]
    first = below[0][0] if below else rows[0][0] + 1
    width = max((k for k, name in enumerate(names, 1) if name), default=0)
    names = names if how.columns else names[: max(width, min(len(names), 1))]
    count = _count(below or rows, max(1, len(names)), how)
    if count > COLUMNS:
        raise unreadable(f"{count} columns; must have at most {COLUMNS}", path, line=first + 1)
    if names and len(names) < count and (how.columns or any(names[: count - len(names)])):
        raise unreadable(f"{counted(len(names), 'name')} for {counted(count, 'column')}", path, line=first + 1)
    if how.columns and len(names) > count:
        raise unreadable(f"{counted(len(names), 'name')} for {counted(count, 'column')}", path, line=first + 1)
    if not names and how.lines in ("marked", "json"):
        names = Counter(own for _, cells, own in below if len(cells) == count).most_common(1)[0][0]
    is_named = bool(names)
    names += ("",) * (count - len(names))
    if count == 1 and how.lines == "plain":
        _refuse_separator(path, how, lines[: 2 + has_names])
    return names, is_named, first


def _are_names(rows: Sequence[_Line], how: Table) -> bool:
    """Return whether the first line is one of names: texts above numbers."""
    first, below = rows[0][1], rows[1:]
    missing = {*MISSING, how.missing}
    texts = [k for k, cell in enumerate(first) if cell not in missing and not _is_value(cell, how)]
    if not below:
        return bool(texts) and len(texts) == len(first)
    numeric = [sum(k < len(cells) and _is_value(cells[k], how) for _, cells, _ in below) for k in texts]
    return any(2 * count >= min(len(below), 3) for count in numeric)


def _is_value(cell: str, how: Table) -> bool:
    return is_number(cell.strip("'"), how.decimal) or is_time(cell)


def _count(rows: Sequence[_Line], least: int, how: Table) -> int:
    """Return the most frequent number of cells, but `least`, less those behind a separator at the end of each line."""
    count = Counter(len(cells) for _, cells, _ in rows).most_common(1)[0][0]
    while (
        count > least and how.missing != "" and all(not cells[count - 1] for _, cells, _ in rows if len(cells) >= count)
    ):
        count -= 1
    return count


def _refuse_separator(path: Path, how: Table, lines: Sequence[tuple[int, str]]) -> None:
    """Refuse lines of one cell that another separator would split."""
    body = [line.strip() for _, line in lines]
    other = next((mark for mark in ",;\t " if mark != how.decimal and all(mark in line for line in body)), None)
    if other is not None:
        raise unreadable(
            f"the separator {shown(how.separator)} gives one column, which contains {shown(other)}; write the right "
            "separator in [table] of the layout file",
            path,
            line=lines[0][0] + 1,
        )


def _column(path: Path, key: str, column: str | int, names: Sequence[str]) -> int:
    """Return the place of a column of a name or number."""
    if isinstance(column, int):
        if column > len(names):
            raise unreadable(f"{key} is {column}, but the table has {counted(len(names), 'column')}", path)
        return column - 1
    if list(names).count(column) != 1:
        problem = "is missing" if column not in names else "appears twice; name it by its number"
        there = ", ".join(name or str(k) for k, name in enumerate(names[:20], 1)) + ", ..." * (len(names) > 20)
        raise unreadable(f"column {shown(column)} of {key} {problem}; the columns are {there}", path)
    return list(names).index(column)


def _read(text: Text, columns: _Columns, how: Table) -> _Rows:
    """Read all rows: at once by pandas, or, where a line is odd or has marks, after each line was looked at."""
    fits = how.lines == "plain" and how.frame_end is None and how.frame_begin is None
    if fits and (rows := _at_once(text, columns, how)) is not None:
        return rows
    odd, kept = OddLines(), _Rows(np.empty((0, 0), np.float32), None, None, None)
    source = io.StringIO()
    for number, cells in _good_lines(text, columns, how, kept, odd):
        source.write("\t".join(cells) + "\n")
        kept.numbers.append(number)
    if not kept.numbers:
        kinds = "; ".join(odd.said())
        raise unreadable(f"contains no line of numbers{': ' * bool(kinds)}{kinds}", text.path)
    source.seek(0)
    rows = _parsed(source, columns, how, sep="\t", quoting=csv.QUOTE_NONE)
    rows.numbers, rows.begins, rows.frame_times, rows.odd = kept.numbers, kept.begins, kept.frame_times, odd
    large = np.argwhere(np.isinf(rows.values))
    if len(large):
        row, column = large[0].tolist()
        raise unreadable(
            f"column {columns.called(columns.taxels[column])} has a value that does not fit 32 bits",
            text.path,
            line=kept.numbers[row] if kept.numbers else None,
        )
    return rows


def _at_once(text: Text, columns: _Columns, how: Table) -> _Rows | None:
    """Return the rows of a table; None if a line may be odd."""
    from pandas.errors import ParserError  # noqa: PLC0415  takes long

    sep = r"\s+" if how.separator == " " else how.separator
    for _ in range(2):
        source = text.source
        options = {"encoding": text.encoding} if text.is_file else {}
        try:
            rows = _parsed(source, columns, how, sep=sep, skiprows=columns.first, whole=True, **options)
        except UnicodeDecodeError:
            text.as_latin_1()
        except (ParserError, ValueError, OverflowError):
            return None
        else:
            return rows
    return None


class _OddError(ValueError):
    """A line may be odd."""


def _parsed(source: Any, columns: _Columns, how: Table, *, whole: bool = False, **options: Any) -> _Rows:
    """Return what pandas reads; if the text is `whole`, a line may have another number of cells, which is refused."""
    import pandas as pd  # noqa: PLC0415  takes long

    count, taxels = columns.count, list(columns.taxels)
    texts = [k for k in (columns.label, columns.by) if k is not None]
    times = [] if columns.time is None else [columns.time]
    # Kinds of numbers that are stated, not found, take pandas half as long again.
    kinds: dict[int, Any] = dict.fromkeys([*texts, *(times if how.time_unit == ISO else [])], str)
    places: Any = slice(taxels[0], taxels[-1] + 1) if taxels[-1] - taxels[0] + 1 == len(taxels) else taxels
    chunks = pd.read_csv(
        source,
        header=None,
        names=range(count + 1),
        index_col=False,
        dtype=kinds,
        decimal=how.decimal,
        na_values=[*MISSING, *([] if how.missing is None else [how.missing])],
        keep_default_na=False,
        skipinitialspace=True,
        # An empty line may not be within a frame of so many lines.
        skip_blank_lines=how.frame_lines is None,
        chunksize=max(1, _CELLS // (count + 1)),
        low_memory=False,
        **options,
    )
    values, stamps, labels, keys = list[NDArray[np.float32]](), list[Any](), list[str](), list[str]()
    # A value that 32 bits do not hold is infinite, which is refused below.
    with chunks, np.errstate(over="ignore"):
        for chunk in chunks:
            if whole and (bool(chunk[count].notna().any()) or bool(chunk[count - 1].isna().any())):
                raise _OddError
            part = chunk.iloc[:, places]
            if any(kind.kind not in "iuf" for kind in part.dtypes):
                raise _OddError
            block = part.to_numpy(np.float32)
            if whole and (np.isinf(block).any() or (times and bool(chunk[times[0]].isna().any()))):
                raise _OddError
            values.append(block)
            stamps += [chunk[k] for k in times]
            labels += chunk[columns.label].fillna("").tolist() if columns.label is not None else []
            keys += chunk[columns.by].fillna("").tolist() if columns.by is not None else []
    if not values:
        raise _OddError
    together = np.concatenate(values, out=np.empty((sum(map(len, values)), len(taxels)), np.float32))
    series = pd.concat(stamps, ignore_index=True) if stamps else None
    if whole and series is not None and how.time_unit != ISO and series.dtype.kind not in "iuf":
        raise _OddError
    return _Rows(together, series, labels or None, keys or None)


def _good_lines(
    text: Text, columns: _Columns, how: Table, kept: _Rows, odd: OddLines
) -> Iterator[tuple[int, Sequence[str]]]:
    """Yield the number and the cells of each line that is not odd; count the others, and note where frames begin."""
    missing = {*MISSING, how.missing}
    numeric = [*columns.taxels, *([] if columns.time is None or how.time_unit == ISO else [columns.time])]
    names, waiting, row = columns.names, True, 0
    has_own_names = how.lines in ("marked", "json") and columns.is_named and not how.columns
    last = 0
    for number, line in enumerate(text.lines(), 1):
        if number <= columns.first and not (how.frame_begin and line.lstrip().startswith(how.frame_begin)):
            continue
        if how.is_between(line) or (how.has_lines and not line.strip(f"\t ;,{how.separator}")):
            waiting = True
            if how.frame_begin is not None and line.lstrip().startswith(how.frame_begin) and how.frame_time:
                found = _NUMBER.findall(line)
                kept.frame_times.append(float(found[-1].replace(",", ".")) if found else np.nan)
            continue
        parsed = read_line(line, how.lines, how.separator, how.decimal)
        parsed = parsed.in_order(names) if parsed is not None and has_own_names else parsed
        cells = list(parsed.cells) if parsed is not None else []
        while len(cells) > len(names) and not cells[-1]:
            cells.pop()
        kind = _odd(cells, columns, numeric, missing, how)
        if waiting and how.has_lines:
            kept.begins.append(row)
            waiting = False
        if kind:
            odd.add(kind, number)
            last = number
            continue
        row += 1
        yield number, cells
    if last == number and not text.ends_in_line and odd.first.get("with too few cells") == last:
        del odd.counts["with too few cells"], odd.first["with too few cells"]
        odd.add("cut off at the end", last)


def _odd(cells: Sequence[str], columns: _Columns, numeric: Sequence[int], missing: set[Any], how: Table) -> str:
    """Return what is odd about a line; "" if nothing is."""
    if not any(is_number(cell, how.decimal) or is_time(cell) for cell in cells):
        return "of text"
    if len(cells) != columns.count:
        return "with too few cells" if len(cells) < columns.count else "with too many cells"
    for k in numeric:
        if not is_number(cells[k], how.decimal) and (cells[k] not in missing or k == columns.time):
            return "with a cell that is no number"
    if how.time_unit == ISO and columns.time is not None and not is_time(cells[columns.time]):
        return "without a time"
    return ""


def _refuse_odd(path: Path, rows: _Rows) -> None:
    """Refuse a table of which more lines are odd than may be left out."""
    total = len(rows.values) + rows.odd.total
    if rows.odd.total > max(_FEW_ODD, _ODD * total) or rows.odd.total >= max(1, len(rows.values)):
        first = min(rows.odd.first.values())
        kinds = "; ".join(rows.odd.said())
        raise unreadable(f"{rows.odd.total} of {total} lines are no frames: {kinds}", path, line=first)


def _frames_of_lines(
    path: Path, layout: Layout, how: Table, rows: _Rows, said: list[str]
) -> tuple[NDArray[np.float32], Any, list[str] | None, list[str] | None]:
    """Return values of shape (frames, lines, columns), the time of each frame, and its key and label."""
    width, count = rows.values.shape[1], len(rows.values)
    taxels = None if layout.rows is None or layout.columns is None else layout.rows * layout.columns
    if not how.has_lines:
        return rows.values.reshape(count, 1, width), rows.times, rows.keys, rows.labels
    if how.frame_lines is not None:
        lines, begins = how.frame_lines, np.arange(0, count - how.frame_lines + 1, how.frame_lines)
        within = next((row for row in rows.begins if row % lines and row < count), None)
        odd = rows.odd.counts.total() - rows.odd.counts["of text"] - rows.odd.counts["cut off at the end"]
        if within is not None or odd:
            number = min(rows.odd.first.values()) if within is None else rows.numbers[within]
            raise unreadable(f"an empty or odd line is within a frame of {lines} lines", path, line=number)
        if count % lines:
            said.append(f"{counted(count % lines, 'line')} at the end left out: not a whole frame")
        times = rows.times
    else:
        starts = np.array([*rows.begins, count])
        sizes = np.diff(starts)
        usual = Counter(sizes[sizes > 0].tolist()).most_common(1)[0][0]
        lines = usual if taxels is None else max(1, taxels // width)
        fits = sizes == lines
        wrong = int(np.count_nonzero(~fits[:-1] & (sizes[:-1] > 0)))
        if wrong > max(_FEW_ODD, _ODD * len(sizes)) or not fits.any():
            bad = int(np.flatnonzero(~fits)[0])
            at = rows.numbers[min(int(starts[bad]), count - 1)]
            raise unreadable(f"the frame has {counted(int(sizes[bad]), 'line')}; must have {lines}", path, line=at)
        if not fits.all():
            said.append(f"{counted(int((~fits).sum()), 'frame')} left out: not {counted(lines, 'line')}")
        begins = starts[:-1][fits]
        times = rows.times
        if how.frame_time is not None:
            times = np.array(rows.frame_times)[: len(fits)][fits]
    places = begins[:, None] + np.arange(lines)
    if times is not None and how.frame_time is None:
        times = times.iloc[begins].reset_index(drop=True)
    texts = ([column[k] for k in begins] if column else None for column in (rows.keys, rows.labels))
    return rows.values[places], times, *texts


def _times(
    path: Path, times: Any, how: Table, values: NDArray[Any], said: list[str]
) -> tuple[NDArray[np.int64], NDArray[np.intp] | None]:
    """Return times in us that ascend, or the numbers of frames, and the order of the frames, if it is another."""
    if times is None:
        return np.arange(len(values), dtype=np.int64), None
    import pandas as pd  # noqa: PLC0415  takes long

    unit = how.frame_time or how.time_unit
    us = us_of(pd.Series(times), unit)
    if us.dtype.kind == "f":
        bad = int(np.flatnonzero(~np.isfinite(us))[0])
        right = "must be like 2024-05-01T10:00:00.25" if unit == ISO else "must be within 142 years of 0"
        raise unreadable(f"the time of frame {bad} is {shown(str(pd.Series(times).iloc[bad]))}; {right}", path)
    is_of_day = unit == ISO and bool((us >= 0).all() and (us < 86_400_000_000).all())
    found = repaired(us, UNITS_US.get(unit, 1.0), of_day=is_of_day)
    if found.wrong > max(_FEW_ODD, _ODD * len(us)):
        raise unreadable(f"{found.wrong} of {counted(len(us), 'time')} are out of order: {'; '.join(found.said)}", path)
    said += found.said
    return found.t, found.order


def _sources(
    path: Path,
    layout: Layout,
    columns: _Columns,
    values: NDArray[np.float32],
    t: NDArray[np.int64],
    keys: list[str] | None,
) -> Iterator[tuple[str, Frames]]:
    """Yield the frames of each source by its name."""
    names = [columns.names[k] for k in columns.taxels]
    parts = [("", slice(None))] if keys is None else [(key, np.array(keys) == key) for key in dict.fromkeys(keys)]
    for key, chosen in parts:
        part, times = values[chosen], t[chosen]
        if layout.axis is None:
            yield key, _frames(path, layout, part, times, names if any(names) and part.shape[1] == 1 else None)
            continue
        by_taxel = axes_of(names)
        if by_taxel is None or part.shape[1] > 1:
            raise FormatError(f"{layout.path}: axis is {layout.axis}, but {path.name} has no columns of x, y and z")
        for axis, readings in of_axis(
            layout.axis, {a: part[:, :, [taxel[a] for taxel in by_taxel.values()]] for a in AXES}
        ):
            name = f"{key} {axis}".strip() if layout.axis == "all" else key
            yield name, _frames(path, layout, readings, times, list(by_taxel) if any(by_taxel) else None)


def of_axis(axis: str, by_axis: dict[str, NDArray[np.float32]]) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Yield what `Layout.axis` asks for of readings by their axis: of one axis, the length of x and y, or of each."""
    if axis == "all":
        yield from by_axis.items()
    else:
        yield axis, np.hypot(by_axis["x"], by_axis["y"]) if axis == "shear" else by_axis[axis]


def _frames(
    path: Path, layout: Layout, values: NDArray[np.float32], t: NDArray[np.int64], names: list[str] | None
) -> Frames:
    """Return the frames of a sensor, in the rows and columns of the layout."""
    lines, width = values.shape[1:]
    taxels = lines * width
    if layout.rows is not None and layout.columns is not None and taxels != layout.rows * layout.columns:
        per_frame, left = divmod(layout.rows * layout.columns, taxels)
        hint = f"; if {per_frame} lines are a frame, write [table] frame_lines = {per_frame}"
        raise FormatError(
            f"{path}: contains {counted(lines, 'line')} of {counted(width, 'column')} a frame; {layout.path} states "
            f"{layout.rows} x {layout.columns} taxels{hint if per_frame > 1 and not left and lines == 1 else ''}"
        )
    try:
        stated = Array(lines, width, name=path.stem) if lines > 1 else None
        # More channels than a sensor may have columns are a grid by the layout.
        stated = stated or (None if taxels <= 65_535 else layout.grid())
        array = layout.array(taxels, stated or Array(1, taxels, name=path.stem, names=names))
        frames = Frames(
            frozen_whole(values.reshape(-1, *array.shape)), frozen_whole(t), unit=layout.unit or "counts", array=array
        )
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    limited(path, frames)
    return frames


def _labels(columns: _Columns, cells: list[str], t: NDArray[np.int64]) -> tuple[tuple[str, int], ...]:
    """Return a label where the value of its column changes: the text, or the name of the column and the number."""
    name = columns.called(columns.label or 0)
    changes = (k for k in range(1, len(cells)) if cells[k] != cells[k - 1] and cells[k] not in MISSING)
    return tuple((f"{name} {cells[k]}" if is_number(cells[k]) else cells[k], int(t[k])) for k in changes)


def _events(
    path: Path,
    layout: Layout,
    how: Table,
    columns: _Columns,
    rows: _Rows,
    array: Array | None,
    said: list[str],
    lost: list[str],
) -> Opened:
    """Return the events of a table with a line each."""
    names = [columns.names[k].lower() for k in columns.taxels]
    by_name = {_EVENT_COLUMNS.get(name, name): rows.values[:, k] for k, name in enumerate(names)}
    if sorted(by_name) != ["p", "x", "y"]:
        raise unreadable(f"the columns other than the time are {', '.join(names)}; must be x, y, p for events", path)
    for name, least, most in (("x", 0, 65_534), ("y", 0, 65_534), ("p", -1, 1)):
        column = by_name[name]
        wrong = np.flatnonzero((column != np.rint(column)) | ~((column >= least) & (column <= most)))
        if len(wrong):
            right = "0 or 1, or -1 or 1" if name == "p" else f"a whole number from 0 to {most}"
            number = rows.numbers[wrong[0]] if rows.numbers else columns.first + 1 + int(wrong[0])
            raise unreadable(f"{name} is {column[wrong[0]]:g}; must be {right}", path, line=number)
    # Events may have the same time.
    us = us_of(rows.times, how.time_unit)
    back = np.flatnonzero(~(np.diff(us) >= 0))
    if us.dtype.kind == "f" or len(back):
        at = int(back[0]) + 1 if len(back) else int(np.flatnonzero(np.isnan(us))[0])
        number = rows.numbers[at] if rows.numbers else columns.first + 1 + at
        raise unreadable("the time is before that of the line above, or is none", path, line=number)
    x, y = by_name["x"].astype(np.uint16), by_name["y"].astype(np.uint16)
    try:
        sensor = (array or around(x, y)) if layout.rows is None else layout.array(1)
        events = Events(us.astype(np.int64), x, y, by_name["p"] > 0, array=sensor)
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    limited(path, events)
    line = f"{path.name}: read as {counted(len(events), 'event')}: {'; '.join(said)}" if said else ""
    return Opened({"": events}, True, layout, line, lost=(*lost, *rows.odd.said()))


_EVENT_COLUMNS = {"col": "x", "column": "x", "row": "y", "pol": "p", "polarity": "p", "on": "p"}
