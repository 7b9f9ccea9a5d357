"""Events or pictures in a .h5: one data set a column, as `taxel convert` writes them.

The root has the attribute ``taxel`` (1, the layout's version). Events are the data sets ``t`` (int64, us), ``x``, ``y``
(uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); pictures are ``values`` (float32, pictures x rows x columns)
with ``t`` and ``unit`` (text). ``held`` (uint16, rows x columns, 65 535 for unknown) is the values of the taxels at the
beginning. ``about`` is JSON: the sensor, the source, registers, notes, detections and lost information. ``digest``
(uint8) is the checksum over all data sets, of which `taxel.recording.npz` states the order.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from taxel._base import h5_writing
from taxel._base.files import open_file
from taxel._base.h5_file import H5File
from taxel._core import FormatError
from taxel.array import Array
from taxel.recording.contents import Source
from taxel.recording.npz import DTYPES, TEXTS, chosen, columns_of, source_of_columns

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
        with open_file(path) as file:
            if not _holds(file, _MARK.encode()):
                return False
        with H5File(path) as h5:
            return h5.attribute(_MARK) is not None
    except (FormatError, OSError):
        return False


def _holds(file: BinaryIO, word: bytes) -> bool:
    """Return whether a word is in a file."""
    before = b""
    while piece := file.read(_PIECE_BYTES):
        if word in before + piece:
            return True
        before = piece[1 - len(word) :]
    return False


def write_h5(path: Path, source: Source, *, overwrite: bool) -> None:
    """Write a .h5, column after column in pieces.

    Raises
    ------
    As `taxel._base.h5_writing.write_h5`.
    """
    columns = columns_of(source)

    def send(pipe: BinaryIO) -> None:
        for name, column in columns.items():
            if name in TEXTS:
                said = str(column).encode()
                pipe.write(json.dumps([name, "text", [len(said)]]).encode() + b"\n" + said)
                continue
            pipe.write(json.dumps([name, column.dtype.str, column.shape]).encode() + b"\n")
            for piece in _pieces(column.shape, column.itemsize):
                pipe.write(column[piece].tobytes())

    h5_writing.write_h5(path, _write, send, overwrite=overwrite)


def _write(file: BinaryIO, source: BinaryIO) -> None:
    """Write the columns that `write_h5` sends."""
    import h5py  # noqa: PLC0415  loads slowly

    with h5py.File(file, "w") as h5:
        h5.attrs[_MARK] = _VERSION
        for line in iter(source.readline, b""):
            name, dtype, shape = json.loads(line)
            if dtype == "text":
                h5.create_dataset(name, data=source.read(*shape).decode())
                continue
            itemsize = np.dtype(dtype).itemsize
            pieces = list(_pieces(shape, itemsize))
            chunks = (pieces[0].stop, *shape[1:]) if 0 not in shape else None
            packed = {"chunks": chunks, "compression": "gzip", "compression_opts": 4, "shuffle": True} if chunks else {}
            column = h5.create_dataset(name, shape, dtype, **packed)
            for piece in pieces:
                rows = (piece.stop - piece.start, *shape[1:])
                column[piece] = np.frombuffer(source.read(itemsize * math.prod(rows)), dtype).reshape(rows)


def _pieces(shape: Sequence[int], itemsize: int) -> Iterator[slice]:
    """Yield the parts of a column that are compressed one by one."""
    step = max(1, _PIECE_BYTES // max(1, itemsize * math.prod(shape[1:])))
    for start in range(0, shape[0], step):
        yield slice(start, min(start + step, shape[0]))


def read_h5(path: Path, array: Array | None) -> Source:
    """Read a .h5 that taxel wrote.

    Raises
    ------
    FormatError : not an HDF5 file, or one of another layout
    """
    with H5File(path) as h5:
        version = h5.attribute(_MARK)
        if version is None:
            raise FormatError(
                f"{path}: HDF5, but without the attribute taxel of what taxel convert writes; other people's files are "
                "read by taxel.open and taxel.formats.trials"
            )
        if version != _VERSION:
            number = "no whole number" if isinstance(version, str) else version
            raise FormatError(f"{path}: its attribute taxel is {number}; this version of taxel reads {_VERSION}")
        names = chosen(path, {name: entry.shape for name, entry in h5.entries.items()})
        h5.check_size(names, DTYPES)
        columns = {
            name: np.array(h5.text(name, TEXTS[name])) if name in TEXTS else h5.numbers(name, DTYPES.get(name))
            for name in names
        } or {name: np.empty(0) for name in list(h5.entries)[:8]}
    return source_of_columns(path, "h5", columns, array)
