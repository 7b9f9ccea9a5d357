"""Recognition of the kind of a recording by a file's first bytes and its ending."""

from __future__ import annotations

from pathlib import Path

from taxel._base.files import open_file
from taxel._core import FormatError
from taxel.formats.layout import advice
from taxel.formats.ros import is_bag
from taxel.recording.contents import Source
from taxel.recording.verdict import Verdict

#: taxel's own kinds of files by their endings.
ENDINGS = {".mcap": "mcap", ".lsa": "lsa", ".npz": "npz", ".csv": "csv", ".h5": "h5"}

#: The table of labels of a folder.
LABELS = "labels.csv"

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
    b"\x89PNG": "a PNG picture, no recording",
    b"%PDF": "a PDF document, no recording",
    b"\x93NUMPY": "a single NumPy array; say in NAME.layout.toml what it holds",
}


def is_table_of_taxel(path: Path) -> bool:
    """Return whether the first line of a .csv begins as taxel's own recordings do, which are separated by commas."""
    names = _columns(path)
    return names[:1] == [b"t_us"] and len(names) > 1 and b"label" not in names


def is_label_table(path: Path) -> bool:
    """Return whether a .csv is a table of labels (`taxel.Labels`): by its first line, or empty by its name."""
    names = _columns(path)
    is_named = path.name == LABELS or path.name.endswith(".notes.csv")
    return {b"label", b"t_us"} <= set(names) or (names == [b""] and is_named)


def _columns(path: Path) -> list[bytes]:
    """Return the names in the first line of a table, as far as they are within 64 kB."""
    with open_file(path) as table:
        head = table.readline(1 << 16).removeprefix(b"\xef\xbb\xbf").lstrip()
    return [name.strip() for name in head.split(b",")]


def kind_of_file(kind: str) -> str:
    """Return the name of a kind of recording: its ending if it is taxel's own, else its format.

    Examples
    --------
    >>> kind_of_file("npz"), kind_of_file("pedar"), kind_of_file("arrays")
    ('.npz', 'pedar recording', 'file of arrays')
    """
    return f".{kind}" if kind in ENDINGS.values() else _OTHERS.get(kind, f"{kind} recording")


#: Kinds of files that are no recordings of one format.
_OTHERS = {"arrays": "file of arrays", "table": "table", "ros": "ROS bag"}


def verdict_of(source: Source) -> Verdict:
    """Return what was lost of a recording, or that its file does not say it."""
    verdict = source.losses.verdict()
    return Verdict._of({"silent": kind_of_file(source.origin.kind)}) if verdict is None else verdict


def kind_of(path: Path) -> str:
    """Return the kind of a file by its first bytes and its ending, which must not contradict each other.

    Raises
    ------
    FormatError : not a recording (names the kind of file if it is known)
    OSError : the file is not there, or cannot be read
    """
    if is_bag(path):
        return "ros"
    with open_file(path) as file:
        head = file.read(16)
    ending = ENDINGS.get(path.suffix.lower())
    by_magic = next((kind for magic, kind in _MAGIC.items() if head.startswith(magic)), None)
    begins = " ".join(f"{byte:02X}" for byte in head[:4]) or "nothing"
    if by_magic is not None and ending in (None, by_magic):
        return by_magic
    if ending == "lsa":
        # Raw bytes may begin with anything.
        return ending
    stranger = next((kind for magic, kind in _STRANGERS.items() if head.startswith(magic)), None)
    expected = {"mcap": "the MCAP magic", "npz": "the magic of a .npz", "csv": "the names of columns"}
    expected["h5"] = "the magic of HDF5"
    if by_magic is not None:
        stranger = f"a .{by_magic} file; rename it"
    if stranger is not None:
        right = expected[ending] if ending else "a recording"
        kind, _, then = stranger.partition("; ")
        raise FormatError(f"{path}, byte 0: starts with {begins} ({kind}), not with {right}" + f"; {then}" * bool(then))
    if ending is None:
        raise FormatError(
            f"{path}, byte 0: starts with {begins}: no recording; there are {', '.join(ENDINGS)}; "
            + advice(path, "describes a table or an array of another program")
        )
    if ending in {"npz", "h5"}:
        magic = {"npz": "50 4B 03 04", "h5": "89 48 44 46"}[ending]
        raise FormatError(f"{path}, byte 0: starts with {begins}, not with {expected[ending]} ({magic})")
    # The compiled reader raises the errors of a .mcap, and the reader of tables those of a .csv.
    return ending
