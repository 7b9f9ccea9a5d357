"""Opens a recording: a file that taxel writes, a file of another format, or a folder of trials."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from shlex import quote
from typing import NoReturn

from taxel import formats
from taxel._base import arguments
from taxel._base.arguments import flag, instance, shown, text
from taxel._base.errors import refused
from taxel._base.limits import available
from taxel._base.messages import warn
from taxel._base.options import with_fields_of
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats import Trial
from taxel.formats.event_camera import Reduction, reduced
from taxel.formats.layout import Layout
from taxel.labels import Labels, Note, beside, trial_of
from taxel.recording import recognition, sections
from taxel.recording.contents import BoardSource, Contents, RecordedSource, Stream, several, source_from
from taxel.recording.kinds import ENDINGS, LABELS
from taxel.recording.layout import apply_layout, check_size, on_array
from taxel.recording.once import Once, known
from taxel.recording.readers.csv import read_csv
from taxel.recording.readers.foreign import read_foreign
from taxel.recording.readers.h5 import read_h5
from taxel.recording.readers.lsa import read_lsa
from taxel.recording.readers.mcap import read_mcap
from taxel.recording.readers.npz import read_npz, read_records
from taxel.recording.readers.ros import Topics, read_ros
from taxel.recording.recording import Recording, add_notes, with_notes
from taxel.recording.sidecars import begin_of, labels_of, with_sidecars

#: The sources of a trial of both feet.
FEET = ("left", "right")


@dataclass(frozen=True, kw_only=True)
class SharedOptions:
    """Hold how files are opened, as `open_one` documents it; only subclasses state the type of `array`."""

    array: object = None
    layout: str | os.PathLike[str] | None = None
    topic: str | Sequence[str] | None = None
    field: str | Sequence[str] | None = None
    types: str | os.PathLike[str] | None = None
    ros: str | None = None
    region: str | None = None
    bin: int | None = None
    window_ms: float | None = None
    polarity: str | None = None


@dataclass(frozen=True, kw_only=True)
class OpenOptions(SharedOptions):
    """Hold the keyword arguments of `open_one`, which documents each, and of `open_all`."""

    array: Array | Sequence[Array] | None = None
    pairing: str = "direct"
    differences: bool = False

    @property
    def topics(self) -> Topics:
        """Topics of a ROS bag that are opened."""
        return Topics(self.topic, self.field, self.types, self.ros)

    @property
    def reduction(self) -> Reduction:
        """Selection of the events of a camera."""
        return Reduction(self.region, self.bin, self.window_ms, self.polarity)

    def how(self, path: Path, name: str, layout: Layout | None) -> dict[str, Reduction]:
        """Return the arguments of a format's own with which a path of this format is read.

        Raises
        ------
        ProblemError : what is read of a camera's events is given for another format
        """
        if name == "event_camera":
            return {"reduction": self.reduction.but(None if layout is None else layout.event_camera)}
        if self.reduction.is_given:
            raise _no_camera(path)
        return {}


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
    types, ros : path and str, optional
        For a ROS bag that does not define its messages: a folder of .msg or .idl files, and a release, for example
        "humble".
    region, bin, window_ms, polarity : str, int, float (ms) and str, optional
        For an event camera's file, or other events without intensities. `region`: columns and rows, for example
        "100:420,60:300", where the last are not included. `bin`: side of the square of pixels that becomes a taxel.
        `window_ms`: read frames of counts, each over a window of this length, at its beginning. `polarity`: only "on"
        or "off" events, or "both".
    pairing : {"direct", "taxel"}
        The change that an intensity belongs to: the change directly before it, or the latest change of that taxel.
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
    a .h5 is described in `taxel.recording.writers.h5`. The reference events of a ``labels.csv`` in a folder
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
    if recognition.is_folder(file):
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
    array, layout, topic, field, types, ros
        As in `taxel.open`.
    region, bin, window_ms, polarity : str, int, float (ms) and str, optional
        As in `taxel.open`.
    pairing, differences
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
    names, and so do those of tables beside each (`taxel.open`). In a folder with files that taxel writes, all other
    files are ignored.

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


def _open(path: Path, options: OpenOptions) -> list[Recording]:
    """Open all recordings of a folder, or all trials of a file."""
    if recognition.is_folder(path):
        return list(map(_labelled, _open_folder(path, options)))
    layout = recognition.layout_of(path, options.layout)
    return [_labelled(_named_beside(path, recording)) for recording in _open_file(path, options, layout)]


def _open_file(path: Path, options: OpenOptions, layout: Layout | None) -> list[Recording]:
    """Open a file or a ROS bag by its layout; from a file of another format, open all trials."""
    text("pairing", options.pairing, ("direct", "taxel"))
    flag("differences", options.differences)
    try:
        found = recognition.recognise_recording(path, layout)
        match found:
            case recognition.FormatFile(name):
                how = options.how(path, name, layout)
                return [_recording_of(trial, path, name, options.layout) for trial in formats.trials(path, name, **how)]
            case recognition.RosBag():
                topics = options.topics.but({} if layout is None else layout.ros)
                grid = layout.grid() if options.array is None and layout is not None else options.array
                contents = read_ros(path, topics, grid)
            case recognition.ForeignFile():
                assert layout is not None  # one without is refused
                if options.topics.are_given:
                    raise ProblemError(f"{path}: is not a ROS bag; topic, field, types and ros are only for ROS bags")
                array = None if options.array is None else Array._given(options.array)
                contents = Contents.single(read_foreign(path, layout, array))
                if array is not None and not contents.main.has_events:
                    contents = Contents.single(_on_given(contents.main, array))
            case recognition.TaxelFile(kind):
                if options.topics.are_given:
                    raise ProblemError(f"{path}: is a .{kind} file; topic, field, types and ros are only for ROS bags")
                array = None if options.array is None else Array._given(options.array)
                if kind == "records" and array is None and layout is not None:
                    array = layout.grid()
                contents = _read(path, kind, array, options.pairing, options.differences)
        if layout is not None:
            contents = apply_layout(contents, layout, given=options.layout is not None)
        return [Recording(with_sidecars(_of_camera(contents, path, options.reduction, layout)))]
    except MemoryError:
        raise FormatError(f"{path}: needs more memory than is available ({available()} bytes)") from None


def _of_camera(contents: Contents, path: Path, given: Reduction, layout: Layout | None) -> Contents:
    """Return a recording with what is asked for of its events, if they are without intensities.

    Raises
    ------
    ProblemError : it is given, and these are none
    """
    reduction, source = given.but(None if layout is None else layout.event_camera), contents.main
    if not reduction.is_given:
        return contents
    events = source.table if isinstance(source, BoardSource) and not contents.is_several else None
    if events is None or (events.present is not None and events.present.any()):
        if given.is_given:
            raise _no_camera(path)
        return contents
    table = reduced(str(path), events, reduction)
    same = source_from(table, source.origin, sensor=replace(source.sensor, array=table.array))
    return Contents.single(
        replace(same, settings=source.settings, marks=source.marks, timing=source.timing, losses=source.losses)
    )


def _on_given(source: RecordedSource, array: Array) -> RecordedSource:
    """Return frames of another program on the given sensor: as many rows and columns, or a row of as many channels.

    Raises
    ------
    ProblemError : another number of taxels, rows or columns
    """
    stated = source.sensor.array
    if stated.shape != (1, array.rows * array.columns):
        check_size(source.origin.path, stated.shape, array)
    says_more = array.shape != stated.shape or (array._is_measured and not stated._is_measured)
    return on_array(source, array) if says_more else source


def _read(path: Path, kind: str, array: Array | None, pairing: str, differences: bool) -> Contents:
    """Read a file by the reader of its kind."""
    if kind == "mcap":
        return read_mcap(path, pairing)
    if kind == "lsa":
        return Contents.single(read_lsa(path, array or Array.thesis(), pairing, differences))
    readers = {"npz": read_npz, "records": read_records, "csv": read_csv, "h5": read_h5}
    return Contents.single(readers[kind](path, array))


def _open_folder(folder: Path, options: OpenOptions) -> list[Recording]:
    """Open all recordings of a folder, with the labels in the same folder."""
    files = recognition.files_in(folder)
    recorded = recognition.recorded_by_taxel(files, options.layout)
    if options.topic or not recorded:
        bags = recognition.bags_of(files)
        recorded = [file for file in files if file in recorded or file in bags]
    names = [] if recorded else [*recognition.formats_of(folder)]
    if len(names) == 1:
        (name,) = names
        how = options.how(folder, name, recognition.layout_of(folder, options.layout))

        def read(place: Path) -> list[Recording]:
            return [_recording_of(trial, folder, name, options.layout) for trial in formats.trials(place, name, **how)]

        try:
            of_files, left_out = _each([folder], read)
        except (FormatError, OSError):
            # A format may read a table of the folder for each of its files, so that this takes longer.
            of_files, left_out = _each(formats.FORMATS[name].files(folder), read)
        pairs = [(Path(recording.name), recording) for _, recording in of_files]
        pairs.sort(key=lambda pair: recognition.natural_order(pair[0]))
        return _add_labels(folder / LABELS, pairs, left_out)
    if recorded:
        _warn_of_tables(folder, recorded, files, options)
    found = recorded or ([] if names else recognition.described_tables(files, options.layout))
    if not found:
        _refuse_folder(folder, files, names)
    if found is not recorded and options.layout is None:
        _warn_of_undescribed(folder, found, files)
    # A layout file that cannot be read is no damage of one recording.
    layouts = {file: recognition.layout_of(file, options.layout) for file in found}
    opened, left_out = _each(found, lambda file: _open_file(file, options, layouts[file]))
    pairs = [(file.relative_to(folder), recording) for file, recording in opened]
    return _add_labels(folder / LABELS, pairs, left_out)


def _each(
    files: Iterable[Path], read: Callable[[Path], list[Recording]]
) -> tuple[list[tuple[Path, Recording]], list[Path]]:
    """Return the recordings of files, and the files that cannot be read, which are left out with a warning.

    Raises
    ------
    FormatError : as of the first file, if none can be read
    OSError : as of the first file, if none can be read
    """
    opened: list[tuple[Path, Recording]] = []
    errors: dict[Path, FormatError | OSError] = {}
    for file in files:
        try:
            opened += [(file, recording) for recording in read(file)]
        except OSError as error:
            errors[file] = error
        except FormatError as error:
            # One that names an argument is no damage of a file.
            if error.argument is not None:
                raise
            errors[file] = error
    if errors and not opened:
        raise next(iter(errors.values()))
    for file, damage in errors.items():
        why = f"{file}: {damage.strerror}" if isinstance(damage, OSError) else str(damage).partition("\n")[0]
        warn(f"left out, because it cannot be read: {why}", stacklevel=6)
    return opened, list(errors)


def _refuse_folder(folder: Path, files: Sequence[Path], names: Sequence[str]) -> NoReturn:
    """Refuse a folder without a recording, or with files of several formats, by what there is in it."""
    for file in files if not names else ():
        if file.is_file():
            recognition.refuse_undescribed(file)
    problem = "no recording" if not names else f"several formats ({', '.join(names)}): name one file"
    deeper = sorted(
        inner.name
        for inner in folder.iterdir()
        if inner.is_dir() and os.access(inner, os.R_OK | os.X_OK) and recognition.recorded_by_taxel(inner.iterdir())
    )
    hint = (
        f"its folders {', '.join(deeper[:5])}{' ...' * (len(deeper) > 5)} contain recordings: name these folders"
        if deeper
        else ""
    )
    known_kinds = (
        f"taxel reads {', '.join(ENDINGS)}, ROS bags (.bag, .mcap, .db3), {', '.join(formats.FORMATS)}, and, "
        "with a layout file, arrays and tables, for example .npy and .txt (docs/files.md)"
    )
    raise FormatError(f"{folder}: contains {problem}; {hint or known_kinds}")


def _warn_of_tables(folder: Path, recorded: Sequence[Path], files: Sequence[Path], options: OpenOptions) -> None:
    """Warn of tables and arrays with a layout that are left out beside recordings, unless they were converted."""
    stems = {file.stem for file in recorded}
    left = [
        file.name
        for file in recognition.described_tables(files, options.layout)
        if file not in recorded and file.stem not in stems
    ]
    if left:
        names = ", ".join(left[:5]) + " ..." * (len(left) > 5)
        beside = ", ".join(file.name for file in recorded[:3]) + " ..." * (len(recorded) > 3)
        warn(
            f"{folder}: {names} are left out, because tables and arrays are not read in a folder with recordings "
            f"({beside}): "
            f"convert them, or move them to a separate folder",
            stacklevel=6,
        )


def _warn_of_undescribed(folder: Path, described: Sequence[Path], files: Sequence[Path]) -> None:
    """Warn of tables and arrays that no layout describes, beside others of their kind that have one."""
    if left := [file.name for file in recognition.undescribed_tables(files, described)]:
        warn(
            f"{folder}: {', '.join(left[:5])}{' ...' * (len(left) > 5)} are left out, because no layout file describes "
            "them; to describe all tables of the folder, write a file layout.toml in it",
            stacklevel=6,
        )


def _add_labels(table: Path, pairs: list[tuple[Path, Recording]], left_out: Sequence[Path]) -> list[Recording]:
    """Add the reference events of a folder to the notes of its recordings; those of files left out go with them."""
    if not table.exists():
        return [recording for _, recording in pairs]
    labels = Labels(table)
    known = {labels.named(name) for name, _ in pairs}
    stems = tuple(file.stem for file in left_out)
    unknown = [name for name in labels.recordings if name not in known and not Path(name).name.startswith(stems)]
    if unknown:
        names = ", ".join(str(name) for name, _ in pairs[:8])
        raise FormatError(f"{table}: {unknown[0]} is not a recording of this folder; must be one of {names}")
    # The feet of one trial are one recording.
    count = len({trial_of(str(name), recording.label) for name, recording in pairs}) + len(left_out)
    if count > 1 and any(not row.recording for row in labels.rows):
        raise FormatError(
            f"{table}: does not state the recording of each label, but there are {count} recordings; state it in the "
            f"column recording; the columns are {', '.join(map(shown, labels._columns))}"
        )
    return [_with_labels(labels, name, recording) for name, recording in pairs]


def _named_beside(path: Path, recording: Recording) -> Recording:
    """Add the reference events of the folder to the notes of frames that it names; the page opens them one by one."""
    table, contents = path.parent / LABELS, recording._contents
    if any(source.has_events for source in contents.sources.values()):
        return recording
    if not (table.is_file() and recognition.is_label_table(table)):
        return recording
    labels, name = Labels(table), Path(recording.name if recording.kind in formats.FORMATS else path.name)
    return recording if labels.named(name) in (None, "") else _with_labels(labels, name, recording)


def _labelled(recording: Recording) -> Recording:
    """Add the labels of tables that other programs wrote beside a recording to its notes."""
    place = recording.path.parent / trial_of(recording.name, recording.label)
    for table in recognition.label_tables(place):
        recording = _with_labels(Labels(table), place, recording)
    return recording


def _with_labels(labels: Labels, name: Path, recording: Recording) -> Recording:
    """Add the reference events of a recording, and of each of its sources, to the notes."""
    contents = recording._contents
    begin_us = begin_of(contents.sources.values(), labels)
    if not contents.is_several:
        return Recording(with_notes(contents, Once(partial(_notes, labels, name, contents.main, begin_us))))
    sources = {
        label: source
        if isinstance(source, Stream)
        else add_notes(source, Once(partial(_notes, labels, name, source, begin_us)))
        for label, source in contents.sources.items()
    }
    return Recording(Contents(several(sources), sources))


def _notes(labels: Labels, name: Path, source: RecordedSource, begin_us: Callable[[], int]) -> tuple[Note, ...]:
    """Return the reference events of a recording, less those that a label beside it repeats or replaces."""
    clock = source.timing.usable()
    of_labels = name, source.origin.label, "", source.sensor.side
    times = labels._times(*of_labels, begin_us, lambda: clock)
    rows = labels._rows(*of_labels, begin_us)
    of_source = {row.text: row.source for row in sorted(rows, key=lambda row: bool(row.source))}
    names, replaced, labelled = labels_of(source), set[int | None](), set[object]()
    if beside(source.origin.path).is_file():
        set_here = Labels(beside(source.origin.path))
        replaced = set_here._replaced(*names, begin_us)
        labelled = {(row.text, row.t) for row in set_here._rows(*names, begin_us)}
    notes = (
        Note(label, t, 0 if clock is None else int(clock.host_ns(t)), source=of_source.get(label, ""))
        for label, label_times in times.items()
        for t in label_times.tolist()
        if t not in replaced and (label, t) not in labelled
    )
    return tuple(sorted(notes, key=lambda note: note.t or 0))


def _recording_of(trial: Trial, path: Path, kind: str, given_layout: str | os.PathLike[str] | None) -> Recording:
    """Return a trial of another format as a recording, with its reference events as notes."""
    notes = sorted(
        (Note(event, int(t), 0) for event, times in trial.truth.items() for t in times), key=lambda note: note.t or 0
    )
    label = trial.foot if trial.foot and trial.name.endswith(f" {trial.foot}") else "board"
    origin = sections.Origin(path if path.is_file() else path / trial.name, trial.name, kind, label, trial.source)
    contents = Contents.single(
        source_from(
            trial.recorded,
            origin,
            untimed=not trial.timed,
            sensor=sections.Sensor(trial.recorded.array, trial.foot),
            marks=sections.Marks(notes=known(tuple(notes))),
            losses=sections.Losses(lost=known(_beside_frames(trial))),
        )
    )
    layout = recognition.layout_of(path, given_layout)
    if layout is not None:
        contents = apply_layout(contents, layout, given=given_layout is not None)
    return Recording(with_sidecars(contents))


def _beside_frames(trial: Trial) -> tuple[str, ...]:
    """Return the line of `lost` for what a file holds of a trial beside its taxels, times and reference events."""
    names = [*trial.series, *trial.unread]
    return (f"columns that are not taxels: {', '.join(names)}",) if names else ()


def join_feet(opened: Sequence[Recording]) -> list[Recording]:
    """Return recordings with the feet of each trial joined as its sources, `left` and `right`.

    Parameters
    ----------
    opened : sequence of Recording
        As `open_all` returns them, where each foot is a trial.

    Returns
    -------
    list of Recording
        In their order; all others unchanged.
    """
    groups: dict[tuple[str, str], dict[str, Contents]] = {}
    for recording in opened:
        origin = recording._contents.main.origin
        # In a folder the path of a trial ends with its name, and so with its foot.
        key = (str(origin.path).removesuffix(f" {origin.label}"), origin.name.removesuffix(f" {origin.label}"))
        groups.setdefault(key, {})[origin.label or origin.name] = recording._contents
    together: list[Recording] = []
    for (path, _), feet in groups.items():
        if set(feet) == set(FEET):
            sources = {foot: feet[foot].main for foot in FEET}
            sources = {
                foot: replace(source, origin=replace(source.origin, path=Path(path)))
                for foot, source in sources.items()
            }
            together.append(Recording(Contents(several(sources), sources)))
        else:
            together += [Recording(contents) for contents in feet.values()]
    return together


def sensors(recording: Recording) -> list[Recording]:
    """Return each sensor of a file with several as a recording; any other recording itself."""
    if not recording._contents.is_several:
        return [recording]
    return [source for source in recording.sources.values() if not source.is_stream]


def sensors_of(recordings: Recording | Sequence[Recording], name: str = "recordings") -> list[Recording]:
    """Return each sensor of recordings as a separate recording; refuse anything except recordings."""
    entries = [recordings] if isinstance(recordings, Recording) else arguments.several(name, recordings)
    if not len(entries):
        raise refused(name, " is empty: must be one Recording or more, as taxel.open or taxel.open_all returns")
    return [recording for entry in entries for recording in sensors(instance(name, entry, Recording))]
