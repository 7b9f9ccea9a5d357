"""Reads events or frames of a .h5 that taxel wrote (`taxel.recording.writers.h5`)."""

from __future__ import annotations

from pathlib import Path

from taxel._base.arguments import shown
from taxel._base.arrays import hdf5
from taxel._base.errors import unreadable
from taxel._core import FormatError
from taxel.array import Array
from taxel.recording.contents import RecordedSource
from taxel.recording.readers.npz import read_columns, source_of_columns

#: Name of the attribute that has the version of the layout.
MARK = "taxel"
#: Version of the layout.
VERSION = 1
#: How a HDF5 file begins.
_MAGIC = b"\x89HDF"


def is_h5_of_taxel(path: Path) -> bool:
    """Return whether a .h5 has the layout that `taxel convert` writes; false for a file that is not HDF5.

    It is true of a damaged one, which opening it reports.
    """
    try:
        with open(path, "rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                return False
        with hdf5(path) as h5:
            return MARK in h5.attrs
    except FormatError:
        return True
    except OSError:
        return False


def read_h5(path: Path, array: Array | None) -> RecordedSource:
    """Read a .h5 that taxel wrote.

    Raises
    ------
    FormatError : not an HDF5 file, or one of another layout
    """
    with hdf5(path) as h5:
        version = h5.attrs.get(MARK)
    if version is None:
        raise unreadable(
            "this HDF5 file was not written by taxel (it has no attribute taxel); to read files of other programs, use "
            "taxel.open or taxel.formats.trials",
            path,
        )
    if version != VERSION:
        raise unreadable(f"its attribute taxel is {shown(version)}; this version of taxel reads {VERSION}", path)
    return source_of_columns(path, "h5", read_columns(path), array)
