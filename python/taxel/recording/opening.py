"""Opens recordings: taxel's own files, and those of other programs by the first format that knows them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from shlex import quote
from typing import TypeAlias

from taxel import _core
from taxel._base import arguments
from taxel._base.arguments import checked_path, flag, instance, shown
from taxel._base.arrays import fields_of, stored_names
from taxel._base.errors import refused
from taxel._base.limits import available
from taxel._base.messages import first_line, warn
from taxel._base.options import with_fields_of
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats import emed, event_camera, moticon, pedar, tekscan, xdf
from taxel.formats.checks import check_table
from taxel.formats.event_camera import ENDINGS as CAMERA
from taxel.formats.event_camera import Reduction, reduced
from taxel.formats.foreign import ARRAYS, TABLES, check_foreign, read_foreign, refuse_container
from taxel.formats.layout import Layout, advice
from taxel.formats.ros import Topics, is_bag, read_ros
from taxel.labels import Labels, trial_of
from taxel.reading import ENDINGS, Facts, InMemory, Reader
from taxel.recording.beside import LABELS, is_label_table, labels_for
from taxel.recording.layout import apply_layout, check_size
from taxel.recording.readers.columns import EVENTS, SENSOR, is_h5_of_taxel, is_table, read_columns, read_records
from taxel.recording.readers.csv import check_head, is_of_taxel, read_csv
from taxel.recording.readers.lsa import read_lsa
from taxel.recording.readers.mcap import read_mcap
from taxel.recording.recording import Recording
from taxel.recording.source import SourceView

#: A layout, the path of one, or None for the layout file beside a recording, if there is one.
GivenLayout: TypeAlias = str | os.PathLike[str] | Layout | None
#: Files of makers and of recorders, and what reads them.
MAKERS = {"moticon": moticon, "pedar": pedar, "emed": emed, "tekscan": tekscan, "xdf": xdf}
#: Kinds of files of other programs, which a layout may describe.
_FOREIGN = ("table", "arrays")
#: The endings of those that may be tables of labels.
_LABELS = (".csv", ".txt", ".tsv")
#: The endings of those that are something else in most folders.
_RARE = (".json", ".log")


@dataclass(frozen=True, kw_only=True)
class SharedOptions:
    """Hold how files are opened, as `open_one` documents it; only subclasses state the type of `array`."""

    array: object = None
    layout: str | os.PathLike[str] | None = None
    topic: str | Sequence[str] | None = None
    field: str | Sequence[str] | None = None
    ros: str | None = None
    region: str | None = None
    bin: int | None = None
    window_ms: float | None = None
    polarity: str | None = None
    label_column: str | int | None = None


@dataclass(frozen=True, kw_only=True)
class OpenOptions(SharedOptions):
    """Hold the keyword arguments of `open_one`, which documents each, and of `open_all`."""

    array: Array | Sequence[Array] | None = None
    differences: bool = False

    @property
    def topics(self) -> Topics:
        """Topics of a ROS bag that are opened."""
        return Topics(self.topic, self.field, self.ros)

    @property
    def reduction(self) -> Reduction:
        """Selection of the events of a camera."""
        return Reduction(self.region, self.bin, self.window_ms, self.polarity)

    def check(self, path: Path, kind: str) -> None:
        """Refuse what is only for files of another kind.

        Raises
        ------
        ProblemError : topics of a file that is no ROS bag, or what is read of a camera's events for one of a maker
        """
        flag("differences", self.differences)
        if self.topics.are_given and kind != "ros":
            raise ProblemError(f"{path}: is not a ROS bag; topic, field and ros are only for ROS bags")
        if self.label_column is not None and kind != "table":
            raise refused("label_column", f" is {shown(self.label_column)}: is only for tables; {path} is none")


def _no_camera(path: Path) -> ProblemError:
    return ProblemError(
        f"{path}: region, bin, window_ms and polarity are only for events without intensities, for example of an event "
        "camera; this file has no such events"
    )


@with_fields_of(OpenOptions)
def open_one(path: str | os.PathLike[str], options: OpenOptions) -> Recording:
    r"""Open a recording.

    `taxel.open` is this function; `taxel.open_all` opens all recordings of a folder.

    Parameters
    ----------
    path : path
        A .mcap, .lsa, .npz, .csv or .h5 that taxel wrote, finished or not, whole or damaged; a file of another format
        that `taxel.formats` reads, with one trial; or a ROS bag.
    array : Array, or list of Array, optional
        The sensor, for files that do not hold it (.lsa, .csv, plain .npz); default: the thesis' 64 x 64,
        a larger one if events are outside it. The array in a .mcap is kept. For a ROS bag: rows and columns, for
        messages that do not state them.
    layout : path, optional
        The layout file with the facts that the recording lacks (docs/files.md); default: ``NAME.layout.toml`` or
        ``layout.toml`` beside it, if there is one.
    topic, field : str, or list of str, optional
        For a ROS bag: the topic that is opened as frames, and the path of a field of its messages, for example
        "left.taxels" (default: the only field with numbers). If they are lists, each entry becomes a source, with its
        own `array` if that is a list too.
    ros : str, optional
        For a ROS bag that does not define its messages: a release, for example "humble".
    region, bin, window_ms, polarity : str, int, float (ms) and str, optional
        For an event camera's file, or other events without intensities. `region`: columns and rows, for example
        "100:420,60:300", where the last are not included. `bin`: side of the square of pixels that becomes a taxel.
        `window_ms`: read frames of counts, each over a window of this length, at its beginning. `polarity`: only "on"
        or "off" events, or "both".
    label_column : str or int, optional
        For a table: the column, by its name or number from 1, whose value becomes a label where it changes; it is no
        taxel.
    differences : bool
        Whether the intensities of a .lsa are differences (the board's option); a .mcap stores this itself.

    Returns
    -------
    Recording

    Raises
    ------
    FormatError : not a recording, damaged so that nothing can be read, or larger than the available memory (names the
        place)
    ProblemError : a folder, or a file of another format with several trials
    OSError : the file does not exist, or cannot be read

    Notes
    -----
    Parts of a .mcap are read when they are first used.

    A .csv holds events as ``t_us,x,y,p[,intensity]``, or frames as ``t_us`` and a column for each taxel. The layout of
    a .h5 is described in `taxel.recording.writers.columns`. The reference events of a ``labels.csv`` in a folder
    (`taxel.Labels`) become notes of the files of frames that the table names, and so do those of tables beside a
    recording: ``NAME_labels.csv``, ``NAME_events.csv``, ``NAME_events.tsv``, and a label track ``NAME.txt``.

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "step.npz"
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> _ = taxel.convert(events, place)
    >>> taxel.open(place)
    Recording(step.npz: 2 events, 0 to 200 us, 8 x 8 taxels)
    """
    file = Path(arguments.checked_path("path", path))
    if is_folder(file):
        raise ProblemError(
            f"{file}: is a folder; name one of its recordings (in Python, taxel.open_all opens all of them)"
        )
    recordings = _open(file, options)
    if len(recordings) != 1:
        names = ", ".join(recording.name for recording in recordings[:3]) + ", ..." * (len(recordings) > 3)
        raise ProblemError(
            f"{file}: contains {len(recordings)} recordings ({names}); to write each to a file of taxel, run taxel "
            f"convert {quote(str(file))} FOLDER (in Python, taxel.open_all opens all of them)"
        )
    return recordings[0]


@with_fields_of(OpenOptions)
def open_all(path: str | os.PathLike[str], options: OpenOptions) -> list[Recording]:
    r"""Open all recordings of a folder, or all trials of a file.

    `taxel.open_all` is this function.

    Parameters
    ----------
    path : path
        A folder of recordings of taxel, of ROS bags, or of files of another format; or a file, as for `taxel.open`.
    array, layout, topic, field, ros
        As in `taxel.open`.
    region, bin, window_ms, polarity, label_column : str, int, float (ms), str and str or int, optional
        As in `taxel.open`.
    differences
        As in `taxel.open`.

    Returns
    -------
    list of Recording
        In the order of the names (2 before 10). A file of another format holds one or more trials: their reference
        events (contact, foot-off ...) become notes. Files of a folder that cannot be read are left out, each with a
        warning.

    Raises
    ------
    FormatError : a folder without a recording that can be read; else as for `taxel.open`
    OSError : the file does not exist, or cannot be read

    Notes
    -----
    The reference events of a ``labels.csv`` in the folder (`taxel.Labels`) become notes of the recordings that it
    names, and so do those of tables beside each (`taxel.open`). In a folder with recordings that taxel or a
    board wrote, all other files are ignored.

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> for name in ("step10.npz", "step2.npz"):
    ...     _ = taxel.convert(events, folder / name)
    >>> _ = (folder / "labels.csv").write_text("recording,label,t_us\nstep2,contact,200\n")
    >>> taxel.open_all(folder)
    [Recording(step2.npz: 2 events, 0 to 200 us, 8 x 8 taxels, 1 note),
     Recording(step10.npz: 2 events, 0 to 200 us, 8 x 8 taxels)]
    """
    return _open(Path(arguments.checked_path("path", path)), options)


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
    """

    knows: Callable[[Path], bool]
    read: Callable[[Path, Layout | None], Sequence[Reader]]


def kinds(options: OpenOptions | None = None) -> Iterator[tuple[str, Kind]]:
    """Yield the kinds of files with their names, in the order in which they are tried.

    Files that taxel writes come first, then formats of other distributions, which are looked for only if it is none.
    """
    how = OpenOptions() if options is None else options
    of_topics = isinstance(how.array, list | tuple) and all(isinstance(each, Array) for each in how.array)
    array = None if how.array is None or of_topics else Array._given(how.array)

    def read_arrays(path: Path, layout: Layout | None) -> Sequence[Reader]:
        return [_on_given(each, array) for each in read_foreign(path, layout, array, how.label_column)]

    def read_camera(path: Path, layout: Layout | None) -> Sequence[Reader]:
        reduction = how.reduction.but(None if layout is None else layout.event_camera)
        size = layout.grid() if array is None and layout is not None else array
        table = event_camera.read_events(path, reduction, size)
        return [InMemory(Facts(path=path, array=table.array, kind="event_camera"), table)]

    def read_bag(path: Path, layout: Layout | None) -> Sequence[Reader]:
        grid = layout.grid() if how.array is None and layout is not None else how.array
        return read_ros(path, how.topics.but({} if layout is None else layout.ros), grid)

    def read_events(path: Path, layout: Layout | None) -> Sequence[Reader]:
        return [read_records(path, layout.grid() if array is None and layout is not None else array)]

    def read_npz(path: Path, layout: Layout | None) -> Sequence[Reader]:
        names = stored_names(path)
        # Other programs name their times t too.
        is_foreign = SENSOR not in names and layout is not None and layout.data is not None
        return read_arrays(path, layout) if is_foreign else [read_columns(path, array)]

    yield from {
        "ros": Kind(is_bag, read_bag),
        "lsa": Kind(_ending(".lsa"), lambda path, _: [read_lsa(path, array, differences=how.differences)]),
        "mcap": Kind(_is_mcap, lambda path, _: read_mcap(path)),
        "h5": Kind(is_h5_of_taxel, lambda path, _: [read_columns(path, array)]),
        "csv": Kind(_is_csv, lambda path, _: [read_csv(path, array)]),
        "records": Kind(lambda path: set(EVENTS) <= set(fields_of(path)), read_events),
    }.items()
    yield from _from_elsewhere().items()
    yield from {
        **{name: Kind(maker.knows, maker.read) for name, maker in MAKERS.items()},
        "event_camera": Kind(event_camera.knows, read_camera),
        "npz": Kind(_is_npz, read_npz),
        "arrays": Kind(lambda path: _ending(*ARRAYS)(path) and not are_spike_trains(path), read_arrays),
        "table": Kind(_is_table, read_arrays),
    }.items()


@cache
def _from_elsewhere() -> dict[str, Kind]:
    """Return the formats of other distributions."""
    return {point.name: point.load() for point in entry_points(group="taxel.formats")}


def _ending(*endings: str) -> Callable[[Path], bool]:
    """Return a function of whether a file, perhaps compressed by gzip, has one of some endings."""
    return lambda path: path.is_file() and Path(path.name.removesuffix(".gz")).suffix.lower() in endings


def _is_mcap(path: Path) -> bool:
    """Return whether a file is a .mcap by its ending or its first bytes."""
    if not path.is_file():
        return False
    with open(path, "rb") as file:
        return path.suffix.lower() == ".mcap" or file.read(8) == b"\x89MCAP0\r\n"


def _is_csv(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do; a table of labels is none."""
    if not _ending(".csv")(path) or path.suffix.lower() != ".csv" or is_label_table(path):
        return False
    return is_of_taxel(path)


def _is_npz(path: Path) -> bool:
    """Return whether a .npz holds the columns of a table; true of a damaged one, which opening it reports."""
    names = stored_names(path) if _ending(".npz")(path) else ("none",)
    return not names or is_table(names)


def _is_table(path: Path) -> bool:
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


def kind_of(path: Path) -> str | None:
    """Return the name of the format of a file or a folder; None if no format knows it.

    Raises
    ------
    OSError : the path is not there, or cannot be read
    """
    path.stat()
    return next((name for name, kind in kinds() if kind.knows(path)), None)


def is_recording(path: Path, layout: GivenLayout = None) -> bool:
    """Return whether a path is a recording; what is damaged inside shows only when it is opened."""
    try:
        kind = kind_of(path)
        return kind is not None and (kind not in _FOREIGN or _is_usual(path) or _describes(layout, path))
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
    match kind_of(path):
        case None:
            raise _unknown(path)
        case "mcap":
            _core.RecordingReader(path)
        case "csv":
            check_head(path)
        case "table" | "arrays":
            check_foreign(path, found)


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder, and no ROS bag."""
    return path.is_dir() and not is_bag(path)


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
        file for file, kind in named.items() if kind in _FOREIGN and file.suffix in endings and not file.stat().st_size
    ]
    own = sorted([*own, *empty], key=natural_order)
    bags = [file for file, kind in named.items() if kind == "ros"]
    makers = [file for file, kind in named.items() if kind not in (*_FOREIGN, "ros")]
    foreign = [] if bags else [file for file in named if named[file] in _FOREIGN]
    tables = [file for file in foreign if _is_usual(file) or _describes(layout, file)]
    return [*(own or makers or tables), *bags]


def _kind_in_folder(file: Path) -> str | None:
    """Return the format of something in a folder; None of what cannot be read, and of folders that are no ROS bags."""
    try:
        return kind_of(file) if file.is_file() or is_bag(file) else None
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


def _unknown(path: Path) -> FormatError:
    """Return the error of a path that no format knows."""
    if path.suffix.lower() in _LABELS and is_label_table(path):
        return FormatError(f"{path}, line 1: a table of labels (docs/howto.md), not a recording")
    if are_spike_trains(path):
        return FormatError(
            f"{path}: contains spike trains, not a recording; to describe them, run taxel info; to read them in "
            "Python, call taxel.SpikeTrains.load"
        )
    refuse_container(path)
    with open(path, "rb") as file:
        head = file.read(4)
    if not head:
        return _empty(path)
    describes = advice(path, "describe a table or an array of another program")
    known = f"{', '.join(ENDINGS)}, and of event cameras {', '.join(CAMERA)}"
    begins = " ".join(f"{byte:02X}" for byte in head)
    return FormatError(f"{path}, byte 0: starts with {begins}: not a recording; taxel reads {known}; {describes}")


def _empty(path: Path) -> FormatError:
    return FormatError(f"{path}: the file is empty; must be a recording")


def _open(path: Path, options: OpenOptions) -> list[Recording]:
    """Open all recordings of a folder, or all trials of a file, with the labels of the tables beside them."""
    if is_folder(path):
        return _open_folder(path, options)
    opened = _open_file(path, options, layout_of(path, options.layout))
    return [labels_for(each, name) for name, each in _named(opened, Path(path.name))]


def _named(opened: Sequence[Recording], name: Path) -> list[tuple[Path, Recording]]:
    """Return recordings of a file with what tables of labels call them: its name, or, of several, those of trials."""
    return [(name if len(opened) == 1 else Path(each.name), each) for each in opened]


def _open_file(path: Path, options: OpenOptions, layout: Layout | None) -> list[Recording]:
    """Open a file, a ROS bag, or a folder of a maker by its layout; each trial is a recording."""
    kind = kind_of(path)
    if kind is None:
        raise _unknown(path)
    if path.is_file() and kind not in ("lsa", "mcap") and not path.stat().st_size:
        raise _empty(path)
    options.check(path, kind)
    before = path.stat()
    try:
        readers = next(each for name, each in kinds(options) if name == kind).read(path, layout)
    except MemoryError:
        raise FormatError(f"{path}: needs more memory than is available ({available()} bytes)") from None
    after = path.stat()
    in_memory = path.is_file() and all(isinstance(reader, InMemory) for reader in readers)
    if in_memory and (after.st_size, after.st_mtime_ns) != (before.st_size, before.st_mtime_ns):
        raise FormatError(f"{path}: the file changed while it was read; open it again when it is complete")
    by_name: dict[str, list[Reader]] = {}
    for reader in readers:
        if isinstance(reader, InMemory):
            check_table(path, reader.data)
        by_name.setdefault(reader.facts.name, []).append(reader)
    opened = [Recording.of(*each) for each in by_name.values()]
    if layout is not None:
        given = options.layout is not None
        opened = [each._each(lambda source: apply_layout(source, layout, given=given)) for each in opened]
    return opened if kind == "event_camera" else [_of_camera(each, path, options.reduction, layout) for each in opened]


def _of_camera(recording: Recording, path: Path, given: Reduction, layout: Layout | None) -> Recording:
    """Return a recording with what is asked for of its events, if they are without intensities.

    Raises
    ------
    ProblemError : it is given, and these are none
    """
    reduction = given.but(None if layout is None else layout.event_camera)
    if not reduction.is_given:
        return recording
    source = recording._main
    table = source.table if source.facts.has_events and not recording.is_several else None
    if not isinstance(table, Events) or (table.present is not None and table.present.any()):
        if given.is_given:
            raise _no_camera(path)
        return recording
    return Recording({source.facts.label: SourceView(source.in_memory(reduced(str(path), table, reduction)))})


def _open_folder(folder: Path, options: OpenOptions) -> list[Recording]:
    """Open all recordings of a folder; files that cannot be read are left out with a warning.

    Raises
    ------
    FormatError : none, or as of the first file, if none can be read
    OSError : as of the first file, if none can be read
    """
    found = recordings_in(folder, options.layout)
    if not options.topics.topic and not all(map(is_bag, found)):
        found = [file for file in found if not is_bag(file)]
    whole = {str(kind_of(file)) for file in found} - {*ENDINGS.values(), "records", "ros", *_FOREIGN}
    if len(whole) > 1:
        raise FormatError(f"{folder}: contains several formats ({', '.join(sorted(whole))}): name one file")
    if not found:
        _refuse_folder(folder)
    # A layout file that cannot be read is no damage of one recording.
    layouts = {file: layout_of(file, options.layout) for file in found}
    opened: list[tuple[Path, Recording]] = []
    errors: dict[Path, FormatError | OSError] = {}
    for file in found:
        try:
            opened += _named(_open_file(file, options, layouts[file]), file.relative_to(folder))
        except (FormatError, OSError) as error:
            # One that names an argument is no damage of a file.
            if isinstance(error, FormatError) and error.argument is not None:
                raise
            errors[file] = error
    if errors and not opened:
        raise next(iter(errors.values()))
    for file, damage in errors.items():
        why = f"{file}: {damage.strerror}" if isinstance(damage, OSError) else first_line(damage)
        warn(f"left out, because it cannot be read: {why}", stacklevel=5)
    opened.sort(key=lambda pair: natural_order(pair[0]))
    count = len({trial_of(str(name), each.label) for name, each in opened}) + len(errors)
    labels = Labels(folder / LABELS) if (folder / LABELS).exists() else None
    if labels is not None:
        _check_labels(labels, count, opened, [*errors])
    return [labels_for(each, name, labels, is_alone=count == 1) for name, each in opened]


def _refuse_folder(folder: Path) -> None:
    """Refuse a folder without a recording by what there is in it: spike trains, deeper folders."""
    for file in files_in(folder):
        if are_spike_trains(file):
            check_recording(file)
    deeper = [
        each.name for each in files_in(folder) if is_folder(each) and os.access(each, os.X_OK) and recordings_in(each)
    ]
    hint = f"its folders {', '.join(deeper[:5])}{' ...' * (len(deeper) > 5)} contain recordings: name these folders"
    known = (
        f"taxel reads {', '.join(ENDINGS)}, ROS bags (.bag, .mcap, .db3), {', '.join(MAKERS)}, event cameras, and "
        "arrays and tables of other programs, for example .npy and .txt (docs/files.md)"
    )
    raise FormatError(f"{folder}: contains no recording; {hint if deeper else known}")


def _check_labels(
    labels: Labels, count: int, opened: Sequence[tuple[Path, Recording]], left_out: Sequence[Path]
) -> None:
    """Refuse a table of labels of a folder of so many recordings that names another one, or none of several."""
    known = {labels.named(name) for name, _ in opened}
    stems = tuple(file.stem for file in left_out)
    unknown = [name for name in labels.recordings if name not in known and not Path(name).name.startswith(stems)]
    if unknown:
        names = ", ".join(str(name) for name, _ in opened[:8])
        raise FormatError(f"{labels.path}: {unknown[0]} is not a recording of this folder; must be one of {names}")
    if count > 1 and any(not row.recording for row in labels.rows):
        raise FormatError(
            f"{labels.path}: does not state the recording of each label, but there are {count} recordings; state it in "
            f"the column recording; the columns are {', '.join(map(shown, labels._columns))}"
        )


def sensors(recording: Recording) -> list[Recording]:
    """Return each sensor of a file with several as a recording; any other recording itself."""
    if not recording.is_several:
        return [recording]
    return [source for source in recording.sources.values() if not source.is_stream]


def sensors_of(recordings: Recording | Sequence[Recording], name: str = "recordings") -> list[Recording]:
    """Return each sensor of recordings as a separate recording; refuse anything except recordings."""
    entries = [recordings] if isinstance(recordings, Recording) else arguments.several(name, recordings)
    if not len(entries):
        raise refused(name, " is empty: must be one Recording or more, as taxel.open or taxel.open_all returns")
    return [recording for entry in entries for recording in sensors(instance(name, entry, Recording))]
