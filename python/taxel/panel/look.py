"""What the columns and axes of a stranger's file are, as the page shows it: roles, what changes each, and a picture."""

from __future__ import annotations

import math
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import integer
from taxel._base.arrays import ARRAYS, shapes
from taxel._base.errors import refused
from taxel._base.messages import collected, counted, first_line
from taxel._base.table_text import Text
from taxel._core import Error, FormatError, ProblemError
from taxel.formats.column_names import AXIS_CHOICES
from taxel.formats.form import Form
from taxel.formats.layout import (
    AXES_OF_ARRAYS,
    Data,
    Layout,
    PrintedFrames,
    Table,
    changed,
    layout_name,
    of_layout,
    without,
)
from taxel.formats.line_fits import Fit
from taxel.formats.parts import parts_of
from taxel.formats.roles import OPEN, Changes, OpenRolesError, Question, Role
from taxel.formats.table_form import form_of
from taxel.formats.times import ISO, UNITS_US
from taxel.live.line_frames import array_of
from taxel.live.stated_source import with_layout
from taxel.recording.kinds import kind_of, takes_layout
from taxel.recording.opening import open_all, sensors

#: So many columns are listed, answers assumed to show a reading, points of a curve, and sensors of a picture.
_LISTED, _ANSWERED, _POINTS, _PICTURES = 200, 8, 80, 4
#: A picture is taken of so many values at most, and a map has so many.
_VALUES, _MAP = 1 << 23, 1 << 16
#: What a column may be beside a taxel, the key of a layout that names it, and its value for none.
_KEYS: dict[str, tuple[str, int | None]] = {
    "time": ("time_column", 0),
    "label": ("label_column", None),
    "sensor": ("by", 0),
    "taxel's name": ("taxel_column", None),
}
_LEFT = "left out"
#: What a change may name.
_MAY = {key.name for kind in (Table, Data) for key in fields(kind)}
_MAY |= {"left", "read", "rows", "columns", "unit", "falls", "rate_hz", "axis"}


@dataclass
class Found:
    """Hold how a file is read by a layout: what was found, what is open, and the whole by the first answers."""

    layout: Layout
    roles: Sequence[Role]
    questions: Sequence[Question]
    whole: Layout | None
    form: Form | None = None

    @property
    def taxels(self) -> int:
        """How many taxels a frame has; 0 where that does not show."""
        if self.form is not None:
            return len(self.form.taxels) * self.form.lines
        inner = [int(role.first[0]) for role in self.roles if role.axis and role.role in ("row", "column", "taxel")]
        return math.prod(inner) if inner else 0

    @property
    def stated(self) -> Layout:
        """The layout without what is open."""
        return without(self.layout, _keys_of(self.questions))

    def changed(self, changes: Changes) -> Layout:
        """Return the layout with other keys, without what is open then.

        Raises
        ------
        ProblemError : a key or a value that it cannot have
        """
        wrong = changes.keys() - _MAY or [k for k in ("left", "read") if not isinstance(changes.get(k, []), list)]
        if wrong:
            raise refused("changes", f": {sorted(wrong)[0]!r} must be as `look` offers it")
        size = {key: changes[key] for key in ("rows", "columns") if not isinstance(changes.get(key, ()), Sequence)}
        others = {key: value for key, value in changes.items() if key not in size}
        for key, other in (("rows", "columns"), ("columns", "rows")):
            if len(size) == 1 and key in size and self.taxels:
                size[other] = None if size[key] is None else self.taxels // integer(key, size[key], 1)
                if size[other] is not None and size[other] * size[key] != self.taxels:
                    raise refused("changes", f": {self.taxels} taxels are not {size[key]} {key} of as many each")
        said = {*others} | ({"leave_out"} if {"left", "read"} & {*others} else set())
        layout = changed(replace(self.layout, **size), others)
        return without(layout, _keys_of([each for each in self.questions if not each.keys & said]) - said)


class Looks:
    """Look at files of strangers, and at the first lines of live sources; the text of the last one is kept."""

    def __init__(self) -> None:
        self._last: tuple[object, Text] | None = None
        #: The folder with the first lines of the last live source, by its text.
        self._heard: dict[str, tempfile.TemporaryDirectory[str]] = {}

    def hear(self, source: str, lines: Sequence[str]) -> None:
        """Keep the first lines of a live source as a file that `look` looks at."""
        self._heard = {source: tempfile.TemporaryDirectory(prefix="taxel-")}
        Path(self._heard[source].name, "lines.txt").write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")

    def heard(self, name: str) -> tuple[Path, Layout] | None:
        """Return the file of the first lines of a live source, and a layout that says so; None of another name."""
        if name not in self._heard:
            return None
        path = Path(self._heard[name].name, "lines.txt")
        return path, Layout(path.with_suffix(".layout.toml"), source=PrintedFrames(name.partition(",")[0]))

    def source(self, name: str, text: str) -> str:
        """Return a live source that was heard with what a layout states of it.

        Raises
        ------
        ProblemError : nothing was heard of it, or something is open
        """
        if (heard := self.heard(name)) is None:
            raise refused("source", ": its lines were not looked at")
        form, _, whole = self._read(heard[0], "table", Layout.of_text(heard[1].path, text))
        assert form is not None  # it is a table
        return with_layout(name, form, whole)

    def look(
        self, path: Path, layout: Layout, changes: Changes, name: str | None = None
    ) -> tuple[dict[str, Any], Layout | None]:
        """Return what the message `look` says of a file by a layout that is changed, and the whole layout.

        Raises
        ------
        FormatError : it cannot be read so, whatever the answers to what is open
        ProblemError : it states its sensor itself; a change that makes no sense
        """
        is_live = layout.source is not None
        kind = "table" if is_live else kind_of(path)
        if kind is None or not (is_live or takes_layout(path)):
            raise ProblemError(f"{path.name}: states its sensor itself, so no roles can be chosen")
        found = self._found(path, kind, layout)
        if changes:
            text = of_layout(found.changed(changes))
            found = self._found(path, kind, Layout.of_text(layout.path, text))
        roles = _of_columns(found, self._text(path)) if kind == "table" else _of_arrays(found, is_set=path.is_dir())
        listed = [k for k, role in enumerate(found.roles) if role.role != "taxel" or role.certainty == OPEN]
        taxels = [k for k, role in enumerate(found.roles) if k not in {*listed}]
        shown = sorted((listed + taxels[:64])[:_LISTED])
        return {
            "type": "look",
            "name": name or path.name,
            "text": of_layout(found.stated),
            "roles": [roles(k) for k in shown],
            "more": len(found.roles) - len(shown),
            "questions": [{"why": each.why, "choices": dict(each.choices)} for each in found.questions],
            "fields": [*_fields(found, kind, self._sheets(path), path)],
            "said": [] if found.form is None else list(found.form.said),
            "files": [] if is_live else [layout_beside(path, folder=folder).name for folder in (False, True)],
        }, found.whole

    def _text(self, path: Path) -> Text:
        """Return the text of a table, whose first lines were read if it is as it was."""
        state = path, path.stat().st_size, path.stat().st_mtime_ns
        if self._last is None or self._last[0] != state:
            self._last = state, Text(path)
        return self._last[1]

    def _sheets(self, path: Path) -> list[str]:
        return [] if path.suffix.lower() in ARRAYS or path.is_dir() else [*self._text(path).sheets]

    def _found(self, path: Path, kind: str, layout: Layout) -> Found:
        """Return how a file is read; each question that is open has its first answer in the whole."""
        asked: OpenRolesError | None = None
        for _ in range(_ANSWERED):
            try:
                form, roles, whole = self._read(path, kind, layout)
            except OpenRolesError as error:
                asked = asked or error
                first, *others = error.questions
                answered = changed(error.layout, next(iter(first.choices.values())))
                layout = without(answered, _keys_of(others) - first.keys)
            except FormatError:
                if asked is None:
                    raise
                break
            else:
                if asked is None:
                    return Found(whole, roles, [], whole, form)
                return Found(asked.layout, asked.roles, asked.questions, whole, form)
        return Found(asked.layout, asked.roles, asked.questions, None) if asked else Found(layout, [], [], None)

    def _read(self, path: Path, kind: str, layout: Layout) -> tuple[Form | None, Sequence[Role], Layout]:
        """Return the form of a table, the roles, and the whole layout; of a file of several tables those of the first.

        Raises
        ------
        OpenRolesError : something is open
        FormatError : it cannot be read so
        """
        if kind == "table":
            text = next(iter(parts_of(self._text(path), layout.table)[0].values()))
            form, whole = form_of(text, layout)
            return form, form.roles, whole
        with collected():
            facts = open_all(path, layout=layout)[0]._main.facts  # type: ignore[arg-type]
        return None, [Role(**role) for role in facts.roles], Layout.of_text(layout.path, facts.layout)


def picture(path: Path, layout: Layout, name: str) -> dict[str, Any]:
    """Return what the message `seen` says of a file by its whole layout: the sensors, and a curve and a map of each."""
    message: dict[str, Any] = {"type": "seen", "name": name, "sensors": [], "said": []}
    try:
        with collected() as said:
            recordings = open_all(path, layout=layout)  # type: ignore[arg-type]
    except (Error, OSError) as error:
        return message | {"said": [first_line(error)], "refused": True}
    several = [f"{counted(len(recordings), 'trial')}; the first is shown"] if len(recordings) > 1 else []
    for sensor in sensors(recordings[0])[:_PICTURES]:
        if sensor.has_events:
            events, shape = sensor.events, sensor.array.shape
            count = np.zeros(shape, np.float32)
            np.add.at(count, (events.y, events.x), 1)
            begin, end = (int(events.t[0]), int(events.t[-1]) + 1) if len(events) else (0, 1)
            over = np.histogram(events.t, _POINTS, (begin, end))[0].astype(np.float64)
            about = f"{counted(len(events), 'event')}, {(end - begin) / 1e6:g} s"
            message["sensors"].append(sensor_of(sensor.label, count, over, about))
            continue
        frames = sensor.frames()
        length = f", {(int(frames.t[-1]) - int(frames.t[0])) / 1e6:g} s" if sensor.timed and len(frames) else ""
        about = f"{counted(len(frames), 'frame')}{length}"
        message["sensors"].append(sensor_of(sensor.label, *deviation(frames.values), about))
    return message | {"said": [*several, *(text.removeprefix(f"{path.name}: ") for text in said)], "refused": False}


def deviation(values: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return by how much taxels differ from their median where all do most, and the sum of that over time.

    Parameters
    ----------
    values : float32, shape (frames, rows, columns), NaN where a value is missing
    """
    part = np.nan_to_num(values[:: 1 + values.size // _VALUES])
    if not len(part):
        return np.zeros(values.shape[1:], np.float32), np.zeros(0)
    far = np.abs(part - np.median(part, axis=0))
    sums = far.sum(axis=(1, 2), dtype=np.float64)
    return far[int(np.argmax(sums))], sums


def sensor_of(name: str, values: NDArray[Any], over: NDArray[np.float64], about: str) -> dict[str, Any]:
    """Return a sensor of a picture: its size, its map in 255 steps, and its curve."""
    rows, columns = values.shape
    top = float(values.max(initial=0.0))
    steps = np.rint(values.ravel() * (255 / top if top else 0)).astype(int)
    levels = steps.tolist() if steps.size <= _MAP else []
    return {"name": name, "rows": rows, "columns": columns, "levels": levels, "curve": curve(over), "about": about}


def curve(numbers: NDArray[np.float64]) -> list[int]:
    """Return the least and the greatest of each part of a curve in turn, in 255 steps; -1 where it has no value."""
    finite = numbers[np.isfinite(numbers)]
    if not len(finite):
        return []
    least, extent = float(finite.min()), float(np.ptp(finite)) or 1.0
    points = list[int]()
    for part in np.array_split((numbers - least) / extent * 255, min(_POINTS, len(numbers))):
        there = part[np.isfinite(part)]
        points += [int(there.min()), int(there.max())] if len(there) else [-1, -1]
    return points


def over_file(fit: Fit, text: Text, column: int) -> NDArray[np.float64]:
    """Return numbers of a column that are spread evenly over a file, or of its first lines."""
    numbers, count = fit.wide(column), len(fit.body)
    rest = len(numbers) - count
    if not rest:
        return numbers
    share = sum(map(len, text.head)) / text.path.stat().st_size
    first = np.linspace(0, count - 1, max(1, round(rest * share))).astype(int)
    return np.concatenate([numbers[first], numbers[count:]])


def _of_columns(found: Found, text: Text) -> Any:
    """Return a function that returns a column of a table as the page shows it."""
    names = Counter(role.name for role in found.roles)
    called = [
        k + 1 if names[role.name] > 1 or role.name == f"column {k + 1}" else role.name
        for k, role in enumerate(found.roles)
    ]
    table, unit, open_keys = found.layout.table, found.layout.unit or "", _keys_of(found.questions)
    time_unit = "" if table is None or "time_unit" in open_keys else table.time_unit
    fit = None if found.form is None or found.form.fit is None else found.form.fit.over(text.spread)
    units = {each: {"time_unit": each} for each in (*UNITS_US, ISO)}

    def as_(k: int, role: str) -> Changes:
        """Return what gives a column a role; another column with it is left out."""
        own, now = _KEYS.get(found.roles[k].role), found.roles[k].role
        changes: dict[str, Any] = {} if own is None or now == role else {own[0]: own[1]}
        if role not in _KEYS:
            return changes | ({"left": [called[k]]} if role == _LEFT else {"read": [called[k]]})
        before = [called[other] for other, each in enumerate(found.roles) if each.role == role and other != k]
        changes |= {_KEYS[role][0]: called[k], "read": [called[k]], "left": before}
        return changes | ({"time_unit": None} if role == "time" else {})

    def of(k: int) -> dict[str, Any]:
        role = found.roles[k]
        menu = {each: as_(k, each) for each in ("taxel", *_KEYS, _LEFT)}
        is_time = role.role == "time"
        why = role.why if role.role in menu or role.role == "no taxel" else f"{role.role}: {role.why}"
        about = {"role": role.role if role.role in menu else _LEFT, "menu": menu, "why": why}
        about |= {"units": units if is_time else {}, "unit": time_unit if is_time else role.unit}
        about |= {"unit": role.unit or unit} if role.role == "taxel" else {}
        fits = fit is not None and k < fit.count
        return asdict(role) | about | {"curve": curve(over_file(fit, text, k)) if fits and fit is not None else []}

    return of


def _of_arrays(found: Found, *, is_set: bool) -> Any:
    """Return a function that returns an axis of the array of frames, another array, or a feature of a data set."""
    how = found.layout.data
    named = "" if how is None else how.axes or ""
    axes = named.split()
    sizes = [int(role.first[0]) for role in found.roles if role.axis]

    def counting(k: int, word: str) -> str:
        """Return what axes count if one counts something: it changes with another that does; one is the time."""
        like = ("taxel", "column") if word in ("taxel", "column") else (word,)
        made = [axes[k] if each in like else each for each in axes]
        made[k] = word
        if "time" not in made:
            made[max((j for j in range(len(made)) if j != k), key=lambda j: sizes[j])] = "time"
        return " ".join(made)

    def of(k: int) -> dict[str, Any]:
        role = found.roles[k]
        menu: dict[str, Changes] = {_LEFT: {"time": None}, "time": {"time": role.name, "time_unit": None}}
        if role.axis:
            menu = {word: {"axes": counting(k, word)} for word in AXES_OF_ARRAYS}
        elif role.certainty == OPEN or (is_set and role.role != "time"):
            menu = {"frames": {"array": role.name}}
        shown = "frames" if is_set and role.role == "taxel" else role.role if role.role in menu else _LEFT
        shown = "" if role.certainty == OPEN and not role.axis else shown
        return asdict(role) | {"role": shown, "menu": menu, "units": {}, "curve": []}

    return of


def _fields(found: Found, kind: str, sheets: Sequence[str], path: Path) -> Iterator[dict[str, Any]]:
    """Yield what else can be said of a file: a choice of changes each, or a value of a key."""
    layout, table, data = found.layout, found.layout.table, found.layout.data
    yield from (_choice(question.why, None, question.choices) for question in found.questions)
    is_timed = any(role.role == "time" and not role.axis for role in found.roles)
    if len(sheets) > 1 and table is not None:
        choices: dict[str, Changes] = {"all like the largest": {"sheet": None}, **{s: {"sheet": s} for s in sheets}}
        yield _choice("Sheet", table.sheet or "all like the largest", choices)
    if kind == "arrays" and data is not None:
        many = [name for name, shape in shapes(path).items() if 1 < len(shape) <= 4]
        if len(many) > 1:
            again = dict.fromkeys(("axes", "time", "time_unit"))
            is_open = "array" in _keys_of(found.questions)
            yield _choice("Frames", "" if is_open else data.array, {name: {**again, "array": name} for name in many})
        if is_timed:
            units = {unit: {"time_unit": unit} for unit in UNITS_US}
            yield _choice("Unit of the time", "" if "time_unit" in _keys_of(found.questions) else data.time_unit, units)
    if layout.axis is not None:
        yield _choice("Axes", layout.axis, {each: {"axis": each} for each in AXIS_CHOICES})
    rows, columns, guess = layout.rows, layout.columns, ""
    if layout.source is not None and rows is None and found.form is not None and found.form.lines:
        (rows, columns), guess = array_of(found.form, None, None, "")[0].shape, " (a guess)"
    yield {"label": f"Rows{guess}", "key": "rows", "value": rows, "number": True}
    yield {"label": f"Columns{guess}", "key": "columns", "value": columns, "number": True}
    yield {"label": "Unit of the readings", "key": "unit", "value": layout.unit, "number": False}
    falls: dict[str, Changes] = {"rise": {"falls": None}, "fall": {"falls": True}}
    yield _choice("With pressure they", "fall" if layout.turned is not None else "rise", falls)
    if not is_timed:
        yield {"label": "Frames per second", "key": "rate_hz", "value": layout.rate_hz, "number": True}
    if kind == "table" and table is not None:
        yield {"label": "Only taxels named", "key": "keep", "value": table.keep, "number": False}


def _choice(label: str, value: str | None, choices: Mapping[str, Changes]) -> dict[str, Any]:
    return {"label": label, "value": value, "choices": dict(choices)}


def _keys_of(questions: Sequence[Question]) -> frozenset[str]:
    """Return the keys that answer questions."""
    return frozenset[str]().union(*(question.keys for question in questions))


def layout_beside(path: Path, *, folder: bool) -> Path:
    """Return the path of the layout file of a recording, or of that of all recordings of its folder."""
    return path.with_name("layout.toml" if folder else layout_name(path))
