"""The role of each column of a table: the time and its unit, taxels, events, labels; what is none, and why."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.table_text import Text
from taxel.formats.column_names import FORCES, OTHER_UNITS, axes_of, is_time, says, time_unit, unit_of
from taxel.formats.form import Form, left_out, places_of
from taxel.formats.layout import Layout, Table
from taxel.formats.line_fits import Fit
from taxel.formats.lines import MISSING, OTHER, is_number
from taxel.formats.parts import KEYS
from taxel.formats.roles import FIRST, LIKELY, OPEN, SURE, Changes, Question, Role, named, of_unit
from taxel.formats.times import ISO, ODD, unit_of_times

#: So many lines show that an unnamed column ascends as times do, that one counts lines, and what values stay.
_ASCENDS, _COUNTS, _STAYS = 8, 20, 40
#: So many whole values are those of labels.
_LABELS = 5
#: Of so many columns each block is tried as the parts of a total; of more those that begin at the first.
_BLOCKS = 64
#: So many columns with names that differ in a number are a series.
_SERIES = 4
#: A number with other text behind it, which is no date, time or address.
_GLUED = re.compile(r"[-+]?\d+(?:[.,]\d+)?[ \t]*[^\s\d:/.,-]")
#: Hours and minutes, or as well minutes and seconds.
_TWO_NUMBERS = re.compile(r"\d{1,2}:\d\d", re.ASCII)
#: Names of the columns of events: a place, or the number of a taxel, and whether it rises, or falls.
EVENT_COLUMNS = {"col": "x", "column": "x", "row": "y", "pol": "p", "polarity": "p", "on": "p"}
EVENT_COLUMNS |= dict.fromkeys(("address", "addr", "taxel_id"), "taxel")


@dataclass
class Draft:
    """Hold what is understood of a table as it is looked at: its layout, the role of each column, what is open."""

    fit: Fit
    table: Table
    names: tuple[str, ...]
    #: Of the columns; none: as their names say.
    units: tuple[str, ...]
    #: What is stated of it.
    layout: Layout
    said: list[str] = field(default_factory=list)
    questions: list[Question] = field(default_factory=list)
    #: The column that names the sensor or the taxel of each line; rows and columns of taxels that two columns name.
    key: int | None = None
    size: tuple[int, int] | None = None
    #: Number of lines of a frame, 0 if only an empty line, or one of text, shows it.
    lines: int = 1

    def __post_init__(self) -> None:
        self.units = self.units or tuple(map(unit_of, self.names))
        has_end = self.table.frame_end is not None or self.table.frame_begin is not None
        self.lines = 0 if has_end else self.table.frame_lines or 1
        self.roles = [
            Role(name or f"column {k + 1}", self.fit.cells(k)[:FIRST], unit=unit)
            for k, (name, unit) in enumerate(zip(self.names, self.units, strict=True))
        ]

    @property
    def left(self) -> dict[int, str]:
        """Why each column is left out that is."""
        return {k: role.why for k, role in enumerate(self.roles) if role.is_left}

    @property
    def taxels(self) -> list[int]:
        """The columns of readings."""
        return [k for k, role in enumerate(self.roles) if role.role == "taxel"]

    @cached_property
    def stated_left(self) -> set[int]:
        """The columns that the layout leaves out."""
        return set() if self.layout.table is None else left_out(self.names, self.layout.table)

    def is_stated(self, *keys: str) -> bool:
        """Return whether the layout states one of these keys."""
        return not self.layout.stated.isdisjoint(keys)

    def called(self, column: int) -> str | int:
        """Return how a layout names a column: by its name, or, without a name of its own, by its number from 1."""
        name = self.names[column]
        return name if name and self._counts[name] == 1 else column + 1

    @cached_property
    def _counts(self) -> Counter[str]:
        return Counter(self.names)

    def be(self, role: str, why: str, *columns: int, certainty: str = LIKELY) -> None:
        """Give columns their role; what is open stays open."""
        for k in columns:
            doubt = OPEN if self.roles[k].certainty == OPEN else certainty
            self.roles[k] = replace(self.roles[k], role=role, why=why, certainty=doubt)

    def ask(self, why: str, keys: str, choices: Mapping[str, Changes], *columns: int, first: bool = False) -> None:
        """Ask: what is open, the keys that answer it, what each answer changes, and of which columns (`add`)."""
        self.add(Question(why, frozenset(keys.split()), choices), *columns, first=first)

    def add(self, question: Question, *columns: int, first: bool = False) -> None:
        """Add a question about columns, unless it is answered; the `first` one is printed with its layouts."""
        if question.keys & self.layout.stated:
            return
        self.questions.insert(0 if first else len(self.questions), question)
        for k in columns:
            self.roles[k].certainty = OPEN
            self.roles[k].why = self.roles[k].why or question.why

    def answer(self, key: str) -> None:
        """Remove the questions that a key answers, as something else does."""
        self.questions = [each for each in self.questions if key not in each.keys]

    def set(self, **keys: Any) -> None:
        """Set keys of the table."""
        self.table = replace(self.table, **keys)

    def form(self, said: Sequence[str]) -> Form:
        """Return how lines are read by it."""
        fit, lines = self.fit, self.table.frame_lines or self.lines
        return Form(self.table, self.names, fit.first, tuple(said), fit.own, lines, self.roles, fit)


def time_of(draft: Draft, *, by_name: bool = False) -> int | None:
    """Return the column of times that is stated or fits best, and say its unit; None without one.

    With `by_name` it is one by its name or its cells alone.
    """
    fit, names = draft.fit, draft.names
    is_stated, stated, others = draft.is_stated("time_column"), draft.table.time_column, list[int]()
    places = places_of(names, "time_column", stated) if is_stated and stated else ()
    draft.be("time", "stated", *places, certainty=SURE)
    column = next(iter(places), None)
    if not is_stated:
        column, others = _named_time(draft)
        if column is None and draft.table.frame_time is None and not by_name and fit.kind != "hex":
            column = _unnamed_time(draft)
    if column is None:
        return None
    draft.be("no taxel", "another time", *others)
    if not draft.is_stated("time_unit"):
        is_text = fit.types[column] == "time"
        draft.set(time_unit=ISO if is_text else "s" if len(places) > 1 else _unit_of_time(draft, column))
        if is_text and all(map(_TWO_NUMBERS.fullmatch, fit.cells(column))):
            example = fit.cells(column)[-1]
            why = f"{example} may be hours and minutes, or minutes and seconds, which must be written 0:{example:0>5}"
            draft.ask(why, "time_unit", {"hours and minutes": {"time_unit": ISO}}, column)
    if is_stated:
        return column
    is_sure = is_time(names[column]) and fit.ascends(column)
    draft.be("time", draft.roles[column].why or "named so", column, certainty=SURE if is_sure else LIKELY)
    draft.set(time_column=draft.called(column))
    if _has_milliseconds(fit, column):
        draft.set(time_column=f"{draft.called(column)}+{draft.called(column + 1)}")
        draft.be("time", "milliseconds behind a comma", column + 1)
        return column
    seconds = next((k for k in (column, column - 1) if _has_nanoseconds(draft, k)), None)
    if seconds is None:
        return column
    draft.set(time_column=f"{draft.called(seconds)}+{draft.called(seconds + 1)}", time_unit="s")
    draft.be("time", "seconds and nanoseconds", seconds, seconds + 1, certainty=SURE)
    draft.answer("time_unit")
    return seconds


def _named_time(draft: Draft) -> tuple[int | None, list[int]]:
    """Return the column that is the time by its name or its cells, and others that are times too."""
    fit, names, left = draft.fit, draft.names, draft.stated_left
    scores: dict[int, int] = {}
    for k in range(len(names)):
        if fit.types[k] not in ("number", "time") or k in left:
            continue
        # A letter may be the name of a taxel too: it is the time where it comes first, or ascends.
        is_called = is_time(names[k]) and (k == 0 or len(names[k]) > 1)
        if is_called or (time_unit(names[k]) is not None and fit.ascends(k)):
            scores[k] = 3 + is_called + 2 * fit.ascends(k)
        elif fit.types[k] == "time":
            scores[k] = 3
        elif draft.table.frame_time is None and fit.count > 1 and fit.ascends(k) and fit.epoch(k):
            scores[k] = 2
    # Of two clocks one may be in whole seconds.
    best = max(scores, key=lambda k: (scores[k], 2 * len(set(fit.cells(k))) > len(fit.body), -k), default=None)
    return best, [k for k in scores if k != best and scores[k] >= 4]


def _has_milliseconds(fit: Fit, column: int) -> bool:
    """Return whether the column after one of times in whole seconds has their milliseconds, which a comma separates."""
    if fit.separator != "," or fit.types[column] != "time" or column + 1 >= fit.count:
        return False
    whole = all(cell.count(":") == 2 and not {".", ","} & {*cell[-4:]} for cell in fit.cells(column))
    return whole and all(len(cell) == 3 and cell.isdecimal() for cell in fit.cells(column + 1))


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
        frames = {"rounded times": {"frame_lines": 1}, "lines of one frame": {"frame_lines": size}}
        draft.ask(f"{size} lines have the same time", "frame_lines frame_end frame_begin", frames)


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
    even = [k for k in even if not names[k] or (len(fit.body) >= _ASCENDS and not says("counter", names[k]))]
    even = sorted({*even} - draft.stated_left)
    times = [k for k in even if not fit.counts(k)]
    few = len(fit.body) < _ASCENDS
    if len(times) == len(even) == 1 and not few and not names[times[0]]:
        draft.be("time", "ascends evenly", times[0])
        draft.said.append(f"column {times[0] + 1} ascends")
        return times[0]
    if not even or len(even) > 2 or (few and (fit.count < 3 or draft.is_stated("rate_hz"))):
        return None
    column = (times or even)[0]
    choices: dict[str, Changes] = {
        "the time": {"time_column": draft.called(column)},
        "not the time, and not a taxel": {"time_column": 0, "left": [draft.called(column)]},
        "a taxel": {"time_column": 0},
    }
    draft.be("time", "ascends", column, certainty=OPEN)
    draft.ask(f"column {names[column] or column + 1} may be the time", "time_column", choices, first=True)
    return column


def _is_even(numbers: NDArray[np.float64]) -> bool:
    """Return whether a column ascends in like steps but for a few pauses."""
    steps = np.diff(numbers)
    usual = np.median(steps)
    return bool(usual > 0 and (steps > 20 * usual).mean() <= 0.02)


def _unit_of_time(draft: Draft, column: int) -> str:
    """Return the unit of a column of times: as its name or unit says, by the years since 1970, or by usual rates."""
    own = draft.units[column]
    if stated := time_unit(draft.names[column]) or (time_unit(f"t {own}") if own else None):
        return stated
    unit, possible = unit_of_times(draft.fit.numbers(column))
    if possible:
        draft.add(of_unit(possible), column)
    return unit


def find_taxels(draft: Draft) -> None:
    """Say which columns hold readings, and why the others hold none."""
    fit, names, table = draft.fit, draft.names, draft.table
    for key, role in (("label_column", "label"), ("by", "sensor"), ("taxel_column", "taxel's name")):
        stated = getattr(table, key)
        places = places_of(names, key, stated) if stated else ()
        draft.be(role, "stated", *places, certainty=SURE)
    if draft.is_stated("leave_out", "keep"):
        others = [k for k, role in enumerate(draft.roles) if role.role in ("taxel", "no taxel")]
        for k in others:
            is_taxel = k not in draft.stated_left and table.keeps(names[k])
            draft.be("taxel" if is_taxel else "no taxel", "stated", k, certainty=SURE)
        return
    first = int(draft.roles[0].role == "time")
    for k in draft.taxels:
        # Another column may have said what this one is.
        role, why = next((each for each in _reasons(draft, k, first) if each[1]), ("", ""))
        if why and not draft.roles[k].is_left:
            draft.be(role, why, k)
    if not draft.taxels:
        # A sensor may have one taxel, and its name be that of a state.
        of_state = ("labels", "another quantity")
        named = (k for k, why in draft.left.items() if fit.types[k] == "number" and why.startswith(of_state))
        draft.be("taxel", "", *named)
    _leave_out_other_units(draft)


def _reasons(draft: Draft, column: int, first: int) -> Iterator[tuple[str, str]]:
    """Yield what a column is that is no taxel, and why, by its cells or its name; the first with a reason counts."""
    fit, name = draft.fit, draft.names[column]
    kind, cells = fit.types[column], [cell for cell in fit.cells(column) if cell not in MISSING]
    few, reads = len(set(cells)) <= KEYS, f"; label_column = {draft.called(column)!r} reads them"
    of_time = time_unit(name) is not None and len(name) > 1
    if kind == "day":
        yield "no taxel", "a date"
    if kind == "text":
        other, called = OTHER[fit.decimal], draft.called(column)
        alone = {f"without {called}": {"left": [called]}}
        if cells and all(is_number(cell, other, fit.decimal) for cell in cells):
            marks = ("points", "commas")
            why = f"decimal {marks[other == ',']} in column {called}, {marks[other == '.']} in others"
            draft.ask(f"{why}; save it with one", "leave_out", alone, column)
            yield "no taxel", "decimal marks that others have not"
        if not of_time and not few and all(map(_GLUED.match, cells)):
            draft.ask(f"column {called} has numbers with other text, as {cells[0]!r}", "leave_out", alone, column)
        in_turn = 3 * sum(a != b for a, b in pairwise(cells)) > len(cells)
        is_whole = len(cells) == len(fit.body) and not says("label", name)
        is_key = is_whole and few and (says("sensor", name) or (in_turn and len(set(cells)) > 1))
        yield "no taxel", "times in a form that taxel does not read" * of_time
        yield "sensor", _key(draft, column) if is_key else ""
        yield "label", f"texts{reads * (len(set(cells)) > 1)}"
    if kind == "time" or of_time or (name and fit.ascends(column) and fit.epoch(column)):
        yield "no taxel", "another time"
    numbers = fit.numbers(column)
    whole = bool((numbers[np.isfinite(numbers)] % 1 == 0).all())
    # A column that counts lines, which no reading does: unnamed among columns with names, or in many lines.
    is_sure = len(fit.body) >= (2 if any(draft.names) and not name else _COUNTS)
    counts = column == first and is_sure and kind == "number" and fit.counts(column)
    # An index may be a finger.
    few_lines = len(fit.body) < _ASCENDS
    may_count = few_lines or len(set(cells)) == 1 or bool((np.diff(numbers) > 0).mean() >= 0.2)
    if counts or (says("counter", name) and whole and may_count):
        yield "counter", "a counter"
    yield "label", f"labels{reads}" * (says("label", name) and few)
    if says("sensor", name) and whole:
        # Lines of one time may be of many taxels.
        is_clock = _rises(fit, column) and _is_even(numbers) and not fit.counts(column)
        repeats = few or 2 * len(set(cells)) <= len(cells)
        yield "sensor", _key(draft, column) if repeats else "" if is_clock else "a counter"
    is_other = says("other", name) or OTHER_UNITS.fullmatch(draft.units[column]) is not None
    yield "no taxel", "another quantity" * is_other


def _key(draft: Draft, column: int) -> str:
    """Note that a column names the sensor or the taxel of each line; return why it is no taxel."""
    fit = draft.fit
    keys = set(fit.cells(column))
    before = column - 1
    if before >= 0 and fit.types[before] == "number" and not draft.names[before]:
        pairs = set(zip(fit.cells(before), fit.cells(column), strict=True))
        if len(pairs) == len(keys) == len(set(fit.cells(before))) > 1:
            draft.be("no taxel", "the same as the column that names the sensor", before)
    if len(keys) > 1 or draft.key is None:
        draft.key = column
    return f"always {next(iter(keys))}" if len(keys) == 1 else "by"


def by_key(draft: Draft, time: int | None, all_lines: Callable[[], Iterable[str]]) -> None:
    """Say what lines are of which a column names the taxel or the sensor; if it is open, ask.

    If each time has one reading of each key, these are the taxels of an array.
    """
    fit, called, taxels = draft.fit, draft.called, draft.taxels
    if time is not None and _addresses(draft, time):
        return
    grid = _grid(draft, taxels)
    keys = [] if draft.key is None and not grid else grid or [draft.key or 0]
    if not keys or draft.is_stated("by", "taxel_column", "leave_out", "keep"):
        return
    values = [k for k in taxels if k not in keys]
    texts = [" ".join(cells) for cells in zip(*map(fit.cells, keys), strict=True)]
    known = sorted(set(texts))
    times = fit.cells(time) if time is not None else []
    pairs = len(set(zip(times, texts, strict=False)))
    # The last frame may be a part.
    is_whole = pairs == len(texts) and len(set(times)) * len(known) - pairs < len(known)
    of_taxels = bool(grid) or says("taxel", draft.names[keys[0]])
    if len(values) == 1 and len(known) > 1 and is_whole and of_taxels:
        sizes = [len(set(fit.cells(k))) for k in keys]
        draft.size = (sizes[0], sizes[1]) if len(keys) > 1 and sizes[0] * sizes[1] == len(known) else None
        draft.be("taxel's name", "each time has a reading of each", *keys)
        name = "+".join(str(called(k)) for k in keys)
        draft.set(taxel_column=name if len(keys) > 1 else called(keys[0]))
        draft.said.append(f"a taxel for each {name}")
        return
    if grid or (len(known) == 1 and all(known[0] in line or not any(map(str.isdigit, line)) for line in all_lines())):
        return
    key = called(keys[0])
    choices: dict[str, Changes] = {f"a source for each: by = {key!r}": {"by": key, "read": [key]}}
    if len(taxels) == 1 and times and (len(known) == 1 or pairs > len(set(times))):
        choices[f"a taxel for each: taxel_column = {key!r}"] = {"taxel_column": key, "read": [key]}
    shown = ", ".join(known[:4]) + ", ..." * (len(known) > 4 or len(known) == 1)
    draft.be("sensor", f"{shown} in turn", keys[0])
    one: Changes = {"by": 0}
    draft.ask(
        f"column {key} is {shown} in turn",
        "by taxel_column",
        {**choices, "all lines are of one sensor": one},
        keys[0],
        first=True,
    )


def _grid(draft: Draft, taxels: Sequence[int]) -> list[int]:
    """Return the columns of the row and the column of the taxel that a line is of, beside its reading; else none."""
    by_name = {draft.names[k].lower(): k for k in taxels}
    pairs = (("row", "col"), ("row", "column"), ("y", "x"))
    return next(([by_name[a], by_name[b]] for a, b in pairs if len(taxels) == 3 and {a, b} < set(by_name)), [])


def _leave_out_other_units(draft: Draft) -> None:
    """Keep the columns in the unit that is stated or of most, of a force or pressure if there is one."""
    taxels = draft.taxels
    units = Counter(draft.units[k] for k in taxels if draft.units[k])
    forces = Counter({unit: count for unit, count in units.items() if FORCES.fullmatch(unit)})
    (unit, count), *others = (forces or units).most_common() or [("", 0)]
    if draft.layout.unit in units:
        unit, others = draft.layout.unit or "", []
    if others and others[0][1] == count:
        other = others[0][0]
        moved, kept = ([draft.called(k) for k in taxels if draft.units[k] == each] for each in (unit, other))
        choices: dict[str, Changes] = {unit: {"unit": unit}, other: {"unit": other, "left": moved, "read": kept}}
        draft.ask(f"readings in {unit} or in {other}", "unit", choices, *(k for k in taxels if draft.units[k]))
    for k in taxels:
        if draft.units[k] not in ("", unit):
            draft.be("no taxel", f"in {draft.units[k]}", k)


def by_values(draft: Draft, time: int | None, text: Text) -> None:
    """Say which columns hold something else than readings by their values; ask of those that may.

    The values are those of the first lines and of some over the whole text. A column of a series, whose names differ in
    a number, is one as the others are.
    """
    taxels = draft.taxels
    stems = [re.sub(r"\d+", "#", name) for name in draft.names]
    counts = Counter(stems[k] for k in taxels)
    series = [k for k in taxels if not draft.names[k] or counts[stems[k]] >= _SERIES]
    alone = [k for k in taxels if draft.fit.types[k] == "number" and k not in {*series}]
    alone += [k for k in series[-1:] if not draft.names[k]]
    alone = alone if len(alone) <= _BLOCKS else []
    are_axes = axes_of([draft.names[k] for k in taxels]) is not None
    if draft.is_stated("leave_out", "keep") or len(taxels) < 3 or are_axes or draft.table.has_lines:
        return
    fit = draft.fit.over(text.spread) if alone else draft.fit
    whole = np.column_stack([fit.wide(k) for k in taxels]) if alone else np.empty((0, len(taxels)))
    usual = np.median([len(set(fit.cells(k))) for k in taxels[:: 1 + len(taxels) // 64]])
    labels, strays = list[int](), list[int]()
    for k in alone:
        at, steps = taxels.index(k), np.diff(fit.numbers(k))
        numbers = whole[:, at]
        values, few = set(numbers[np.isfinite(numbers)].tolist()), len(steps) < _COUNTS
        is_total = not few and _is_total(whole, at)
        if not few and time is not None and _rises(fit, k) and _is_even(fit.numbers(k)):
            _ask_of_two_times(draft, time, k)
        elif not few and (steps == 1).mean() >= 0.95:
            draft.be("counter", "counts up by one", k)
        elif is_total:
            draft.be("total", "the sum or mean of others", k)
        elif not few and len(values) == 1:
            draft.be("taxel", f"always {fit.cells(k)[0]}", k)
        elif (
            len(steps) >= _STAYS
            and len(values) <= _LABELS < usual / 2
            and all(value % 1 == 0 for value in values)
            and (steps != 0).mean() <= 1 / 8
        ):
            draft.be("label", "few whole values that stay", k, certainty=OPEN)
            labels.append(k)
        elif draft.names[k] and len(series) >= _SERIES:
            draft.be("taxel", "named otherwise than the others", k, certainty=OPEN)
            strays.append(k)
        if fit.spread and not (few or is_total) and _is_total(whole[: len(fit.body)], at):
            draft.said.append(f"{draft.called(k)} is the sum or mean of others in the first lines alone")
    if asked := [*labels, *strays]:
        called, out = [draft.called(k) for k in labels], [draft.called(k) for k in strays]
        choices: dict[str, Changes] = {f"leave out {named([*map(str, [*called, *out])])}": {"left": out}}
        for label in called[:1]:
            choices[f"{label} has labels"] = {"label_column": label, "read": [label], "left": out}
        choices["they are taxels too"] = {"read": called}
        what = ", ".join(f"{draft.called(k)} ({draft.roles[k].why})" for k in asked[:8])
        draft.ask(f"may be no taxels: {what}", "leave_out keep", choices, *asked)


def say_contradictions(draft: Draft, text: Text) -> None:
    """Say which columns hold in later lines what contradicts their role by the first: labels, keys, times, counters."""
    fit = draft.fit
    texts = {k for k, role in enumerate(draft.roles) if role.role in ("label", "sensor") and role.certainty == LIKELY}
    rising = {k for k, role in enumerate(draft.roles) if role.role in ("time", "counter") and fit.types[k] == "number"}
    rising = {k for k in rising if not (np.diff(fit.numbers(k)) < 0).any()}
    # To read the cells of wide lines takes long, and a part shows whether times ascend.
    later = text.spread if texts else text.spread[:: 1 + fit.count // 12] if rising else ()
    rows = [[cells[k] for k in (*texts, *rising)] for cells in fit.cells_in(later)]
    for k, cells in zip((*texts, *rising), zip(*rows, strict=True), strict=False):
        called, others = draft.called(k), {*cells} - {*fit.cells(k)} - {*MISSING}
        if k in texts and len(others) > KEYS:
            example = named(sorted(others)[:2])
            draft.said.append(f"{called} has {len(others)} other values in later lines, as {example}")
        elif k in rising and (~(np.diff([*map(fit.number, cells)]) >= 0)).sum() > ODD * len(cells):
            draft.said.append(f"{called}, the {draft.roles[k].role} by the first lines, does not ascend in later ones")


def _ask_of_two_times(draft: Draft, time: int, other: int) -> None:
    """Leave out a column that ascends evenly beside the time; where the time repeats, ask which it is."""
    draft.be("counter" if draft.fit.counts(other) else "no taxel", "ascends evenly, as a time does", other)
    if 2 * len(set(draft.fit.cells(time))) <= len(draft.fit.body) and not draft.fit.counts(other):
        old, new = draft.called(time), draft.called(other)
        choices: dict[str, Changes] = {
            f"{new} is the time": {"time_column": new, "time_unit": None, "read": [new], "left": [old]},
            f"{old} is the time": {"time_column": old},
        }
        draft.ask(f"column {old} repeats, and {new} ascends evenly", "time_column", choices, time, other)


def _is_total(values: NDArray[np.float64], at: int) -> bool:
    """Return whether a column is the sum or the mean of others side by side; all have shape (lines, n)."""
    own, others = values[:, at], np.delete(values, at, axis=1)
    others = others[:, ~np.isnan(others).all(axis=0)]
    sound = np.isfinite(own) & np.isfinite(others).all(axis=1)
    own, sums = own[sound, None], np.cumsum(np.pad(others[sound], ((0, 0), (1, 0))), axis=1)
    near, count = 0.02 * float(own.std()) if len(own) else 0.0, sums.shape[1] - 1
    for begin in range(count - 1 if count <= _BLOCKS else 1) if near else ():
        block = sums[:, begin + 2 :] - sums[:, [begin]]
        sizes = np.arange(2, block.shape[1] + 2)
        if any(bool((np.abs(each - own).max(axis=0) <= near).any()) for each in (block, block / sizes)):
            return True
    return False


def are_events(draft: Draft, time: int | None) -> bool:
    """Return whether lines are events, by the names of the columns; where four have none and may be events, ask.

    The rate of events says nothing of the unit of their times, as that of frames does: without a name it is asked.
    """
    addresses = [] if time is None else _addresses(draft, time)
    draft.be("taxel", "", *addresses)
    fit, taxels, units = draft.fit, draft.taxels, ("us", "ms", "s")
    choices: dict[str, Changes]
    called = {EVENT_COLUMNS.get(name, name): k for k in taxels for name in [draft.names[k].lower()]}
    named = [called[name] for name in "xyp" if name in called]
    if time is not None and (addresses or (len(taxels) == len(named) == 3 and _are_places(fit, named))):
        draft.set(events=True)
        draft.answer("time_unit")
        if not draft.is_stated("time_unit") and not (
            time_unit(draft.names[time]) or fit.types[time] == "time" or fit.epoch(time)
        ):
            likely = units[:2] if bool((fit.numbers(time) % 1 == 0).all()) else units[:0:-1]
            choices = {unit: {"time_unit": unit} for unit in likely}
            draft.ask("the unit of the time of the events", "time_unit", choices, time)
        return True
    for order in ("txyp", "xypt") if fit.count == 4 and not any(draft.names) else ():
        ascends = bool((np.diff(fit.numbers(order.index("t"))) >= 0).all())
        if ascends and _are_places(fit, [order.index(name) for name in "xyp"], polarities=2):
            events = {"columns": list(order), "time_column": "t", "time_unit": "us", "leave_out": [], "events": True}
            choices = {"frames of taxels": {"events": False}, "events, in us": events}
            draft.ask("frames or events", "events", choices, first=True)
            break
    return False


def _addresses(draft: Draft, time: int) -> list[int]:
    """Return the columns of the taxel and the polarity of events, if a table has only these beside the time."""
    others = {draft.names[k].lower(): k for k in range(len(draft.names)) if k != time and k not in draft.stated_left}
    called = {EVENT_COLUMNS.get(name, name): k for name, k in others.items()}
    places = [called[name] for name in ("taxel", "p", "is_negative") if name in called]
    if "taxel" not in called or not len(places) == len(others) == 2:
        return []
    is_number = all(draft.fit.types[k] == "number" for k in places)
    return places if is_number and _are_places(draft.fit, [places[0], *places]) else []


def _are_places(fit: Fit, columns: Sequence[int], polarities: int = 1) -> bool:
    """Return whether columns hold places, and so many polarities or two."""
    x, y, p = map(fit.numbers, columns)
    places, values = np.concatenate([x, y]), set(p.tolist())
    are_whole = bool((places >= 0).all() and (places % 1 == 0).all())
    return are_whole and polarities <= len(values) <= 2 and values <= {1.0, -1.0 if -1.0 in values else 0.0}


def said_of(draft: Draft, time: int | None) -> Iterator[str]:
    """Yield how lines and columns were read, and which columns were left out and why; only this of a stated table."""
    table = draft.table
    marks = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks", "|": "bars"}
    kinds = {"marked": "marks and names between cells", "json": "lines of JSON", "hex": "hexadecimal"}
    if draft.layout.table is None or draft.layout.source is not None:
        yield kinds.get(table.lines, f"separated by {marks.get(table.separator, table.separator)}")
        if table.decimal == ",":
            yield "decimal commas"
        if table.thousands is not None:
            yield f"thousands by {table.thousands!r}"
        if time is not None:
            yield f"time {table.time_column!r} in {table.time_unit}"
        else:
            without = "no times" if draft.layout.source is None else "a frame's time is when it arrived"
            yield without if table.frame_time is None else f"time in {table.frame_time} above each frame"
        if table.label_column is not None:
            yield f"labels {table.label_column!r}"
        used = [role.unit for role in draft.roles if role.role == "taxel"]
        yield from (f"unit {unit}" for unit in sorted(filter(None, used))[:1])
    reasons: dict[str, list[str]] = {}
    for role in draft.roles:
        if role.certainty == LIKELY and role.role != "time" and role.why:
            reasons.setdefault(f"{role.why}" if role.role == "taxel" else f"left out: {role.why}", []).append(role.name)
    for why, names in reasons.items():
        yield f"{named(names)} {why}"
