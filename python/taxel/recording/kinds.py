"""What is a recording: the kinds of files in the order in which they are tried, and what of a folder counts."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, TypeAlias

from taxel import _core
from taxel._base.arguments import checked_path, flag, shown
from taxel._base.arrays import ARRAYS, fields_of, records_in, stored_names
from taxel._base.errors import refused
from taxel._base.messages import warn
from taxel._base.table_text import Text
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.array_file import look, read_array_file
from taxel.formats.event_camera import Reduction
from taxel.formats.foreign import is_bag, refuse_container
from taxel.formats.layout import Layout, Table, Topics, advice
from taxel.formats.parts import parts_of
from taxel.formats.table import ENDINGS as TABLES
from taxel.formats.table import read_table
from taxel.formats.table_form import form_of
from taxel.reading import ENDINGS, InMemory, Reader
from taxel.recording.beside import LABELS, is_label_table
from taxel.recording.files.columns import EVENTS, SENSOR, is_h5_of_taxel, is_table, read_columns, read_records
from taxel.recording.files.csv import head_of, is_of_taxel, read_csv
from taxel.recording.files.lsa import read_lsa
from taxel.recording.files.mcap import read_mcap
from taxel.recording.stated import check_size

#: A layout, the path of one, or None for the layout file beside a recording, if there is one.
GivenLayout: TypeAlias = str | os.PathLike[str] | Layout | None
#: Topics in a line for people, in rows below it, and as JSON holds them.
ListedTopics: TypeAlias = tuple[str, Sequence[Sequence[str]], dict[str, Any]]
#: Kinds of files of other programs, which a layout may describe.
FOREIGN = ("table", "arrays")
#: The endings of those that may be tables of labels.
_LABELS = (".csv", ".txt", ".tsv")
#: The endings of those that are something else in most folders.
_RARE = (".json", ".log")


@dataclass(frozen=True, kw_only=True)
class OpenOptions:
    """Hold the keyword arguments of `open_one`, which documents each, and of `open_all`."""

    array: Array | Sequence[Array] | None = None
    layout: str | os.PathLike[str] | None = None
    topic: str | Sequence[str] | None = None
    field: str | Sequence[str] | None = None
    ros: str | None = None
    region: str | None = None
    bin: int | None = None
    count_ms: float | None = None
    polarity: str | None = None
    label_column: str | int | None = None
    differences: bool = False

    @property
    def reduction(self) -> Reduction:
        """Selection of the events of a camera."""
        return Reduction(self.region, self.bin, self.count_ms, self.polarity)

    def in_layout(self, path: Path, layout: Layout | None, kind: Kind) -> Layout | None:
        """Return what a layout says with what is given: topics, the column of labels, a size that the file may lack.

        Raises
        ------
        ProblemError : what is only for files of another kind
        """
        flag("differences", self.differences)
        full, names = layout or Layout(path), ("topic", "field", "ros", "array")
        given = {name: getattr(self, name) for name in names if getattr(self, name) is not None}
        if getattr(kind, "topics", None) is not None:
            full = replace(full, ros=replace(full.ros or Topics(), **given)) if given else full
        elif not given.keys() <= {"array"}:
            raise ProblemError(f"{path}: is not a ROS bag; topic, field and ros are only for ROS bags")
        if self.label_column is not None and not getattr(kind, "has_labels", False):
            raise refused("label_column", f" is {shown(self.label_column)}: is only for tables; {path} is none")
        if self.label_column is not None:
            full = replace(full, table=replace(full.table or Table(), label_column=self.label_column))
        if getattr(kind, "has_size", False) and isinstance(self.array, Array):
            full = replace(full, rows=self.array.rows, columns=self.array.columns, places=None)
        return layout if full == Layout(path) else full


@dataclass(frozen=True)
class Kind:
    """Say how files of a kind are known, and how they are read.

    Other distributions add theirs by entry points of the group ``taxel.formats``: an object with these attributes.

    Parameters
    ----------
    knows : function of a path
        Returns whether a file, or a folder, is of this kind.
    read : function of a path and its layout, or None
        Returns a reader of each source; readers of one name are the sources of one recording.
    has_labels : bool, optional
        Whether it has columns of labels, of which one is the label_column in the [table] of the layout.
    has_size : bool, optional
        Whether a file may lack the size of its sensor, which the layout then has.
    topics : function of a path and of a release of ROS, or None, optional
        Returns what `[ros]` of the layout chooses from.
    """

    knows: Callable[[Path], bool]
    read: Callable[[Path, Layout | None], Sequence[Reader]]
    has_labels: bool = False
    has_size: bool = False
    topics: Callable[[Path, str | None], ListedTopics] | None = None


def kinds(options: OpenOptions | None = None) -> Iterator[tuple[str, Kind]]:
    """Yield the kinds of files with their names, in the order in which they are tried.

    Files that taxel writes come first, then formats of other distributions, which are looked for only if it is none.
    """
    how = OpenOptions() if options is None else options
    of_topics = isinstance(how.array, list | tuple) and all(isinstance(each, Array) for each in how.array)
    array = None if how.array is None or of_topics else Array._given(how.array)

    def read_arrays(path: Path, layout: Layout | None) -> Sequence[Reader]:
        return [_on_given(each, array) for each in read_array_file(path, layout or Layout(path))]

    def read_rows(path: Path, layout: Layout | None) -> Sequence[Reader]:
        return [_on_given(each, array) for each in read_table(path, layout or Layout(path), array)]

    def read_events(path: Path, layout: Layout | None) -> Sequence[Reader]:
        return [read_records(path, layout.grid() if array is None and layout is not None else array)]

    def read_npz(path: Path, layout: Layout | None) -> Sequence[Reader]:
        names = stored_names(path)
        # Other programs name their times t too.
        is_foreign = SENSOR not in names and layout is not None and layout.data is not None
        return read_arrays(path, layout) if is_foreign else [read_columns(path, array)]

    yield from {
        "lsa": Kind(_ending(".lsa"), lambda path, _: [read_lsa(path, array, differences=how.differences)]),
        "mcap": Kind(_is_mcap, lambda path, _: read_mcap(path)),
        "h5": Kind(is_h5_of_taxel, lambda path, _: [read_columns(path, array)]),
        "csv": Kind(_is_csv, lambda path, _: [read_csv(path, array)]),
        "records": Kind(lambda path: set(EVENTS) <= set(fields_of(path)), read_events),
    }.items()
    yield from _from_elsewhere().items()
    yield from {
        "npz": Kind(_is_npz, read_npz),
        "table": Kind(_is_table, read_rows, has_labels=True),
        "arrays": Kind(lambda path: _ending(*ARRAYS)(path) and not are_spike_trains(path), read_arrays),
    }.items()


@cache
def _from_elsewhere() -> dict[str, Kind]:
    """Return the formats of other distributions; warn of one that does not load."""
    found = {}
    for point in entry_points(group="taxel.formats"):
        try:
            found[point.name] = point.load()
        except Exception as error:
            warn(f"files of the format {point.name} are not read, as {point.value} does not load: {error}")
    return found


def _ending(*endings: str) -> Callable[[Path], bool]:
    """Return a function of whether a file, perhaps compressed by gzip, has one of some endings."""
    return lambda path: path.is_file() and Path(path.name.removesuffix(".gz")).suffix.lower() in endings


def _is_mcap(path: Path) -> bool:
    """Return whether a file is a .mcap by its ending or its first bytes; one of ROS is a bag."""
    if not path.is_file() or is_bag(path):
        return False
    with open(path, "rb") as file:
        return path.suffix.lower() == ".mcap" or file.read(8) == b"\x89MCAP0\r\n"


def _is_csv(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do; a table of labels is none."""
    is_csv = path.suffix.lower() == ".csv" and path.is_file()
    return is_csv and not is_label_table(path) and is_of_taxel(path)


def _is_npz(path: Path) -> bool:
    """Return whether a .npz holds the columns of a table; true of a damaged one, which opening it reports."""
    names = stored_names(path) if _ending(".npz")(path) else ("none",)
    return not names or is_table(names)


def _is_table(path: Path) -> bool:
    """Return whether a file is a table of text or of a spreadsheet, or an array of records."""
    if _ending(*ARRAYS)(path):
        return records_in(path) is not None
    return _ending(*TABLES)(path) and not (path.suffix.lower() in _LABELS and is_label_table(path))


def _on_given(reader: InMemory, array: Array | None) -> Reader:
    """Return frames of another program on the given sensor: as many rows and columns, or a row of as many channels.

    Raises
    ------
    ProblemError : another number of taxels, rows or columns
    """
    stated, table = reader.facts.array, reader.data
    if array is None or isinstance(table, Events):
        return reader
    if stated.shape != (1, array.rows * array.columns):
        check_size(reader.facts.path, stated.shape, array)
    says_more = array.shape != stated.shape or (array._is_measured and not stated._is_measured)
    return replace(reader, data=table._on(replace(array, names=array.names or stated.names))) if says_more else reader


def known(path: Path, options: OpenOptions | None = None) -> tuple[str, Kind]:
    """Return the format of a file or a folder with its name.

    Raises
    ------
    FormatError : no format knows it, or it is empty
    OSError : the path is not there, or cannot be read
    """
    path.stat()
    found = next(((name, kind) for name, kind in kinds(options) if kind.knows(path)), None)
    if found is None:
        raise unknown(path)
    # A recorder's file has begun.
    if path.is_file() and found[0] not in ("lsa", "mcap") and not path.stat().st_size:
        raise _empty(path)
    return found


def kind_of(path: Path) -> str | None:
    """Return the name of the format of a file or a folder; None if no format knows it.

    Raises
    ------
    OSError : the path is not there, or cannot be read
    """
    path.stat()
    return next((name for name, kind in kinds() if kind.knows(path)), None)


def takes_layout(path: Path) -> bool:
    """Return whether a layout says what of a path is read: of a table, of arrays, of a data set that is a folder."""
    kind = kind_of(path)
    return kind in FOREIGN or (kind not in (None, "ros") and path.is_dir())


def is_recording(path: Path, layout: GivenLayout = None) -> bool:
    """Return whether a path is a recording; what is damaged inside shows only when it is opened."""
    try:
        kind = kind_of(path)
        return kind is not None and (kind not in FOREIGN or _is_usual(path) or _describes(layout, path))
    except (FormatError, OSError):
        return False


def _describes(given: GivenLayout, path: Path) -> bool:
    """Return whether a layout is given or beside a file; one of arrays alone describes no text."""
    layout = layout_of(path, given)
    of_arrays = layout is not None and layout.data is not None and layout.table is None
    return layout is not None and (not of_arrays or path.suffix.lower() in ARRAYS)


def check_recording(path: Path, layout: GivenLayout = None) -> None:
    """Refuse a path that is not a recording by its name, its first bytes, and its layout file.

    Raises
    ------
    FormatError : no recording; an invalid layout file; a table or arrays that can be read in two ways
    """
    found = layout_of(path, layout)
    match known(path)[0]:
        case "mcap":
            _core.RecordingReader(path)
        case "csv":
            head_of(Text(path))
        case "table":
            how = found or Layout(path)
            for text in parts_of(Text(path), how.table)[0].values():
                form_of(text, how)
        case "arrays":
            look(path, found or Layout(path))


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder, and no recording by itself, as a ROS bag and a data set are."""
    return path.is_dir() and not is_bag(path) and not any(kind.knows(path) for kind in _from_elsewhere().values())


def layout_of(path: Path, layout: GivenLayout) -> Layout | None:
    """Return what the given layout file says, or the one beside a recording; None if there is none."""
    if isinstance(layout, Layout):
        return layout
    file = Layout.beside(path) if layout is None else Path(checked_path("layout", layout))
    return None if file is None else Layout.read(file)


def files_in(folder: Path) -> list[Path]:
    """Return the files and folders in a folder but its table of labels, in the order of their names: 2 before 10."""
    found = (file for file in folder.iterdir() if file.name != LABELS and (file.is_file() or file.is_dir()))
    return sorted(found, key=natural_order)


def recordings_in(folder: Path, layout: GivenLayout = None) -> list[Path]:
    """Return what of a folder is a recording, ROS bags last, in the order of the names: 2 before 10.

    Tables and arrays of other programs count in a folder that holds nothing else.
    """
    named = {file: kind for file in files_in(folder) if (kind := _kind_in_folder(file)) is not None}
    own = [file for file, kind in named.items() if kind in (*ENDINGS.values(), "records")]
    # An empty file beside others of its ending has lost its content: opening it says so.
    endings = {file.suffix for file in own}
    empty = [
        file for file, kind in named.items() if kind in FOREIGN and file.suffix in endings and not file.stat().st_size
    ]
    own = sorted([*own, *empty], key=natural_order)
    bags = [file for file, kind in named.items() if kind == "ros"]
    makers = [file for file, kind in named.items() if kind not in (*FOREIGN, "ros")]
    foreign = [] if bags else [file for file in named if named[file] in FOREIGN]
    tables = [file for file in foreign if _is_usual(file) or _describes(layout, file)]
    return [*(own or makers or tables), *bags]


def _kind_in_folder(file: Path) -> str | None:
    """Return the format of something in a folder; None of what cannot be read, and of folders that are no ROS bags."""
    try:
        return None if is_folder(file) else kind_of(file)
    except OSError:
        # Opening it raises the error.
        return ENDINGS.get(file.suffix.lower())


def _is_usual(file: Path) -> bool:
    """Return whether a table or an array is a recording of its folder, also without a layout file."""
    return Path(file.name.removesuffix(".gz")).suffix.lower() not in _RARE and not file.name.endswith(".notes.csv")


def natural_order(path: Path) -> list[tuple[bool, int, str]]:
    """Return the sort key of a name in natural order: 2 before 10."""
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in re.split(r"([0-9]+)", str(path))]


def are_spike_trains(path: Path) -> bool:
    """Return whether a file holds the arrays that `SpikeTrains.save` writes."""
    is_npz = path.suffix.lower() == ".npz" and path.is_file()
    return is_npz and {"times", "offsets", "start", "stop"} <= set(stored_names(path))


def unknown(path: Path) -> FormatError:
    """Return the error of a path that no format knows."""
    if path.suffix.lower() in _LABELS and is_label_table(path):
        return FormatError(f"{path}, line 1: a table of labels (docs/howto.md), not a recording")
    if are_spike_trains(path):
        return FormatError(
            f"{path}: contains spike trains, not a recording; to read them in Python, call taxel.SpikeTrains.load"
        )
    refuse_container(path)
    with open(path, "rb") as file:
        head = file.read(4)
    if not head:
        return _empty(path)
    describes = advice(path, "describe a table or an array of another program")
    begins = " ".join(f"{byte:02X}" for byte in head)
    return FormatError(
        f"{path}, byte 0: starts with {begins}: not a recording; taxel reads {', '.join(ENDINGS)}; {describes}"
    )


def _empty(path: Path) -> FormatError:
    return FormatError(f"{path}: the file is empty; must be a recording")
