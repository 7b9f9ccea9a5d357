"""Recognition of what a path is, by which all readers are chosen: by its first bytes, its ending and its layout."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from taxel import _core, formats
from taxel._base.arguments import checked_path
from taxel._base.arrays import fields_of, stored_names
from taxel._base.encodings import as_utf_8
from taxel._base.files import beside, named
from taxel._core import FormatError
from taxel.event_table import are_of_events, is_of_track
from taxel.formats.event_camera import ENDINGS as CAMERA
from taxel.formats.layout import Layout, advice
from taxel.formats.ros import is_bag
from taxel.recording.kinds import ENDINGS, LABELS, TABLES
from taxel.recording.readers.columns import EVENTS
from taxel.recording.readers.csv import check_head, names_in
from taxel.recording.readers.foreign import ARRAYS
from taxel.recording.readers.h5 import is_h5_of_taxel
from taxel.recording.readers.without_layout import refuse_without_layout

#: The endings of tables of text, also compressed by gzip.
_TABLES = (".csv", ".txt", ".tsv", ".dat", ".asc")
#: The endings of those that may be tables of labels.
_LABELS = (".csv", ".txt", ".tsv")

#: The magic bytes of taxel's own kinds of files.
_MAGIC = {
    b"\x89MCAP0\r\n": "mcap",
    b"PK\x03\x04": "npz",
    b"PK\x05\x06": "npz",
    b"\x89HDF\r\n\x1a\n": "h5",
}
#: The first bytes of well-known files of other kinds, and advice for the error.
_STRANGERS = {
    b"\x1f\x8b": "gzip; unpack it first",
    b"\x28\xb5\x2f\xfd": "zstd; unpack it first",
    b"\x04\x22\x4d\x18": "lz4; unpack it first",
    b"BZh": "bzip2; unpack it first",
    b"\xfd7zXZ": "xz; unpack it first",
    b"\x89PNG": "a PNG picture",
    b"%PDF": "a PDF document",
    **{
        b"#!AER-DAT%d" % k: f"AEDAT {k}; save it as a file of event cameras that taxel reads: {', '.join(CAMERA)}"
        for k in (1, 2, 3)
    },
    b"#!AER-DAT4": "AEDAT 4; rename it to .aedat4",
    b"\x93NUMPY": "a single NumPy array; describe it in NAME.layout.toml",
}


#: A layout, the path of one, or None for the layout file beside a recording, if there is one.
GivenLayout: TypeAlias = str | os.PathLike[str] | Layout | None


@dataclass(frozen=True)
class TaxelFile:
    """A file of a kind that taxel writes: "mcap", "lsa", "npz", "csv" or "h5"; or a .npy of "records", one an event."""

    kind: str


@dataclass(frozen=True)
class FormatFile:
    """A file, or a folder of files, of a format of `taxel.formats`."""

    format: str


@dataclass(frozen=True)
class RosBag:
    """A ROS bag."""


@dataclass(frozen=True)
class ForeignFile:
    """A table or arrays of another program, with a layout that describes them or without one."""

    has_layout: bool


@dataclass(frozen=True)
class Refusal:
    """Reason why a file is not a recording; a companion is a file of taxel that may be beside recordings."""

    error: FormatError
    is_companion: bool = False


def recognise(path: Path, layout: GivenLayout = None) -> TaxelFile | FormatFile | RosBag | ForeignFile | Refusal:
    """Return what a path is.

    Parameters
    ----------
    path : Path
    layout : path or Layout, optional
        Default: the layout file beside it, if there is one. It is read only where the names of arrays alone leave open
        whether taxel wrote them.

    Raises
    ------
    OSError : the path is not there, or cannot be read
    """
    ending, has_layout = path.suffix.lower(), _has_layout(path, layout)
    if is_bag(path):
        return RosBag()
    if why := _companion(path, has_layout=has_layout):
        return Refusal(FormatError(f"{path}{why}"), is_companion=True)
    if (kind := _kind_of_taxel(path, ending)) is not None:
        return TaxelFile(kind)
    if found := formats_of(path):
        return FormatFile(next(iter(found)))
    # The reader of a .npz reports one that is damaged.
    is_damaged = ending == ".npz" and not stored_names(path)
    if _is_of_another_program(path, layout) and (has_layout or not is_damaged):
        return ForeignFile(has_layout)
    return _by_first_bytes(path)


def _kind_of_taxel(path: Path, ending: str) -> str | None:
    """Return the kind of a file of taxel with an ending that other programs give too, by its content, else None."""
    if ending == ".npy":
        return "records" if set(EVENTS) <= set(fields_of(path)) else None
    is_of_taxel = (ending == ".csv" and _is_table_of_taxel(path)) or (ending == ".h5" and is_h5_of_taxel(path))
    return ENDINGS[ending] if is_of_taxel else None


def recognise_recording(path: Path, layout: GivenLayout = None) -> TaxelFile | FormatFile | RosBag | ForeignFile:
    """Return what a recording is; arguments are those of `recognise`.

    Raises
    ------
    FormatError : no recording, or a table or arrays that no layout describes
    OSError : the path is not there, or cannot be read
    """
    found = recognise(path, layout)
    if found == ForeignFile(has_layout=False):
        _refuse_table(path)
        found = _by_first_bytes(path)
    if isinstance(found, Refusal):
        raise found.error
    return found


def refuse_undescribed(path: Path) -> None:
    """Refuse spike trains, and a table or arrays of another program that no layout describes.

    Raises
    ------
    FormatError : it is such a file
    OSError : the path is not there, or cannot be read
    """
    found = recognise(path)
    if isinstance(found, Refusal) and are_spike_trains(path):
        raise found.error
    if found == ForeignFile(has_layout=False):
        _refuse_table(path)


def _refuse_table(path: Path) -> None:
    """Refuse a table or arrays that no layout describes, or what is not of the kind that its name says."""
    found = _by_first_bytes(path)
    if isinstance(found, Refusal) and path.suffix.lower() in (".csv", ".h5", ".hdf5"):
        raise found.error
    refuse_without_layout(path)


def is_recording(path: Path, layout: GivenLayout = None) -> bool:
    """Return whether a path is a recording; what is damaged inside shows only when it is opened."""
    try:
        found = recognise(path, layout) if path.is_file() or path.is_dir() else None
    except (FormatError, OSError):
        return False
    return isinstance(found, TaxelFile | FormatFile | RosBag) or found == ForeignFile(has_layout=True)


def check_recording(path: Path, layout: GivenLayout = None) -> None:
    """Refuse a path that is not a recording by its name, its first bytes, and its layout file.

    Raises
    ------
    FormatError : no recording (names the kind of file if it is known); an invalid layout file; a table or arrays of
        another program that no layout file describes
    """
    match recognise_recording(path, layout_of(path, layout)):
        case TaxelFile("mcap"):
            _core.RecordingReader(path)
        case TaxelFile("csv"):
            check_head(path)


def is_folder(path: Path) -> bool:
    """Return whether a path is a folder, and no ROS bag."""
    return path.is_dir() and not is_bag(path)


def recordings_in(folder: Path, layout: GivenLayout = None) -> list[Path]:
    """Return what of a folder is a recording, ROS bags last, in the order of their names: 2 before 10.

    Tables and arrays of other programs are those that `layout`, or a layout file beside them, describes; they count in
    a folder that holds nothing else.
    """
    files = files_in(folder)
    bags = bags_of(files)
    of_formats = sorted({file for found in formats_of(folder).values() for file in found}, key=natural_order)
    found = recorded_by_taxel(files, layout) or of_formats or ([] if bags else described_tables(files, layout))
    return [*found, *bags]


def files_in(folder: Path) -> list[Path]:
    """Return the files and folders in a folder but its table of labels, in the order of their names: 2 before 10."""
    found = (file for file in folder.iterdir() if file.name != LABELS and (file.is_file() or file.is_dir()))
    return sorted(found, key=natural_order)


def recorded_by_taxel(files: Iterable[Path], layout: GivenLayout = None) -> list[Path]:
    """Return the files with an ending that taxel gives; no companion, and no file of others with the same ending.

    An empty file beside others of its ending has lost its content: opening it says so.
    """
    with_ending = [file for file in files if file.suffix.lower() in ENDINGS and file.is_file()]
    found = {file for file in with_ending if _is_of_taxel(file, layout)}
    endings = {file.suffix for file in found}
    return [file for file in with_ending if file in found or (file.suffix in endings and _is_empty(file, layout))]


def _is_empty(file: Path, layout: GivenLayout) -> bool:
    """Return whether a table or a file of arrays that no layout describes is empty; a table of labels may be."""
    return not file.stat().st_size and recognise(file, layout) == ForeignFile(has_layout=False)


def _is_of_taxel(file: Path, layout: GivenLayout) -> bool:
    try:
        found = recognise(file, layout)
    except OSError:
        # Opening it raises the error.
        return True
    return isinstance(found, TaxelFile) or (isinstance(found, Refusal) and not found.is_companion)


def bags_of(files: Iterable[Path]) -> list[Path]:
    """Return the ROS bags among files that can be read."""
    return [file for file in files if os.access(file, os.R_OK) and is_bag(file)]


def described_tables(files: Iterable[Path], layout: GivenLayout) -> list[Path]:
    """Return the tables and arrays of other programs of which a layout says how to read them."""
    tables = (file for file in files if not file.name.endswith(".notes.csv") and _describes(layout, file))
    return [file for file in tables if _is_of_another_program(file, layout)]


def undescribed_tables(files: Iterable[Path], described: Sequence[Path]) -> list[Path]:
    """Return the tables and arrays that no layout describes, of the same kinds of files as those described."""
    endings = {file.suffix.lower() for file in described}
    return [
        file
        for file in files
        if file.suffix.lower() in endings and file.is_file() and recognise(file) == ForeignFile(has_layout=False)
    ]


def formats_of(path: Path) -> dict[str, list[Path]]:
    """Return the files of other formats, of a file or within a folder, by the names of the formats."""
    return {name: files for name, kind in formats.FORMATS.items() if (files := kind.files(path))}


def layout_of(path: Path, layout: GivenLayout) -> Layout | None:
    """Return what the given layout file says, or the one beside a recording; None if there is none."""
    if isinstance(layout, Layout):
        return layout
    file = Layout.beside(path) if layout is None else Path(checked_path("layout", layout))
    return None if file is None else Layout.read(file)


def _has_layout(path: Path, layout: GivenLayout) -> bool:
    return layout is not None or Layout.beside(path) is not None


def _describes(given: GivenLayout, path: Path) -> bool:
    """Return whether a layout is given or beside a file; one of arrays alone describes no text."""
    layout = layout_of(path, given)
    of_arrays = layout is not None and layout.data is not None and layout.table is None
    return layout is not None and (not of_arrays or path.suffix.lower() in ARRAYS)


def is_label_table(path: Path) -> bool:
    """Return whether a text is a table of labels (`taxel.Labels`): by its first lines, or empty by its name."""
    first, second = _first_lines(path)
    names, cells, is_named = names_in(first), names_in(second), path.name.endswith(TABLES[:-1])
    if {"label", "t_us"} <= set(names) or is_of_track(first.decode(errors="replace")):
        return True
    is_empty = names == [""] and (is_named or path.name == LABELS or path.name.endswith(".notes.csv"))
    return is_empty or are_of_events(names, cells, named=is_named)


def label_tables(recording: Path) -> list[Path]:
    """Return the tables of labels that other programs wrote beside a recording, by its name: `walk_events.csv` ..."""
    tables = [beside(recording, f"{named(recording).stem}{ending}") for ending in TABLES]
    return [table for table in tables if table != recording and table.is_file() and is_label_table(table)]


def are_spike_trains(path: Path) -> bool:
    """Return whether a file holds the arrays that `SpikeTrains.save` writes."""
    is_npz = path.suffix.lower() == ".npz" and path.is_file()
    return is_npz and {"times", "offsets", "start", "stop"} <= set(stored_names(path))


def natural_order(path: Path) -> list[tuple[bool, int, str]]:
    """Return the sort key of a name in natural order: 2 before 10."""
    return [(part.isdecimal(), int(part) if part.isdecimal() else 0, part) for part in re.split(r"([0-9]+)", str(path))]


def _companion(path: Path, *, has_layout: bool) -> str:
    """Return what a file of taxel is that may be beside recordings, as the end of an error; "" of another file."""
    if path.suffix.lower() in _LABELS and path.is_file() and is_label_table(path):
        return ", line 1: a table of labels (docs/command-line.md), not a recording"
    if are_spike_trains(path) and not has_layout:
        return (
            ": contains spike trains, not a recording; to describe them, run taxel info; to read them in Python, call "
            "taxel.SpikeTrains.load"
        )
    return ""


def _is_table_of_taxel(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do."""
    names = names_in(_first_lines(path)[0])
    return names[0] == "t_us" and len(names) > 1


def _first_lines(path: Path) -> tuple[bytes, bytes]:
    """Return the first line of a table, and the second, as far as they are within 64 kB."""
    with open(path, "rb") as file:
        try:
            text = as_utf_8(path.name, file)
            return text.readline(1 << 16), text.readline(1 << 16)
        except FormatError:
            # The reader of tables reports what is no text.
            return b"", b""


def _is_of_another_program(path: Path, layout: GivenLayout) -> bool:
    """Return whether a file is a table or holds arrays that taxel did not write; false for a file that is not there.

    Arrays that a layout names are those of another program, also where they have names that taxel gives.
    """
    ending = Path(path.name.removesuffix(".gz")).suffix.lower()
    if not path.is_file() or ending not in (*_TABLES, *ARRAYS):
        return False
    if ending == ".npz":
        names = set(stored_names(path))
        if "about" in names or not ("t" in names and names & {"x", "y", "p", "values"}):
            return "about" not in names
        # Other programs name their times t too.
        stated = layout_of(path, layout)
        return stated is not None and stated.data is not None and stated.data.array in names
    if ending == ".h5":
        return not is_h5_of_taxel(path)
    is_of_taxel = ending == ".csv" and _is_table_of_taxel(path)
    return not is_of_taxel and (ending not in _LABELS or not is_label_table(path))


def _by_first_bytes(path: Path) -> TaxelFile | Refusal:
    """Return the kind of a file by its first bytes and its ending, which must not contradict each other."""
    with open(path, "rb") as file:
        head = file.read(16)
    ending = ENDINGS.get(path.suffix.lower())
    by_magic = next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
    begins = " ".join(f"{byte:02X}" for byte in head[:4])
    if by_magic is not None and ending in (None, by_magic):
        return TaxelFile(by_magic)
    if ending == "lsa":
        # Raw bytes may begin with anything.
        return TaxelFile(ending)
    stranger = next((kind for magic, kind in _STRANGERS.items() if head.startswith(magic)), None)
    expected = {"mcap": "the MCAP magic", "npz": "the magic of a .npz", "csv": "the names of columns"}
    expected["h5"] = "the magic of HDF5"
    if by_magic is not None:
        stranger = f"a .{by_magic} file; rename it"
    starts = f"{path}, byte 0: starts with {begins}"
    if stranger is not None:
        right = f", not with {expected[ending]}" if ending else ": not a recording"
        kind, _, then = stranger.partition("; ")
        return Refusal(FormatError(f"{starts} ({kind}){right}" + f"; {then}" * bool(then)))
    if not head and ending in (None, "npz", "h5"):
        wrong = f"{path}: the file is empty; must be a recording"
    elif ending is None:
        describes = advice(path, "describe a table or an array of another program")
        known = f"{', '.join(ENDINGS)}, and of event cameras {', '.join(CAMERA)}"
        wrong = f"{starts}: not a recording; taxel reads {known}; {describes}"
    elif ending in {"npz", "h5"}:
        wrong = f"{starts}, not with {expected[ending]} ({'50 4B 03 04' if ending == 'npz' else '89 48 44 46'})"
    else:
        # The compiled reader raises the errors of a .mcap, and the reader of tables those of a .csv.
        return TaxelFile(ending)
    return Refusal(FormatError(wrong))
