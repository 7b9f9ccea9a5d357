"""Events or pictures in a .h5: one data set a column, as `taxel convert` writes them.

The root has the attribute ``taxel`` (1, the layout's version). Events are the data sets ``t`` (int64, us), ``x``, ``y``
(uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); pictures are ``values`` (float32, pictures x rows x columns)
with ``t`` and ``unit`` (text). ``held`` (uint16, rows x columns, 65 535 for unknown) is the values of the taxels at the
beginning. ``about`` is JSON: the sensor, the source, registers, notes, detections and lost information. ``digest``
(uint8) is the checksum over all data sets, of which `taxel.recording.npz` states the order.
"""

from __future__ import annotations

from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np

from taxel._base.h5_file import H5File
from taxel._core import FormatError
from taxel.array import Array
from taxel.recording.contents import Contents
from taxel.recording.npz import TEXTS, columns_of, contents_of

__all__ = ["is_ours", "read_h5", "write_h5"]

#: Name of the attribute that has the version of the layout.
_MARK = "taxel"
#: Version of the layout.
_VERSION = 1
#: Size of the chunks of a data set, which are compressed one by one.
_PIECE_BYTES = 1 << 20


def is_ours(path: Path) -> bool:
    """Return whether a .h5 has the layout that `taxel convert` writes; false for a file that is not HDF5."""
    try:
        # The name of an attribute is in the file as it is: without it the library, which begins slowly, is not asked.
        with path.open("rb") as file:
            if not path.stat().st_size or mmap(file.fileno(), 0, access=ACCESS_READ).find(_MARK.encode()) < 0:
                return False
        with H5File(path) as h5:
            return _MARK in h5.attributes
    except (FormatError, OSError):
        return False


def write_h5(part: Path, contents: Contents) -> None:
    """Write a .h5."""
    import h5py  # noqa: PLC0415  loads slowly

    with h5py.File(part, "w") as h5:
        h5.attrs[_MARK] = _VERSION
        for name, column in columns_of(contents).items():
            if name in TEXTS:
                h5.create_dataset(name, data=str(column))
                continue
            row = max(1, column[:1].nbytes)
            chunks = (max(1, min(len(column), _PIECE_BYTES // row)), *column.shape[1:]) if column.size else None
            packed = {"chunks": chunks, "compression": "gzip", "compression_opts": 4, "shuffle": True} if chunks else {}
            h5.create_dataset(name, data=column, **packed)


def read_h5(path: Path, array: Array | None) -> Contents:
    """Read a .h5 that taxel wrote.

    Raises
    ------
    FormatError : not an HDF5 file, or one of another layout
    """
    with H5File(path) as h5:
        if _MARK not in h5.attributes:
            raise FormatError(
                f"{path}: HDF5, but without the attribute taxel of what taxel convert writes; other people's files are "
                "read by taxel.open and taxel.formats.trials"
            )
        if h5.attributes[_MARK] != _VERSION:
            raise FormatError(f"{path}: layout {h5.attributes['taxel']}; this version reads {_VERSION}")
        columns = {name: np.array(h5.text(name)) if name in TEXTS else h5.numbers(name) for name in h5.entries}
    return contents_of(path, "h5", columns, array)
