"""Opens recordings: taxel's own files, and those of other programs by the first kind that knows them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from taxel._base import arguments
from taxel._base.arguments import instance, shown
from taxel._base.errors import refused
from taxel._base.limits import TAXELS, TIME_US, available
from taxel._base.messages import first_line, warn
from taxel._base.options import with_fields_of
from taxel._core import FormatError, ProblemError
from taxel.array import Array, of_size
from taxel.events import Events
from taxel.formats.event_camera import Reduction, reduced
from taxel.formats.foreign import is_bag, refuse_container
from taxel.formats.layout import Layout
from taxel.frames import Frames
from taxel.labels import Labels, trial_of
from taxel.reading import ENDINGS, InMemory, Reader
from taxel.recording.beside import LABELS, labels_for
from taxel.recording.kinds import (
    FOREIGN,
    ListedTopics,
    OpenOptions,
    are_spike_trains,
    check_recording,
    files_in,
    is_folder,
    kind_of,
    known,
    layout_of,
    natural_order,
    recordings_in,
)
from taxel.recording.recording import Recording
from taxel.recording.source import SourceView
from taxel.recording.stated import apply_layout, is_row_of, on_array


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
    region, bin, count_ms, polarity : str, int, float (ms) and str, optional
        For an event camera's file, or other events without intensities. `region`: columns and rows, for example
        "100:420,60:300", where the last are not included. `bin`: side of the square of pixels that becomes a taxel.
        `count_ms`: read frames of counts, each over a window of this length, at its beginning. `polarity`: only "on"
        or "off" events, or "both".
    label_column : str or int, optional
        For a table: the column, by its name or number from 1, whose value becomes a label where it changes; it is no
        taxel. For a data set of robots: a feature, or "task".
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
    a .h5 is described in `taxel.recording.files.columns`. The reference events of a ``labels.csv`` in a folder
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
        refuse_container(file)
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
        A folder of recordings of taxel, of ROS bags, or of files of another format; a data set; or a file, as
        for `taxel.open`.
    array, layout, topic, field, ros
        As in `taxel.open`.
    region, bin, count_ms, polarity, label_column : str, int, float (ms), str and str or int, optional
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


def _open(path: Path, options: OpenOptions) -> list[Recording]:
    """Open all recordings of a folder, or all trials of a file, with the labels of the tables beside them."""
    if is_folder(path):
        refuse_container(path)
        return _open_folder(path, options)
    opened = _open_file(path, options, layout_of(path, options.layout))
    return [labels_for(each, name) for name, each in _named(opened, Path(path.name))]


def _named(opened: Sequence[Recording], name: Path) -> list[tuple[Path, Recording]]:
    """Return recordings of a file with what tables of labels call them: its name, or, of several, those of trials."""
    return [(name if len(opened) == 1 else Path(each.name), each) for each in opened]


def _open_file(path: Path, options: OpenOptions, layout: Layout | None) -> list[Recording]:
    """Open a file, a ROS bag, or a folder of a maker by its layout; each trial is a recording."""
    kind, before = known(path, options)[1], path.stat()
    try:
        readers = kind.read(path, options.in_layout(path, layout, kind))
    except MemoryError:
        raise FormatError(f"{path}: needs more memory than is available ({available()} bytes)") from None
    after = path.stat()
    in_memory = path.is_file() and all(isinstance(reader, InMemory) for reader in readers)
    if in_memory and (after.st_size, after.st_mtime_ns) != (before.st_size, before.st_mtime_ns):
        raise FormatError(f"{path}: the file changed while it was read; open it again when it is complete")
    by_name: dict[str, list[Reader]] = {}
    for reader in readers:
        if isinstance(reader, InMemory):
            _check_table(path, reader.data)
        by_name.setdefault(reader.facts.name, []).append(reader)
    opened = [Recording.of(*each) for each in by_name.values()]
    if layout is not None:
        given = options.layout is not None
        opened = [each._each(lambda source: apply_layout(source, layout, given=given)) for each in opened]
    return [_of_camera(each, path, options.reduction, layout) for each in opened]


def _check_table(location: Path, data: Events | Frames) -> None:
    """Refuse events or frames of a file whose sensor or times are beyond the limits.

    Raises
    ------
    FormatError : too many taxels, or a time farther from 0 than 142 years
    """
    rows, columns = data.array.shape
    if rows * columns > TAXELS:
        raise FormatError(f"{location}: the sensor has {rows} x {columns} taxels; must have at most {TAXELS}")
    far = np.flatnonzero((data.t < -TIME_US) | (data.t > TIME_US))
    if len(far):
        k = int(far[0])
        raise FormatError(f"{location}, time {k}: {data.t[k]} us; times must be within {TIME_US} us (142 years) of 0")


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
            right = "are only for events without intensities, for example of an event camera"
            raise ProblemError(f"{path}: region, bin, count_ms and polarity {right}; this file has no such events")
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
    if not options.topic and not all(map(is_bag, found)):
        found = [file for file in found if not is_bag(file)]
    whole = {str(kind_of(file)) for file in found} - {*ENDINGS.values(), "records", "ros", *FOREIGN}
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
    labels = Labels(folder / LABELS) if (folder / LABELS).is_file() else None
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
        f"taxel reads {', '.join(ENDINGS)}, ROS bags (.bag, .mcap, .db3), event cameras, and "
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


def open_trials(
    path: str | os.PathLike[str],
    *,
    array: Sequence[str] | None = None,
    layout: str | os.PathLike[str] | None = None,
    rate_hz: float | None = None,
    **options: Any,
) -> list[Recording]:
    """Open a file or a folder; of a folder, or of another maker's file, all trials in it.

    Parameters
    ----------
    path : path
    array : sequence of str, optional
        Rows, columns and pitch (mm) of the sensor, as "24x20x5"; of a ROS bag one for each topic, or one for all.
    layout : path, optional
    rate_hz : float, Hz, optional
        Frames a second, for recordings without times.
    **options
        Others of `taxel.open`.

    Raises
    ------
    ProblemError : an `array` that differs from the sensor that a file holds; a `rate_hz` of one with times
    """
    file = Path(arguments.checked_path("path", path))
    sizes = [] if array is None else arguments.several("array", array)
    arrays = [of_size(arguments.text("array", size), of_wire=False) for size in sizes]
    given = arrays if len(arrays) > 1 else arrays[0] if arrays else None
    opened = open_all(file, array=given, layout=layout, **options)
    placed = (_on_array(recording, sizes) for recording in opened)
    return [recording if rate_hz is None else recording.at_rate(rate_hz) for recording in placed]


def topics_in(path: Path, topic: object, ros: str | None, layout: str | os.PathLike[str] | None) -> ListedTopics | None:
    """Return the topics of a ROS bag if none is chosen; None of other files.

    Raises
    ------
    FormatError, ImportError, ProblemError : as of opening it
    """
    if topic or not is_bag(path):
        return None
    stated, listed = layout_of(path, layout), getattr(known(path)[1], "topics", None)
    chosen = None if stated is None or stated.ros is None else stated.ros.topic
    return None if chosen or listed is None else listed(path, ros)


def _on_array(recording: Recording, sizes: Sequence[str]) -> Recording:
    """Return a recording on the sensor of `array`; refuse one that holds a sensor that differs from it."""
    # A bag holds no sensor, so that its messages are of the given one or are left out.
    if not sizes or recording.kind == "ros":
        return recording
    stated, array = recording.array, of_size(sizes[0], of_wire=False)
    are_frames = not recording.has_events and not recording.is_stream and len(recording.sources) < 2
    if are_frames and is_row_of(stated, array):
        return _on_sensor(recording, array)
    differs = array.pitch_mm is not None and (stated.pitch_mm, stated.places) != (array.pitch_mm, None)
    if stated.shape != array.shape or differs:
        given = ", ".join(sizes)
        raise refused("array", f" is {given}: must be left out, because {recording.path} states its sensor, {stated!r}")
    # A .mcap holds its sensor, whose pitch may be unknown, and a camera's file its pixels.
    if not recording.has_events or stated._is_measured or recording.kind in ("mcap", "event_camera"):
        return recording
    # A size without a pitch says nothing of it, and events without one are of the board's wire.
    wire = of_size(sizes[0])
    return _on_sensor(recording, Array(*stated.shape, wire.pitch_mm, stated.exists, wire.name))


def _on_sensor(recording: Recording, array: Array) -> Recording:
    """Return a recording on another description of its sensor."""
    label = recording._main.facts.label
    return Recording({**recording._sources, label: on_array(recording._main, array)})


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
