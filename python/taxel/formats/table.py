"""Tables of text and of spreadsheets of other programs, read by pandas as a layout says, or as they look."""

from __future__ import annotations

import warnings
from array import array
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import unreadable
from taxel._base.messages import counted, first_line
from taxel._base.table_text import SHEETS, TEXTS, Text
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.column_names import AXES, axes_of
from taxel.formats.form import Form
from taxel.formats.layout import Layout
from taxel.formats.lines import (
    MISSING,
    OTHER,
    USUAL,
    WITH_TEXT,
    WITH_THOUSANDS,
    is_number,
    last_number,
    odd_lines,
    read_line,
)
from taxel.formats.opened import readers_of, sources_of
from taxel.formats.parts import parts_of
from taxel.formats.table_columns import EVENT_COLUMNS
from taxel.formats.table_form import form_of
from taxel.formats.times import FEW_ODD, ISO, ODD, in_order, us_of
from taxel.frames import Frames
from taxel.labels import Note
from taxel.reading import InMemory

ENDINGS = (*TEXTS, *SHEETS)
#: Cells that pandas converts at once.
_CELLS = 1 << 21
#: Kinds of odd lines: with a reading that is missing, and with too few cells, as the last line where a text is cut off.
MISSING_ONE, TOO_FEW, CUT_OFF = f"{WITH_TEXT}, which is missing", "with too few cells", "cut off at the end"
#: Lines of events are swapped by at most so much, us.
_SWAPPED_US = 1_000_000
#: The least and the largest value of the columns of events.
_EVENTS = {"x": (0, 65_534), "y": (0, 65_534), "p": (-1, 1), "intensity": (0, 65_535), "repaired": (0, 1)}


@dataclass(eq=False)
class Rows:
    """Hold the rows of a table as they are read."""

    #: The values of the columns that are taxels.
    values: NDArray[np.float32]
    #: A DataFrame with the cells of the other columns that count, "time", "label" and "by", as far as there are these.
    beside: Any
    #: The number of the line of each row, none if they are one after the other, and the rows at which frames begin.
    numbers: list[int] = field(default_factory=list)
    begins: list[int] = field(default_factory=list)
    frame_times: list[float] = field(default_factory=list)
    #: The lines that are no frame, each its kind and its number.
    odd: list[tuple[str, int]] = field(default_factory=list)

    @classmethod
    def none(cls, width: int) -> Rows:
        """Return no rows of so many values."""
        import pandas as pd  # noqa: PLC0415  takes long

        return cls(np.empty((0, width), np.float32), pd.DataFrame({"time": np.empty(0, np.int64)}))

    @property
    def times(self) -> Any:
        """A Series of the cells of times, or of the times in the lines above frames; None without."""
        return self.beside.get("time")

    def line(self, row: int, path: Path, first: int) -> int:
        """Return the number of the line of a row, from 1; the `first` line of numbers is counted from 0."""
        below = ((n, line) for n, line in enumerate(Text(path).lines(), 1) if n > first and line.strip())
        return self.numbers[row] if self.numbers else next(islice(below, row, None))[0]

    def joined(self) -> Rows:
        """Return the same with seconds and nanoseconds as one time, and row and column as one name of a taxel."""
        beside = self.beside
        if "nanoseconds" in beside and isinstance(beside["time"].iloc[0], str):
            beside["time"] += "." + beside.pop("nanoseconds")
        elif "nanoseconds" in beside:
            beside["time"] = beside["time"].astype("int64") * 10**9 + beside.pop("nanoseconds").astype("int64")
        if "column" in beside:
            beside["taxel"] += " " + beside.pop("column")
        return self

    def chosen(self, rows: NDArray[np.intp]) -> None:
        """Take only these rows' times, labels and keys."""
        self.beside = self.beside.iloc[rows].reset_index(drop=True)


def read_table(path: Path, layout: Layout, array: Array | None = None) -> list[InMemory]:
    """Return a reader of each source of a table of frames, or of events.

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
    parts, others = parts_of(Text(path), layout.table)
    more = [f"other sheets: {', '.join(others)}"] * bool(others)
    return [each for name, text in parts.items() for each in _read_part(name, text, layout, array, more)]


def _read_part(
    part: str,
    text: Text,
    layout: Layout,
    array: Array | None,
    more: Sequence[str],
) -> list[InMemory]:
    """Return a reader of each source of one of the tables of a file; `more` is what of the file is not read."""
    path = text.path
    form, full = form_of(text, layout)
    how, columns, sources = form.table, form.columns, dict[str, Frames | Events]()
    rows = read_rows(text, form)
    read = {*columns.times, columns.label, columns.by, *columns.taxel, *columns.taxels}
    left = [form.called(k) for k in range(len(form.names)) if k not in read]
    lost = [*([f"columns that are not taxels: {', '.join(left)}"] if left else []), *odd_lines(rows.odd), *more]
    said, notes = [*form.said, *odd_lines(rows.odd), *more], dict[str, list[Note]]()
    if how.events:
        sources = {part: _events(path, full, form, rows, array, said)}
        shape = sources[part].array.shape
        if array is None and layout.rows is None:
            said.append(f"{shape[0]} x {shape[1]} taxels assumed, which the table does not state")
    else:
        values, names = _frames_of_lines(path, full, form, rows, said), [form.names[k] for k in columns.taxels]
        is_found = layout.stated.isdisjoint(("leave_out", "keep")) and values.shape[1] == 1
        empty = np.isnan(values).all(axis=(0, 1)) if is_found else np.zeros(1, bool)
        if empty.any() and not empty.all():
            places = [columns.taxels[k] for k in np.flatnonzero(empty)]
            said.append(f"{', '.join(map(form.called, places))} left out: empty")
            full = replace(full, table=replace(how, leave_out=[*how.leave_out, *(k + 1 for k in places)]))
            values, names = values[:, :, ~empty], [form.names[k] for k in columns.taxels if k not in places]
        if columns.taxel:
            values, names = _one_line_a_time(path, form, rows, values)
        if full.axis is not None:
            values, names = _by_axis(path, full, names, values)
        for key, chosen in _parts(rows.beside):
            # Each sensor has a clock of its own.
            of_part, beside = values[chosen], rows.beside.iloc[chosen]
            t, order = np.arange(len(of_part), dtype=np.int64), None
            if rows.times is not None:
                t, order = in_order(path, beside["time"], form.unit_of_times, said)
            if order is not None:
                of_part, beside = of_part[order], beside.iloc[order]
            own = dict(sources_of(path, full, f"{part} {key}".strip(), of_part, t, names if any(names) else None))
            sources |= own
            notes |= dict.fromkeys(own, _labels(form, beside, t))
    timed = rows.times is not None
    return readers_of(path, "table", sources, full, said, timed=timed, lost=lost, notes=notes, roles=form.roles)


def read_rows(text: Text, form: Form, *, ends_empty: bool = False) -> Rows:
    """Read all rows of a table whose layout is complete; lines that are none are left out and counted.

    At once by pandas, or, where a line is odd or has marks, one by one.

    Parameters
    ----------
    text : Text
    form : Form
    ends_empty : bool
        Whether the last cell of a line may be empty, which else looks like a line with too few cells.

    Raises
    ------
    FormatError : more of them than may be left out, or no line of numbers
    """
    how = form.table
    # To pandas a mark between thousands may be anywhere in a number.
    fits = how.lines == "plain" and how.frame_end is how.frame_begin is how.thousands is None
    rows = _at_once(text, form, ends_empty) if fits else None
    return _line_by_line(text, form) if rows is None else rows


def _at_once(text: Text, form: Form, ends_empty: bool) -> Rows | None:
    """Return the rows of a table; None if a line may be odd."""
    import pandas as pd  # noqa: PLC0415  takes long

    for _ in range(2):
        try:
            with warnings.catch_warnings():
                # A line with two cells more.
                warnings.simplefilter("error", pd.errors.ParserWarning)
                return _parsed(text, form, ends_empty)
        except UnicodeDecodeError as error:
            text.as_latin_1(error)
        except (ValueError, OverflowError, pd.errors.ParserWarning):  # of pandas' parser too
            return None
    return None


def _parsed(text: Text, form: Form, ends_empty: bool) -> Rows | None:
    """Return what pandas reads; None if a line may have another number of cells, or a cell that is no number."""
    import pandas as pd  # noqa: PLC0415  takes long

    how, count, taxels, times = form.table, len(form.names), list(form.taxels), list(form.columns.times)
    beside, mark = _beside(form), how.separator
    # Kinds of numbers that are stated, not found, take pandas half as long again.
    kinds: dict[int, Any] = {k: str for k in beside.values() if k not in times or how.time_unit == ISO}
    # Each takes pandas time; a rare one that comes only later is read line by line.
    head = "\n".join(text.head)
    missing = [cell for cell in form.missing if cell in USUAL or cell in head]
    # Separators may end lines; a later line with more cells than the first is an error to pandas.
    first = read_line(text.head[form.first], "plain", mark)
    width = max(count, len(first.cells) if first is not None else 0)
    cells = dict.fromkeys(range(width), missing)
    if not ends_empty:
        # A cell that is not there is as an empty one to pandas, which then is no number.
        cells[count - 1] = [cell for cell in missing if cell]
    places: Any = slice(taxels[0], taxels[-1] + 1) if taxels[-1] - taxels[0] + 1 == len(taxels) else taxels
    values, others = list[NDArray[np.float32]](), list[Any]()
    # A value that 32 bits do not hold is infinite.
    with ExitStack() as stack, np.errstate(over="ignore"):
        file = stack.enter_context(text.opened()) if text.typed is None else None
        # Rows that pandas skips take it a third longer, and so do blanks, which no number needs to be without.
        deque(islice(file or (), form.first), 0)
        chunks = (
            _as_typed(text, form)
            if file is None
            else pd.read_csv(
                file,
                sep=r"\s+" if mark == " " else mark,
                header=None,
                names=range(width),
                index_col=False,
                dtype=kinds,
                decimal=how.decimal,
                na_values=cells,
                keep_default_na=False,
                skipinitialspace=mark != " " and any(f"{mark} " in f"{mark}{line}" for line in text.head),
                # An empty line may not be within a frame of so many lines.
                skip_blank_lines=how.frame_lines is None,
                chunksize=max(1, _CELLS // width),
                low_memory=False,
            )
        )
        for chunk in chunks:
            part = chunk.iloc[:, places]
            is_odd = bool(chunk.iloc[:, count:].notna().any(axis=None) or (chunk[count - 1] == "").any())
            if is_odd or any(kind.kind not in "iuf" for kind in part.dtypes):
                return None
            block = part.to_numpy(np.float32)
            if np.isinf(block).any() or bool(chunk[times].isna().any(axis=None)):
                return None
            values.append(block)
            others.append(chunk[list(beside.values())].set_axis(list(beside), axis=1))
    if not values:
        return None
    together = np.concatenate(values, out=np.empty((sum(map(len, values)), len(taxels)), np.float32))
    rows = Rows(together, pd.concat(others, ignore_index=True))
    of_times = rows.beside.iloc[:, : len(times)]
    if how.time_unit != ISO and any(kind.kind not in "iuf" for kind in of_times.dtypes):
        return None
    return rows.joined()


def _as_typed(text: Text, form: Form) -> Iterator[Any]:
    """Yield the rows of a typed table with columns by their places, as those of a text are; texts where they count."""
    table = text.typed.set_axis(range(text.typed.shape[1]), axis=1).iloc[form.first - 1 :]
    is_iso = form.table.time_unit == ISO
    texts = [k for k in _beside(form).values() if is_iso or k not in form.columns.times]
    yield table.astype(dict.fromkeys(texts, str)).reset_index(drop=True)


def _beside(form: Form) -> dict[str, int]:
    """Return the columns that count beside the taxels, by what they are."""
    columns = form.columns
    found = dict(zip(("time", "nanoseconds"), columns.times, strict=False))
    found |= dict(zip(("taxel", "column"), columns.taxel, strict=False))
    return found | {name: k for name in ("label", "by") if (k := getattr(columns, name)) is not None}


def _line_by_line(text: Text, form: Form) -> Rows:
    """Return the rows of a table of which lines are odd, or have marks, or whose frames begin or end at a line.

    Raises
    ------
    FormatError : more odd lines than may be left out, or no line of numbers
    """
    import pandas as pd  # noqa: PLC0415  takes long

    how, taxels, beside = form.table, form.taxels, _beside(form)
    are_texts = {name: not name.startswith(("time", "nano")) or how.time_unit == ISO for name in beside}
    rows, values = Rows.none(len(taxels)), array("f")
    cells: dict[str, list[Any]] = {name: [] for name in beside}
    waiting, number = True, 0
    for number, line in enumerate(text.lines(), 1):
        is_begin = how.frame_begin is not None and line.lstrip().startswith(how.frame_begin)
        if number <= form.first and not is_begin:
            continue
        if is_begin or not line.strip(f"\t ;,{how.separator}"):
            waiting = True
            if is_begin and how.frame_time is not None:
                rows.frame_times.append(last_number(line))
            continue
        read, odd = form.values(line)
        if waiting and how.has_lines:
            rows.begins.append(len(rows.numbers))
            waiting = False
        if odd == WITH_THOUSANDS:
            right = f"write thousands = {OTHER[how.decimal]!r} in [table] of the layout, as lines above show none"
            raise unreadable(f"a number has thousands; {right}", text.path, line=number)
        if odd:
            rows.odd.append((MISSING_ONE if read else odd, number))
        if not read:
            continue
        values.extend([read[k] for k in taxels] if len(taxels) < len(read) else read)
        rows.numbers.append(number)
        own = form.cells(line)[0] if any(are_texts.values()) else []
        for name, k in beside.items():
            cells[name].append(own[k] if are_texts[name] else read[k])
    if rows.odd[-1:] == [(TOO_FEW, number)] and not text.ends_in_line:
        rows.odd[-1] = (CUT_OFF, number)
    kinds = "; ".join(odd_lines(rows.odd))
    if not rows.numbers:
        raise unreadable(f"contains no line of numbers{': ' * bool(kinds)}{kinds}", text.path)
    count = len(rows.odd)
    total = len(rows.numbers) + sum(kind != MISSING_ONE for kind, _ in rows.odd)
    if count > max(FEW_ODD, ODD * total) or count >= len(rows.numbers):
        raise unreadable(f"{count} of {total} lines are no frames: {kinds}", text.path, line=rows.odd[0][1])
    rows.values = np.array(values, np.float32).reshape(-1, len(taxels))
    rows.beside = pd.DataFrame(cells, index=range(len(rows.numbers)))
    return rows.joined()


def _frames_of_lines(path: Path, layout: Layout, form: Form, rows: Rows, said: list[str]) -> NDArray[np.float32]:
    """Return values of shape (frames, lines, columns); of the rows, times, keys and labels of frames stay."""
    how = form.table
    width, count = rows.values.shape[1], len(rows.values)
    if not how.has_lines:
        return rows.values.reshape(count, 1, width)
    if how.frame_lines is not None:
        lines, begins = how.frame_lines, np.arange(0, count, how.frame_lines)
        within = next((row for row in rows.begins if row % lines and row < count), None)
        if within is not None or any(kind not in ("of text", CUT_OFF) for kind, _ in rows.odd):
            number = rows.odd[0][1] if within is None else rows.numbers[within]
            raise unreadable(f"an empty or odd line is within a frame of {lines} lines", path, line=number)
        sizes = np.diff([*begins, count])
    else:
        begins = np.array(rows.begins)
        sizes = np.diff([*begins, count])
        usual = Counter(sizes[sizes > 0].tolist()).most_common(1)[0][0]
        lines = max(1, layout.rows * layout.columns // width) if layout.rows and layout.columns else usual
    fits = sizes == lines
    wrong = int(np.count_nonzero(~fits[:-1] & (sizes[:-1] > 0)))
    if wrong > max(FEW_ODD, ODD * len(sizes)) or not fits.any():
        bad = int(np.flatnonzero(~fits)[0])
        at = rows.line(min(int(begins[bad]), count - 1), path, form.first)
        raise unreadable(f"the frame has {counted(int(sizes[bad]), 'line')}; must have {lines}", path, line=at)
    if not fits.all():
        said.append(f"{counted(int((~fits).sum()), 'frame')} left out: not {counted(lines, 'line')}")
    begins = begins[fits]
    if how.frame_time is not None:
        import pandas as pd  # noqa: PLC0415  takes long

        rows.beside = pd.DataFrame({"time": np.array(rows.frame_times)[: len(fits)][fits]})
    else:
        rows.chosen(begins)
    values: NDArray[np.float32] = rows.values[begins[:, None] + np.arange(lines)]
    return values


def _one_line_a_time(
    path: Path, form: Form, rows: Rows, values: NDArray[np.float32]
) -> tuple[NDArray[np.float32], list[str]]:
    """Return the readings of one time in one line, and the names of the taxels, which lines of the table state."""
    import pandas as pd  # noqa: PLC0415  takes long

    if values.shape[1:] != (1, 1) or rows.times is None:
        right = "a table with taxel_column must have a time_column and one column of readings"
        raise unreadable(f"{right}; its readings are {', '.join(map(form.called, form.taxels))}", path)
    frame, times = pd.factorize(rows.times)
    taxel, names = pd.factorize(rows.beside["taxel"], sort=False)
    if len(form.columns.taxel) > 1:
        # Row by row, in whatever order the lines are.
        order = sorted(range(len(names)), key=lambda k: [*map(float, names[k].split())])
        taxel, names = np.argsort(order)[taxel], names[order]
    twice = np.flatnonzero(pd.Series(frame * len(names) + taxel).duplicated())
    if len(twice):
        at = rows.beside.iloc[twice[0]]
        raise unreadable(f"{at['taxel']} has two readings at the time {at['time']}", path)
    wide = np.full((len(times), 1, len(names)), np.nan, np.float32)
    wide[frame, 0, taxel] = values[:, 0, 0]
    rows.chosen(np.flatnonzero(~pd.Series(frame).duplicated()))
    return wide, list(names)


def _by_axis(
    path: Path, layout: Layout, names: list[str], values: NDArray[np.float32]
) -> tuple[NDArray[np.float32], list[str]]:
    """Return values of shape (frames, lines, taxels, 3), and the names of the taxels."""
    by_taxel = axes_of(names)
    if by_taxel is None or values.shape[1] > 1:
        raise FormatError(f"{layout.path}: axis is {layout.axis}, but {path.name} has no columns of x, y and z")
    return values[:, :, [[taxel[axis] for axis in AXES] for taxel in by_taxel.values()]], list(by_taxel)


def _parts(beside: Any) -> Iterator[tuple[str, Any]]:
    """Yield the rows of each key, or all."""
    if "by" not in beside:
        yield "", slice(None)
        return
    keys = beside["by"].fillna("")
    for key in keys.unique():
        yield key, np.flatnonzero(keys == key)


def _labels(form: Form, beside: Any, t: NDArray[np.int64]) -> list[Note]:
    """Return a label where the value of its column changes: the text, or the name of the column and the number."""
    if form.columns.label is None:
        return []
    cells, name = beside["label"].fillna("").tolist(), form.called(form.columns.label)
    changes = (k for k in range(1, len(cells)) if cells[k] != cells[k - 1] and cells[k] not in MISSING)
    return [Note(f"{name} {cells[k]}" if is_number(cells[k]) else cells[k], int(t[k])) for k in changes]


def _events(path: Path, layout: Layout, form: Form, rows: Rows, array: Array | None, said: list[str]) -> Events:
    """Return the events of a table with a line each; the lines of two sensors that a host asks may be swapped."""
    names = [form.names[k].lower() for k in form.taxels]
    names = [EVENT_COLUMNS.get(name, name) for name in names]
    right = ({"x", "y"}, {"taxel"}), ({"p"}, {"is_negative"})
    if {*names} not in [place | rises for place in right[0] for rises in right[1]]:
        wrong = f"the columns other than the time are {', '.join(names)}"
        raise unreadable(f"{wrong}; must be x, y, p, or taxel, p, for events", path)
    try:
        events = events_of(path, form, names, rows, array if layout.rows is None else layout.array(1))
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    late = np.maximum.accumulate(events.t) - events.t
    back = np.flatnonzero(late)
    if len(back) > ODD * len(late) or late.max(initial=0) > _SWAPPED_US:
        line = rows.line(int(back[0]), path, form.first)
        raise unreadable("the time is before that of the line above", path, line=line)
    said += [f"{counted(len(back), 'line')} out of order, sorted by time"] * bool(len(back))
    return events[np.argsort(events.t, kind="stable")] if len(back) else events


def events_of(path: Path, form: Form, names: Sequence[str], rows: Rows, array: Array | None) -> Events:
    """Return the events of a table with a line each; several may have the same time.

    Parameters
    ----------
    path : Path
    form : Form
    names : sequence of str
        Of the columns but the time: x and y, or the taxel; p, or is_negative; and perhaps intensity and repaired.
    rows : Rows
    array : Array, optional
        Default: one large enough.

    Raises
    ------
    FormatError : a value that no event has (names the line)
    ProblemError : events outside the array
    """
    by_name = dict(zip(names, rows.values.T, strict=True))
    if (taxel := by_name.pop("taxel", None)) is not None:
        array = array or Array(1, 1 + int(np.nanmax(taxel, initial=0)))
        by_name["y"], by_name["x"] = np.divmod(taxel, array.columns)
    if (falls := by_name.pop("is_negative", None)) is not None:
        by_name["p"] = 1 - falls
    present = ~np.isnan(by_name["intensity"]) if "intensity" in by_name else None
    for name, column in by_name.items():
        least, most = _EVENTS[name]
        wrong = (column != np.rint(column)) | ~((column >= least) & (column <= most))
        wrong = np.flatnonzero(wrong & present if name == "intensity" and present is not None else wrong)
        if len(wrong):
            right = "0 or 1, or -1 or 1" if name == "p" else f"a whole number from {least} to {most}"
            line = rows.line(int(wrong[0]), path, form.first)
            raise unreadable(f"{name} is {column[wrong[0]]:g}; must be {right}", path, line=line)
    us = us_of(rows.times, form.unit_of_times)
    none = np.flatnonzero(np.isnan(us))
    if len(none):
        raise unreadable("the time is none", path, line=rows.line(int(none[0]), path, form.first))
    x, y = by_name["x"].astype(np.uint16), by_name["y"].astype(np.uint16)
    more: dict[str, Any] = {"repaired": by_name["repaired"] > 0} if "repaired" in by_name else {}
    if present is not None:
        more |= {"intensity": np.nan_to_num(by_name["intensity"]).astype(np.uint16), "present": present}
    return Events(us.astype(np.int64), x, y, by_name["p"] > 0, array=array or around(x, y), **more)


def around(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Return the thesis' array, or a larger array if events are outside it."""
    thesis = Array.thesis()
    if not len(x):
        return thesis
    if min(x.min(), y.min()) < 0 or max(x.max(), y.max()) >= 65_535:
        raise ProblemError("x and y: must be from 0 to 65534")
    rows, columns = max(thesis.rows, int(y.max()) + 1), max(thesis.columns, int(x.max()) + 1)
    return thesis if (rows, columns) == thesis.shape else Array(rows, columns)
