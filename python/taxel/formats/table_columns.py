"""What each column of a table is: the time and its unit, taxels, events, labels; and what is left out, and why."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice, pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel.formats import column_names
from taxel.formats.column_names import time_unit
from taxel.formats.form import places_of
from taxel.formats.layout import Table
from taxel.formats.line_fits import Fit
from taxel.formats.lines import MISSING, OTHER, is_number
from taxel.formats.times import ISO, is_of_two_numbers, unit_of_times

#: So many lines show that an unnamed column ascends as times do, and that one counts lines.
_ASCENDS, _COUNTS = 8, 20
#: So many different texts are names of sensors, not remarks.
_KEYS = 16
#: A number with other text behind it, which is no date, time or address.
_GLUED = re.compile(r"[-+]?\d+(?:[.,]\d+)?[ \t]*[^\s\d:/.,-]")
#: Names of the columns of events.
EVENT_COLUMNS = {"col": "x", "column": "x", "row": "y", "pol": "p", "polarity": "p", "on": "p"}
#: What is changed in a layout: keys of it or of its table; `left` and `read` are columns more to leave out, or fewer.
Changes: TypeAlias = Mapping[str, Any]


@dataclass
class Draft:
    """Hold what is understood of a table as it is looked at: its layout, what was left out and why, what is open."""

    fit: Fit
    table: Table
    names: tuple[str, ...]
    units: tuple[str, ...]
    left: dict[int, str] = field(default_factory=dict)
    said: list[str] = field(default_factory=list)
    #: What two layouts differ in, and how, with a comment for each.
    asked: list[tuple[str, Mapping[str, Changes]]] = field(default_factory=list)
    #: The column that names the sensor or the taxel of each line; rows and columns of taxels that two columns name.
    key: int | None = None
    size: tuple[int, int] | None = None

    def called(self, column: int) -> str | int:
        """Return how a layout names a column: by its name, or, without a name of its own, by its number from 1."""
        name = self.names[column]
        return name if name and self._counts[name] == 1 else column + 1

    @cached_property
    def _counts(self) -> Counter[str]:
        return Counter(self.names)

    def ask(self, why: str, choices: Mapping[str, Changes], *, first: bool = False) -> None:
        """Add a question: what is open, and what each answer changes; the `first` one is printed with its layouts."""
        self.asked.insert(0 if first else len(self.asked), (why, choices))

    def answer(self, why: str) -> None:
        """Remove the questions that begin so, as something else answers them."""
        self.asked = [each for each in self.asked if not each[0].startswith(why)]

    def set(self, **keys: Any) -> None:
        """Set keys of the table."""
        self.table = replace(self.table, **keys)


def time_of(draft: Draft, *, is_stated: bool) -> int | None:
    """Return the column of times that fits best, and say its unit; None without one.

    Where a layout states the sensor or the rate, a column is one of times by its name or its cells alone.
    """
    fit, names = draft.fit, draft.names
    scores: dict[int, int] = {}
    for k in range(len(names)):
        if fit.types[k] not in ("number", "time"):
            continue
        # A letter may be the name of a taxel too: it is the time where it comes first, or ascends.
        is_called = column_names.is_time(names[k]) and (k == 0 or len(names[k]) > 1)
        if is_called or (time_unit(names[k]) is not None and fit.ascends(k)):
            scores[k] = 3 + is_called + 2 * fit.ascends(k)
        elif fit.types[k] == "time":
            scores[k] = 3
        elif draft.table.frame_time is None and fit.count > 1 and fit.ascends(k) and fit.epoch(k):
            scores[k] = 2
    # Of two clocks one may be in whole seconds.
    column = max(scores, key=lambda k: (scores[k], 2 * len(set(fit.cells(k))) > len(fit.body), -k), default=None)
    draft.left.update(dict.fromkeys((k for k in scores if k != column and scores[k] >= 4), "another time"))
    if column is None and draft.table.frame_time is None and not is_stated and fit.kind != "hex":
        column = _unnamed_time(draft)
    if column is None:
        return None
    unit = ISO if fit.types[column] == "time" else _unit_of_time(draft, column)
    draft.set(time_column=draft.called(column), time_unit=unit)
    if unit == ISO and all(map(is_of_two_numbers, fit.cells(column))):
        example = fit.cells(column)[-1]
        why = f"{example} may be hours and minutes, or minutes and seconds, which must be written 0:{example:0>5}"
        draft.ask(why, {"hours and minutes": {}})
    seconds = next((k for k in (column, column - 1) if _has_nanoseconds(draft, k)), None)
    if seconds is None:
        return column
    draft.set(time_column=f"{draft.called(seconds)}+{draft.called(seconds + 1)}", time_unit="s")
    draft.left.pop(seconds, None)
    draft.left.pop(seconds + 1, None)
    draft.answer("the unit of the time")
    return seconds


def _has_nanoseconds(draft: Draft, column: int) -> bool:
    """Return whether the column after one of whole seconds has the nanoseconds within them, as stamps of ROS have."""
    names, fit = draft.names, draft.fit
    if not 0 <= column < len(names) - 1 or {*fit.types[column : column + 2]} != {"number"}:
        return False
    seconds, rest = fit.numbers(column), fit.numbers(column + 1)
    is_part = bool((rest >= 0).all() and (rest < 1e9).all() and (rest % 1 == 0).all() and (seconds % 1 == 0).all())
    return is_part and time_unit(names[column]) in ("s", "") and time_unit(names[column + 1]) == "ns"


def ask_for_lines_of_one_time(draft: Draft, time: int) -> None:
    """Ask whether lines that have the same time are those of one frame."""
    places = places_of(draft.names, "time_column", draft.table.time_column or time + 1)
    cells = [*zip(*map(draft.fit.cells, places), strict=True)]
    begins = [k for k in range(len(cells)) if k == 0 or cells[k] != cells[k - 1]]
    sizes = set(np.diff(begins).tolist())
    if len(begins) > 2 and len(sizes) == 1 and (size := sizes.pop()) > 1 and not draft.table.has_lines:
        frames: dict[str, Changes] = {"rounded times": {}, "lines of one frame": {"frame_lines": size}}
        draft.ask(f"{size} lines have the same time", frames)


def _rises(fit: Fit, column: int) -> bool:
    """Return whether nearly every cell of a column of numbers is above the one before."""
    steps = np.diff(fit.numbers(column)) if fit.types[column] == "number" else np.empty(0)
    return len(steps) > 0 and bool((steps > 0).mean() >= 0.9)


def _unnamed_time(draft: Draft) -> int | None:
    """Return a column of times that no name says: the only one that ascends in like steps; in few lines, ask.

    Of columns with names it can be the first, whose name may be of any language, which is asked.
    """
    fit, names = draft.fit, draft.names
    if len(fit.body) < 3 or fit.count < 2:
        return None
    even = [k for k in range(len(names)) if not (k and names[k]) and _rises(fit, k) and _is_even(fit.numbers(k))]
    even = [k for k in even if not names[k] or (len(fit.body) >= _ASCENDS and not column_names.is_counter(names[k]))]
    times = [k for k in even if not fit.counts(k)]
    few = len(fit.body) < _ASCENDS
    if len(times) == len(even) == 1 and not few and not names[times[0]]:
        draft.said.append(f"column {times[0] + 1} ascends")
        return times[0]
    if not even or len(even) > 2 or (few and fit.count < 3):
        return None
    column = (times or even)[0]
    no_time = {"time_column": None, "time_unit": "s", "left": [draft.called(column)]}
    called = names[column] or column + 1
    draft.ask(f"column {called} may be the time", {"the time": {}, "not the time, and not a taxel": no_time})
    return column


def _is_even(numbers: NDArray[np.float64]) -> bool:
    steps = np.diff(numbers)
    return bool(np.median(steps) > 0 and steps.max() <= 20 * np.median(steps))


def _unit_of_time(draft: Draft, column: int) -> str:
    """Return the unit of a column of times: as its name or unit says, by the years since 1970, or by usual rates."""
    own = draft.units[column]
    if stated := time_unit(draft.names[column]) or (time_unit(f"t {own}") if own else None):
        return stated
    unit, possible = unit_of_times(draft.fit.numbers(column))
    if possible:
        choices = {f"{each}: {hz:.4g} frames/s": {"time_unit": each} for each, hz in possible.items()}
        draft.ask("the unit of the time", choices)
    return unit


def taxels_of(draft: Draft, time: int | None) -> list[int]:
    """Return the columns of readings, and say why the others are none."""
    fit, names, left, table = draft.fit, draft.names, draft.left, draft.table
    known = {
        place
        for column in (table.time_column, table.label_column)
        if column is not None
        for place in places_of(names, "label_column", column)
    }
    for k in range(len(names)):
        why = "" if k in known or k in left else next(filter(None, _reasons(draft, k, first=int(time == 0))), "")
        if why:
            left[k] = why
    taxels = [k for k in range(len(names)) if k not in known and k not in left]
    if not taxels:
        # A sensor may have one taxel, and its name be that of a state.
        taxels = [k for k in left if fit.types[k] == "number" and left[k].startswith(("labels", "another quantity"))]
        for k in taxels:
            del left[k]
    return _of_one_unit(draft, taxels)


def _reasons(draft: Draft, column: int, first: int) -> Iterator[str]:
    """Yield why a column is no taxel, by its cells, or by its name; the first that is not "" counts."""
    fit, name = draft.fit, draft.names[column]
    kind, cells = fit.types[column], [cell for cell in fit.cells(column) if cell not in MISSING]
    few, reads = len(set(cells)) <= _KEYS, f"; label_column = {draft.called(column)!r} reads them"
    is_time = time_unit(name) is not None and len(name) > 1
    if kind == "day":
        yield "a date"
    if kind == "text":
        other = OTHER[fit.decimal]
        if cells and all(is_number(cell, other, fit.decimal) for cell in cells):
            called, marks = draft.called(column), ("points", "commas")
            why = f"decimal {marks[other == ',']} in column {called}, {marks[other == '.']} in others"
            draft.ask(f"{why}; save it with one", {f"without {called}": {}})
            yield "decimal marks that others have not"
        if not is_time and not few and all(map(_GLUED.match, cells)):
            called = draft.called(column)
            draft.ask(f"column {called} has numbers with other text, as {cells[0]!r}", {f"without {called}": {}})
        in_turn = 3 * sum(a != b for a, b in pairwise(cells)) > len(cells)
        is_whole = len(cells) == len(fit.body) and not column_names.is_label(name)
        is_key = is_whole and few and (column_names.is_key(name) or (in_turn and len(set(cells)) > 1))
        yield "times in a form that taxel does not read" * is_time
        yield _key(draft, column) if is_key else ""
        yield f"texts{reads * (len(set(cells)) > 1)}"
    if kind == "time" or is_time or (name and fit.ascends(column) and fit.epoch(column)):
        yield "another time"
    numbers = fit.numbers(column)
    whole = bool((numbers[np.isfinite(numbers)] % 1 == 0).all())
    # A column that counts lines, which no reading does: unnamed among columns with names, or in many lines.
    is_sure = len(fit.body) >= (2 if any(draft.names) and not name else _COUNTS)
    counts = column == first and is_sure and kind == "number" and fit.counts(column)
    if counts or (column_names.is_counter(name) and whole):
        yield "a counter"
    yield f"labels{reads}" * (column_names.is_label(name) and few)
    if column_names.is_key(name) and whole:
        # Lines of one time may be of many taxels.
        yield _key(draft, column) if few or 2 * len(set(cells)) <= len(cells) else "a counter"
    yield "another quantity" * column_names.is_other(name, draft.units[column])


def _key(draft: Draft, column: int) -> str:
    """Note that a column names the sensor or the taxel of each line; return why it is no taxel."""
    fit = draft.fit
    keys = set(fit.cells(column))
    before = column - 1
    if before >= 0 and fit.types[before] == "number" and not draft.names[before]:
        pairs = set(zip(fit.cells(before), fit.cells(column), strict=True))
        if len(pairs) == len(keys) == len(set(fit.cells(before))) > 1:
            draft.left[before] = "the same as the column that names the sensor"
    if len(keys) > 1 or draft.key is None:
        draft.key = column
    return f"always {next(iter(keys))}" if len(keys) == 1 else "by"


def by_key(draft: Draft, time: int | None, taxels: list[int], all_lines: Callable[[], Iterable[str]]) -> list[int]:
    """Return the columns of readings where another names the taxel or the sensor of each line; if it is open, ask.

    If each time has one reading of each key, these are the taxels of an array.
    """
    fit, called = draft.fit, draft.called
    grid = _grid(draft, taxels)
    keys = [] if draft.key is None and not grid else grid or [draft.key or 0]
    if not keys:
        return taxels
    values = [k for k in taxels if k not in keys]
    texts = [" ".join(cells) for cells in zip(*map(fit.cells, keys), strict=True)]
    known = sorted(set(texts))
    times = fit.cells(time) if time is not None else []
    pairs = len(set(zip(times, texts, strict=False)))
    # The last frame may be a part.
    is_whole = pairs == len(texts) and len(set(times)) * len(known) - pairs < len(known)
    of_taxels = bool(grid) or column_names.names_taxels(draft.names[keys[0]])
    if len(values) == 1 and len(known) > 1 and is_whole and of_taxels:
        sizes = [len(set(fit.cells(k))) for k in keys]
        draft.size = (sizes[0], sizes[1]) if len(keys) > 1 and sizes[0] * sizes[1] == len(known) else None
        draft.left = {k: why for k, why in draft.left.items() if k not in keys}
        name = "+".join(str(called(k)) for k in keys)
        draft.set(taxel_column=name if len(keys) > 1 else called(keys[0]))
        draft.said.append(f"a taxel for each {name}")
        return values
    if grid or (len(known) == 1 and all(known[0] in line or not any(map(str.isdigit, line)) for line in all_lines())):
        return taxels
    key = called(keys[0])
    choices: dict[str, Changes] = {f"a source for each: by = {key!r}": {"by": key, "read": [key]}}
    if len(taxels) == 1 and times and (len(known) == 1 or pairs > len(set(times))):
        choices[f"a taxel for each: taxel_column = {key!r}"] = {"taxel_column": key, "read": [key]}
    shown = ", ".join(known[:4]) + ", ..." * (len(known) > 4 or len(known) == 1)
    draft.left[keys[0]] = "by"
    draft.ask(f"column {key} is {shown} in turn", {**choices, "all lines are of one sensor": {}}, first=True)
    return taxels


def _grid(draft: Draft, taxels: Sequence[int]) -> list[int]:
    """Return the columns of the row and the column of the taxel that a line is of, beside its reading; else none."""
    by_name = {draft.names[k].lower(): k for k in taxels}
    pairs = (("row", "col"), ("row", "column"), ("y", "x"))
    return next(([by_name[a], by_name[b]] for a, b in pairs if len(taxels) == 3 and {a, b} < set(by_name)), [])


def _of_one_unit(draft: Draft, taxels: list[int]) -> list[int]:
    """Return the columns in the unit of most, of a force or pressure if there is one; leave out those of others."""
    units = Counter(draft.units[k] for k in taxels if draft.units[k])
    forces = Counter({unit: count for unit, count in units.items() if column_names.is_force(unit)})
    (unit, count), *others = (forces or units).most_common() or [("", 0)]
    if not unit:
        return taxels
    if others and others[0][1] == count:
        other = others[0][0]
        moved, kept = ([draft.called(k) for k in taxels if draft.units[k] == each] for each in (unit, other))
        choices: dict[str, Changes] = {unit: {}, other: {"unit": other, "left": moved, "read": kept}}
        draft.ask(f"readings in {unit} or in {other}", choices)
    draft.left.update({k: f"in {draft.units[k]}" for k in taxels if draft.units[k] not in ("", unit)})
    return [k for k in taxels if k not in draft.left]


def are_events(draft: Draft, time: int | None, taxels: Sequence[int]) -> bool:
    """Return whether lines are events, by the names of the columns; where four have none and may be events, ask.

    The rate of events says nothing of the unit of their times, as that of frames does: without a name it is asked.
    """
    fit, units = draft.fit, ("us", "ms", "s")
    called = {EVENT_COLUMNS.get(name, name): k for k in taxels for name in [draft.names[k].lower()]}
    named = [called[name] for name in "xyp" if name in called]
    if time is not None and len(taxels) == len(named) == 3 and _are_places(fit, named):
        draft.set(events=True)
        draft.answer("the unit of the time")
        if not (time_unit(draft.names[time]) or fit.types[time] == "time" or fit.epoch(time)):
            likely = units[:2] if bool((fit.numbers(time) % 1 == 0).all()) else units[:0:-1]
            draft.ask("the unit of the time of the events", {unit: {"time_unit": unit} for unit in likely})
        return True
    for order in ("txyp", "xypt") if fit.count == 4 and not any(draft.names) else ():
        ascends = bool((np.diff(fit.numbers(order.index("t"))) >= 0).all())
        if ascends and _are_places(fit, [order.index(name) for name in "xyp"], polarities=2):
            events = {"columns": list(order), "time_column": "t", "time_unit": "us", "leave_out": [], "events": True}
            draft.ask("frames or events", {"frames of taxels": {}, "events, in us": events}, first=True)
            break
    return False


def _are_places(fit: Fit, columns: Sequence[int], polarities: int = 1) -> bool:
    """Return whether columns hold places, and so many polarities or two."""
    x, y, p = map(fit.numbers, columns)
    places, values = np.concatenate([x, y]), set(p.tolist())
    are_whole = bool((places >= 0).all() and (places % 1 == 0).all())
    return are_whole and polarities <= len(values) <= 2 and values <= {1.0, -1.0 if -1.0 in values else 0.0}


def said_of(draft: Draft, time: int | None) -> Iterator[str]:
    """Yield how lines and columns were read, and which columns were left out and why."""
    table = draft.table
    marks = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks", "|": "bars"}
    kinds = {"marked": "marks and names between cells", "json": "lines of JSON", "hex": "hexadecimal"}
    yield kinds.get(table.lines, f"separated by {marks.get(table.separator, table.separator)}")
    if table.decimal == ",":
        yield "decimal commas"
    if table.thousands is not None:
        yield f"thousands by {table.thousands!r}"
    if time is not None:
        yield f"time {table.time_column!r} in {table.time_unit}"
    else:
        yield "no times" if table.frame_time is None else f"time in {table.frame_time} above each frame"
    if table.label_column is not None:
        yield f"labels {table.label_column!r}"
    used = [draft.units[k] for k in range(len(draft.units)) if k not in draft.left and k != time]
    yield from (f"unit {unit}" for unit in sorted(filter(None, used))[:1])
    reasons: dict[str, list[str]] = {}
    for k, why in sorted(draft.left.items()):
        reasons.setdefault(why, []).append(draft.names[k] or f"column {k + 1}")
    for why, names in reasons.items():
        shown = ", ".join(islice(names, 8)) + ", ..." * (len(names) > 8)
        yield f"{shown} left out: {why}"
