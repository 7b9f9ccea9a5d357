"""Reads events or frames of a .h5 that taxel wrote (`taxel.recording.writers.h5`)."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from taxel._base.files import open_file
from taxel._base.h5_file import H5File
from taxel._core import FormatError
from taxel.array import Array
from taxel.recording.contents import RecordedSource
from taxel.recording.readers.columns import TEXTS
from taxel.recording.readers.npz import DTYPES, chosen, source_of_columns

#: Name of the attribute that has the version of the layout.
MARK = "taxel"
#: Version of the layout.
VERSION = 1
#: Bytes of a file that are searched at once.
_PIECE_BYTES = 1 << 20


def is_h5_of_taxel(path: Path) -> bool:
    """Return whether a .h5 has the layout that `taxel convert` writes; false for a file that is not HDF5.

    It is true of a damaged one with the name of its mark, which opening it reports.
    """
    try:
        # The name of an attribute is in the file as it is: without it the library, which begins slowly, is not asked.
        with open_file(path) as file:
            if not _holds(file, MARK.encode()):
                return False
    except OSError:
        return False
    try:
        with H5File(path) as h5:
            return h5.attribute(MARK) is not None
    except (FormatError, OSError):
        return True


def _holds(file: BinaryIO, word: bytes) -> bool:
    """Return whether a word is in a file."""
    overlap = b""
    while piece := file.read(_PIECE_BYTES):
        if word in overlap + piece:
            return True
        overlap = piece[1 - len(word) :]
    return False


def read_h5(path: Path, array: Array | None) -> RecordedSource:
    """Read a .h5 that taxel wrote.

    Raises
    ------
    FormatError : not an HDF5 file, or one of another layout
    """
    with H5File(path) as h5:
        version = h5.attribute(MARK)
        if version is None:
            raise FormatError(
                f"{path}: this HDF5 file was not written by taxel (it has no attribute taxel); to read files of other "
                "programs, use taxel.open or taxel.formats.trials"
            )
        if version != VERSION:
            number = version if isinstance(version, int) else "not a whole number"
            raise FormatError(f"{path}: its attribute taxel is {number}; this version of taxel reads {VERSION}")
        names = chosen(path, {name: entry.shape for name, entry in h5.entries.items()})
        h5.check_size(names, DTYPES)
        columns = {
            name: np.array(h5.text(name, TEXTS[name])) if name in TEXTS else h5.numbers(name, DTYPES.get(name))
            for name in names
        } or {name: np.empty(0) for name in list(h5.entries)[:8]}
    return source_of_columns(path, "h5", columns, array)
