"""Writes events or frames to a .h5: one data set a column.

The root has the attribute ``taxel`` (1, the layout's version). Events are the data sets ``t`` (int64, us), ``x``, ``y``
(uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); frames are ``values`` (float32, frames x rows x columns)
with ``t`` and ``unit`` (text). ``held`` (uint16, rows x columns, 65 535 for unknown) is the values of the taxels at the
beginning. ``about`` is JSON: the sensor, the source, registers, notes, detections and lost information. ``digest``
(uint8) is the checksum over all data sets, of which `taxel.recording.readers.columns` states the order.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from taxel._base import h5_writing
from taxel.recording.contents import RecordedSource
from taxel.recording.readers.columns import TEXTS
from taxel.recording.readers.h5 import MARK, VERSION
from taxel.recording.writers.npz import columns_of

#: Size of the chunks of a data set, which are compressed one by one.
_PIECE_BYTES = 1 << 20


def write_h5(path: Path, source: RecordedSource, *, overwrite: bool) -> None:
    """Write a .h5, column after column in pieces.

    Raises
    ------
    As `taxel._base.h5_writing.write_h5`.
    """
    columns = columns_of(source)

    def send(pipe: BinaryIO) -> None:
        for name, column in columns.items():
            if name in TEXTS:
                encoded = str(column).encode()
                pipe.write(json.dumps([name, "text", [len(encoded)]]).encode() + b"\n" + encoded)
                continue
            pipe.write(json.dumps([name, column.dtype.str, column.shape]).encode() + b"\n")
            for piece in _pieces(column.shape, column.itemsize):
                pipe.write(column[piece].tobytes())

    h5_writing.write_h5(path, _write, send, overwrite=overwrite)


def _write(file: BinaryIO, source: BinaryIO) -> None:
    """Write the columns that `write_h5` sends."""
    import h5py  # noqa: PLC0415  loads slowly

    with h5py.File(file, "w") as h5:
        h5.attrs[MARK] = VERSION
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
