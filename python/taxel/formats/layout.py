"""Layout files: the facts that a recording lacks, in one TOML file beside it.

A layout states the rows, columns, pitch or places, side and heel of a sensor; whether readings fall with pressure,
their unit, their rate and what was before the first; and how to read a table or an array of another program. The keys
are listed in docs/files.md.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from taxel._base.arguments import finite, flag, instance, integer, mapping, several, shown, text
from taxel._base.documents import of_toml, read_toml
from taxel._base.errors import refused
from taxel._base.files import beside, named
from taxel._base.limits import VALUE
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array, Places
from taxel.formats.column_names import AXIS_CHOICES
from taxel.formats.event_camera import Reduction
from taxel.formats.lines import KINDS, THOUSANDS
from taxel.formats.times import ISO, UNITS_US


@dataclass(frozen=True)
class Table:
    """Say how to read a table of text: frames, a line or several each, a column a taxel; or events, a line each.

    Parameters
    ----------
    separator : str
        Between cells; " " stands for any number of blanks.
    decimal : {".", ","}
        Character before the decimals of a number.
    skip_lines : int, 0 or more
        Lines before the names of the columns, or before the numbers if there are no names.
    columns : list of str, optional
        The names of the columns, for a table without names.
    time_column : str or int, optional
        The column of times, by its name or its number from 1; "A+B" is the sum of seconds and of nanoseconds within
        them, or of a time of day and the milliseconds behind a comma; 0: none.
    time_unit : {"s", "ms", "us", "ns", "min", "h", "iso"}
        "iso": texts as of ISO 8601, dates with times, of UTC where they state no zone, or times of a day;
        days with points (01.05.2024 10:15:02,010), with slashes and the year first (2024/5/1 10:15:02) and with the
        month by its name (01-May-2024 10:15:02) too, and, with AM or PM, with slashes, the month first.
    missing : str or list of str, optional
        Further cells without a value, beside those of `taxel.formats.lines.MISSING`.
    thousands : str, optional
        Character between the thousands of a number: 1.234,5 has "."; default: none.
    leave_out : list of str or int
        The columns that are not taxels, by name or number from 1, which may hold texts. All others are taxels.
    keep : str, optional
        A pattern of the names of the columns that are taxels, as "l*_z"; default: all that are not left out.
    label_column : str or int, optional
        A column whose value becomes a label where it changes; it is no taxel.
    by : str or int, optional
        A column that says which sensor a line is of: each of its values is a source; it is no taxel. 0: none.
    taxel_column : str or int, optional
        A column that says which taxel a line is of, whose reading is in the only other column: the lines of one time
        are a frame. "A+B": two columns, the row and the column of the taxel.
    sheet : str, optional
        The sheet of a workbook that is read; default: those with the columns of the largest, each a source.
    lines : {"plain", "marked", "json", "hex"}
        "marked": brackets, quotes, arrows and ``NAME:`` are between cells too, and a unit may be behind a number;
        "json": a line is an object or a list of JSON, whose columns have the names of its keys; "hex": cells are
        hexadecimal numbers.
    frame_lines : int, 1 or more, optional
        Number of lines of a frame, whose first line has its time; default: 1.
    frame_end : {"blank"}, optional
        An empty line ends a frame.
    frame_begin : str, optional
        Beginning of the line of text above each frame, for example "Frame"; empty lines may then be between frames too.
    frame_time : {"s", "ms", "us", "ns", "min", "h"}, optional
        The last number in the line above each frame is its time, in this unit.
    events : bool
        Whether each line is an event, in the columns x, y and p (the polarity: 1 for more pressure, 0 or -1 for less).

    Raises
    ------
    ProblemError : a value of another kind
    """

    separator: str = ","
    decimal: str = "."
    skip_lines: int = 0
    columns: Sequence[str] = ()
    time_column: str | int | None = None
    time_unit: str = "s"
    missing: str | Sequence[str] | None = None
    thousands: str | None = None
    leave_out: Sequence[str | int] = ()
    keep: str | None = None
    label_column: str | int | None = None
    by: str | int | None = None
    taxel_column: str | int | None = None
    sheet: str | None = None
    lines: str = "plain"
    frame_lines: int | None = None
    frame_end: str | None = None
    frame_begin: str | None = None
    frame_time: str | None = None
    events: bool = False

    def __post_init__(self) -> None:
        if len(text("separator", self.separator)) != 1:
            raise refused("separator", f" is {shown(self.separator)}: must be one character")
        text("decimal", self.decimal, (".", ","))
        if self.thousands is not None and text("thousands", self.thousands, THOUSANDS) == self.decimal:
            raise refused("thousands", f" is {shown(self.thousands)}, as decimal is: must be another character")
        text("lines", self.lines, KINDS)
        text("time_unit", self.time_unit, (*UNITS_US, ISO))
        integer("skip_lines", self.skip_lines, 0)
        _check_columns(self, "time_column", "label_column", "by", "taxel_column", "columns", "leave_out")
        for name in ("keep", "sheet", "frame_begin"):
            if getattr(self, name) is not None:
                text(name, getattr(self, name))
        for cell in self.missing_texts:
            text("missing", cell)
        if self.frame_time is not None and text("frame_time", self.frame_time, UNITS_US) and self.frame_begin is None:
            raise refused("frame_time", " is given without frame_begin, the line that states it")
        if self.frame_begin is not None and not self.frame_begin.strip():
            raise refused("frame_begin", f" is {shown(self.frame_begin)}: must be a text")
        if self.frame_lines is not None:
            integer("frame_lines", self.frame_lines, 1, 65_535)
        if self.frame_end is not None:
            text("frame_end", self.frame_end, ("blank",))
        given = [name for name in ("frame_begin", "frame_end", "frame_lines") if getattr(self, name) is not None]
        if len(given) > 1:
            raise refused(given[0], f" is given together with {given[1]}: give only one of them")
        if flag("events", self.events) and (self.time_column is None or self.has_lines):
            raise refused("events", " is true: the table must have a time_column, and a line for each event")

    @property
    def has_lines(self) -> bool:
        """Whether a frame may have several lines."""
        return not (self.frame_lines is None and self.frame_end is None and self.frame_begin is None)

    @property
    def missing_texts(self) -> Sequence[str]:
        """The further cells without a value."""
        return [self.missing] if isinstance(self.missing, str) else () if self.missing is None else self.missing

    def keeps(self, name: str) -> bool:
        """Whether a column of this name may be a taxel."""
        return self.keep is None or fnmatchcase(name, self.keep)


def _check_columns(how: Any, *keys: str) -> None:
    """Refuse anything except the names of columns or their numbers from 1, or 0 for none."""
    for key in keys:
        value = getattr(how, key)
        if key == "leave_out" and isinstance(value, str):
            raise refused(key, f" is {shown(value)}: must be a list of columns")
        for column in several(key, value) if key in ("columns", "leave_out") else [value] * (value is not None):
            text(key, column) if isinstance(column, str) else integer(key, column, key not in ("time_column", "by"))


@dataclass(frozen=True)
class Data:
    """Name the array of another program's file that holds the frames; a .npy holds one array without a name.

    Parameters
    ----------
    array : str, optional
        Of shape (frames, rows, columns) or (frames, taxels); in a group of a .h5 by its path, "run1/pressure".
    time : str or int, optional
        An array with a time for each frame, or the number, from 1, of the taxel of the array that is the time; default:
        none.
    time_unit : {"s", "ms", "us", "ns", "min", "h"}
    axes : str, optional
        What each axis counts, in their order: "time", and of "trial", "row", "column", "taxel" and "axis" (x, y, z)
        those that there are, as "row time column"; default: the first counts frames.

    Raises
    ------
    ProblemError : a value of another kind
    """

    array: str | None = None
    time: str | int | None = None
    time_unit: str = "s"
    axes: str | None = None

    def __post_init__(self) -> None:
        if self.array is not None:
            text("array", self.array)
        _check_columns(self, "time")
        text("time_unit", self.time_unit, UNITS_US)
        if self.axes is not None:
            named = text("axes", self.axes).split()
            once = {"column" if name == "taxel" else name for name in named}
            if len(once) < len(named) or "time" not in named or not set(named) <= set(AXES_OF_ARRAYS):
                others = f"time and others of {', '.join(AXES_OF_ARRAYS)}, taxel without column"
                raise refused("axes", f" is {shown(self.axes)}: must be {others}")


@dataclass(frozen=True)
class PrintedFrames:
    """State where and how frames that a sensor prints are read; the keys are those of a source of `taxel.live.Live`.

    Parameters
    ----------
    place : str
        "serial:COM3", "lines:-" ...
    baud : int, optional
        Baud rate of a serial line.
    time : str, optional
        "t:ms", "1+2" ..., or "0", the time of arrival; default: a column that looks like it, else that of arrival.
    columns, leave_out : list of str or int
        The names of the columns; those without values.
    by : str or int, optional
        The column that names the sensor of each line, where several print to one place in turn.
    frame_lines : int, 1 or more, optional
        Number of lines of a frame.
    frame_end : {"blank"}, optional
        An empty line ends a frame.
    frame_begin, frame_time : str, optional
        As of `Table`: how the line of text above each frame begins, and the unit of the time in it.

    Raises
    ------
    ProblemError : a value of another kind
    """

    place: str
    baud: int | None = None
    time: str | None = None
    columns: Sequence[str] = ()
    leave_out: Sequence[str | int] = ()
    by: str | int | None = None
    frame_lines: int | None = None
    frame_end: str | None = None
    frame_begin: str | None = None
    frame_time: str | None = None

    def __post_init__(self) -> None:
        for name in ("place", "time", "frame_begin"):
            if getattr(self, name) is not None and "," in text(name, getattr(self, name)):
                raise refused(name, f" is {shown(getattr(self, name))}: must not contain a comma")
        if self.baud is not None:
            integer("baud", self.baud, 1)
        _ = self.layout

    @property
    def layout(self) -> Layout:
        """The same as the layout of a table of these lines."""
        time, _, unit = (self.time or "").partition(":")
        table = Table(
            columns=self.columns,
            leave_out=self.leave_out,
            by=self.by,
            time_column=0 if time == "0" else time or None,
            time_unit=unit or "s",
            frame_lines=self.frame_lines,
            frame_end=self.frame_end,
            frame_begin=self.frame_begin,
            frame_time=self.frame_time,
        )
        return Layout(Path(self.place), source=self, table=table, stated=frozenset(["time_unit"] if unit else []))


@dataclass(frozen=True)
class Topics:
    """Choose the topics of a ROS bag; the arguments are those of `taxel.open`.

    Parameters
    ----------
    topic, field : str or list of str, optional
    ros : str, optional
    by : str, optional
        A field whose value says which sensor a message is of: each value is a source; "": all are of one.
    array : Array or list of Array, optional
        As of `taxel.open`, which a layout file states by its rows and columns.

    Raises
    ------
    ProblemError : a value of another kind
    """

    topic: str | Sequence[str] | None = None
    field: str | Sequence[str] | None = None
    ros: str | None = None
    by: str | None = None
    array: Array | Sequence[Array] | None = None

    def __post_init__(self) -> None:
        for name in ("topic", "field", "ros", "by"):
            for entry in self.entries(name):
                text(name, entry)
        for entry in self.entries("array"):
            instance("array", entry, Array)

    def entries(self, name: str) -> list[Any]:
        """Return what is given of one of them as a list."""
        value = getattr(self, name)
        is_one = isinstance(value, str | Array) or name in ("ros", "by")
        return [] if value is None else [value] if is_one else [*several(name, value)]


@dataclass(frozen=True)
class Layout:
    """Hold the contents of a layout file.

    Parameters
    ----------
    path : Path
        The file, for errors.
    rows, columns : int, 1 or more, optional
        Both or neither.
    pitch_mm : float or (float, float), mm, optional
        As of `Array`.
    places : Places, optional
        A place for each taxel, row by row.
    side : {"left", "right"}, optional
        The foot or hand of the sensor. For a recording of the other foot the places are mirrored.
    heel : {"top", "bottom"}, optional
        Rows, or end of the places, at which the heel is.
    falls : bool or float, optional
        Whether readings fall with pressure, and are turned: to their negative, or, if it is a number, to that number
        minus the reading.
    unit : str, optional
        Unit of the readings, turned or not.
    rate_hz : float, Hz, above 0, optional
        Frames per second, if the recording has no times.
    axis : {"x", "y", "z", "shear", "all", "xyz"}, optional
        Of taxels with three axes: the axis that is read, the length of x and y, each axis as a source, or all axes as
        the channels of one sensor.
    zeros_before_s : float, s, above 0, at most 60, optional
        Time that the sensor read 0 before recordings whose first frame is loaded, for example if a contact starts a
        trial.
    table : Table, optional
    data : Data, optional
    source : PrintedFrames, optional
        Source from which its frames are read live.
    ros : Topics, optional
        What is read of a ROS bag.
    event_camera : Reduction, optional
        What is read of an event camera's file.
    stated : frozenset of str
        The keys that it states, of its own, of its table or its data, also where their values are the defaults. What
        it does not state is found as without it.

    Raises
    ------
    ProblemError : a value of another kind, or values that contradict each other
    """

    path: Path
    rows: int | None = None
    columns: int | None = None
    pitch_mm: float | tuple[float, float] | None = None
    places: Places | None = None
    side: str = ""
    heel: str = ""
    falls: bool | float | None = None
    unit: str | None = None
    rate_hz: float | None = None
    axis: str | None = None
    zeros_before_s: float | None = None
    table: Table | None = None
    data: Data | None = None
    source: PrintedFrames | None = None
    ros: Topics | None = None
    event_camera: Reduction | None = None
    stated: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if (self.rows is None) != (self.columns is None):
            raise ProblemError("rows and columns: give both or neither")
        if self.side:
            text("side", self.side, ("left", "right"))
        if self.heel:
            text("heel", self.heel, ("top", "bottom"))
        if self.falls is not None and not isinstance(self.falls, bool):
            # Readings are subtracted from it, and values of frames have 32 bits.
            object.__setattr__(self, "falls", finite("falls", self.falls, least=-VALUE, most=VALUE))
        if self.unit is not None and not text("unit", self.unit):
            raise refused("unit", " is '': must be the unit of the readings")
        if self.rate_hz is not None:
            finite("rate_hz", self.rate_hz, least=1e-9, most=1e6)
        if self.axis is not None:
            text("axis", self.axis, AXIS_CHOICES)
        if self.zeros_before_s is not None:
            finite("zeros_before_s", self.zeros_before_s, least=1e-6, most=60.0)
        # Refuses a pitch beside places, and places of another number than rows x columns.
        self.array(self.places.x.size if self.places is not None else 1)
        differs = {key.name for key in fields(self) if getattr(self, key.name) != key.default}
        for inner in (self.table, self.data):
            if inner is not None:
                differs |= {key.name for key in fields(inner) if getattr(inner, key.name) not in (key.default, [])}
        object.__setattr__(self, "stated", self.stated | differs - {"path", "stated", "columns"})

    @classmethod
    def read(cls, path: Path) -> Layout:
        """Read a layout file.

        Parameters
        ----------
        path : Path

        Raises
        ------
        FormatError : not TOML, longer than 1 MiB, a key that is not known, or a value of another kind (names the key)
        OSError : the file cannot be read
        """
        return cls._of_document(path, read_toml(path))

    @classmethod
    def of_text(cls, path: Path, text: str) -> Layout:
        """Return the layout of a text that is to be written to a file.

        Raises
        ------
        FormatError : as of `read`
        """
        return cls._of_document(path, of_toml(str(path), text))

    @classmethod
    def _of_document(cls, path: Path, document: dict[str, Any]) -> Layout:
        try:
            return cls(path=path, **_values(document))
        except (ProblemError, TypeError) as error:
            raise FormatError(f"{path}: {first_line(error)}") from None

    @staticmethod
    def beside(path: Path) -> Path | None:
        """Return the layout file of a recording or a folder; None if there is none.

        Parameters
        ----------
        path : Path
            Beside ``walk.csv`` it is ``walk.layout.toml``, or, for all recordings of the folder, ``layout.toml``.

        Examples
        --------
        >>> Layout.beside(Path("a recording that is not there.csv")) is None
        True
        """
        folder = [path / "layout.toml"] if path.is_dir() else []
        for candidate in (beside(path, layout_name(named(path))), *folder, beside(path, "layout.toml")):
            if candidate.is_file():
                return candidate
        return None

    @property
    def turned(self) -> float | None:
        """The number that readings are subtracted from, as they fall with pressure; None if they do not."""
        return 0.0 if self.falls is True else None if self.falls is False or self.falls is None else self.falls

    def grid(self) -> Array | None:
        """Return a sensor of its rows and columns; None if it does not state them."""
        return None if self.rows is None or self.columns is None else Array(self.rows, self.columns)

    def array(self, taxels: int, stated: Array | None = None, side: str = "") -> Array:
        """Return the sensor that it describes.

        Parameters
        ----------
        taxels : int
            Number of taxels of the recording.
        stated : Array, optional
            The sensor that the recording states, whose name and taxels, with their names, are kept.
        side : {"left", "right", ""}
            The foot of the recording, if it is known.

        Raises
        ------
        ProblemError : another number of taxels than the recording holds
        """
        shape = (self.rows, self.columns) if self.rows is not None else (1, taxels) if stated is None else stated.shape
        rows, columns = (integer(name, n, 1, 65_535) for name, n in zip(("rows", "columns"), shape, strict=True))
        if stated is not None and rows * columns != stated.rows * stated.columns:
            raise ProblemError(
                f"the layout states {rows} x {columns} taxels; the recording has {stated.rows} x {stated.columns}"
            )
        places, is_mirrored = self.places, bool(self.side and side and self.side != side)
        if places is not None and is_mirrored:
            places = Places(-places.x, places.y, places.area, places.unit)
        exists = None if stated is None or stated.exists is None else stated.exists.reshape(rows, columns)
        name = f"{rows}x{columns}" if stated is None else stated.name
        return Array(rows, columns, self.pitch_mm, exists, name, places, None if stated is None else stated.names)


def advice(path: Path, does: str) -> str:
    """Return the end of an error: what to write in a layout file beside a recording, or given as `layout`.

    Examples
    --------
    >>> advice(Path("data/walk.csv.gz"), "describe the table")
    'describe the table in a layout file, walk.layout.toml beside it or another file given as layout (docs/files.md)'
    """
    return f"{does} in a layout file, {or_given(path)} (docs/files.md)"


def or_given(path: Path) -> str:
    """Return which layout file is read with a recording, as part of a sentence."""
    return f"{layout_name(path)} beside it or another file given as layout"


def layout_name(path: Path) -> str:
    """Return the name of the layout file of one recording."""
    return f"{path.name.removesuffix('.gz').rpartition('.')[0] or path.name}.layout.toml"


def _values(document: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a file by the names of the fields of `Layout`."""
    _known("", document)
    values: dict[str, Any] = {}
    for name, value in document.items():
        if name in _TABLES:
            inner = mapping(name, value)
            if name == "event_camera" and "window_ms" in inner:  # its name in older files
                inner = {"count_ms" if key == "window_ms" else key: each for key, each in inner.items()}
            _known(name, inner)
            kind = _TABLES[name]
            needed = [f.name for f in fields(kind) if f.default is f.default_factory is MISSING]
            if missing := [key for key in needed if key not in inner]:
                raise ProblemError(f"[{name}]: {missing[0]} is missing")
            try:
                values[name] = _TABLES[name](**inner)
            except (ProblemError, TypeError) as error:
                raise ProblemError(f"[{name}]: {first_line(error)}") from None
        else:
            values[name] = tuple(value) if name == "pitch_mm" and isinstance(value, list) else value
    within = (document[name] for name in ("table", "data") if name in document)
    return values | {"stated": frozenset(document).union(*within)}


#: The tables of a layout file by their names.
_TABLES: dict[str, type[Any]] = {
    "places": Places,
    "table": Table,
    "data": Data,
    "source": PrintedFrames,
    "ros": Topics,
    "event_camera": Reduction,
}


#: What axes of an array may count.
AXES_OF_ARRAYS = ("time", "trial", "row", "column", "taxel", "axis")


def _known(table: str, values: Mapping[str, Any]) -> None:
    """Refuse a key that a table has not, "" for those that are in none."""
    kind = _TABLES[table] if table else Layout
    names = [key.name for key in fields(kind) if key.name not in ("path", "stated", "array" if kind is Topics else "")]
    unknown = next((name for name in values if name not in names), None)
    if unknown is not None:
        place = f"{table}.{unknown}" if table else unknown
        raise ProblemError(f"{place} is not known: must be one of {', '.join(names)}")


def of_layout(layout: Layout) -> str:
    r"""Return the text of a layout file: the keys that differ from their defaults, or that it states.

    Examples
    --------
    >>> print(of_layout(Layout(Path("a.layout.toml"), unit="N", table=Table(separator=";", time_column=1))), end="")
    unit = "N"
    <BLANKLINE>
    [table]
    separator = ";"
    time_column = 1
    """
    own, tables = list[str](), list[str]()
    for key in fields(layout):
        value = getattr(layout, key.name)
        if key.name in ("path", "stated") or value in (None, ""):
            continue
        if is_dataclass(value):
            tables += ["", f"[{key.name}]", *_lines(value, layout.stated)]
        else:
            own.append(f"{key.name} = {_written(value)}")
    return "\n".join([*own, *tables] if own else tables[1:]) + "\n"


def _lines(values: Any, is_stated: frozenset[str]) -> list[str]:
    """Return the lines of a table of TOML."""
    every = ((key.name, _plain(getattr(values, key.name)), key.default) for key in fields(values))
    return [
        f"{name} = {_written(value)}"
        for name, value, default in every
        if value is not None and (name in is_stated or (value != default and value not in ([], ())))
    ]


def _plain(value: object) -> object:
    """Return a value as it is, but numbers of an array as a list."""
    return value.ravel().tolist() if isinstance(value, np.ndarray) else value


def _written(value: object) -> str:
    """Return a value as TOML has it: JSON has the same escapes, numbers and lists."""
    return json.dumps(value, ensure_ascii=False)


def changed(layout: Layout, changes: Mapping[str, Any]) -> Layout:
    """Return a layout with other keys, of its own, its table or its data, which it states, except those of nothing."""
    layout = without(layout, frozenset(key for key, value in changes.items() if value is None))
    changes = {key: value for key, value in changes.items() if value is not None}
    said = {key for key, value in changes.items() if value != []} - {"left", "read"}
    if layout.table is not None and {"left", "read"} & changes.keys():
        left = [column for column in layout.table.leave_out if column not in changes.get("read", ())]
        more = (column for column in changes.get("left", ()) if column not in left)
        changes, said = {**changes, "leave_out": [*left, *more]}, said | {"leave_out"}
    return _with(layout, changes, layout.stated | said)


def without(layout: Layout, keys: frozenset[str]) -> Layout:
    """Return a layout that does not state some keys."""
    defaults = {key.name: key.default for kind in (Table, Data, Layout) for key in fields(kind) if key.name in keys}
    return _with(layout, defaults, layout.stated - keys)


def _with(layout: Layout, values: Mapping[str, Any], stated: frozenset[str]) -> Layout:
    """Return a layout with other values of its keys and of those of its table and its data."""
    inner: dict[str, Any] = {}
    for name in ("table", "data"):
        if (there := getattr(layout, name)) is not None:
            keys = {key.name for key in fields(there)} & values.keys()
            inner[name] = replace(there, **{key: values[key] for key in keys})
    own = {key.name for key in fields(Layout)} & values.keys() - {"columns"}
    return replace(layout, **{key: values[key] for key in own}, **inner, stated=stated)
