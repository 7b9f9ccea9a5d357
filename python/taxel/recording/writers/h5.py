"""Writes events or frames to a .h5: one data set a column.

The root has the attribute ``taxel`` (1, the layout's version). Events are the data sets ``t`` (int64, us), ``x``, ``y``
(uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); frames are ``values`` (float32, frames x rows x columns)
with ``t`` and ``unit`` (text). ``held`` (uint16, rows x columns, 65 535 for unknown) is the values of the taxels at the
beginning. ``about`` is JSON: the sensor, the source, registers, notes, detections and lost information. ``digest``
(uint8) is the checksum over all data sets, of which `taxel.recording.readers.columns` states the order.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from taxel._base.arrays import write_hdf5
from taxel.recording.contents import RecordedSource
from taxel.recording.readers.columns import TEXTS
from taxel.recording.readers.h5 import MARK, VERSION
from taxel.recording.writers.npz import columns_of

if TYPE_CHECKING:
    import h5py

#: Size of the chunks of a data set, which are compressed one by one.
_PIECE_BYTES = 1 << 20


def write_h5(path: Path, source: RecordedSource, *, overwrite: bool) -> None:
    """Write a .h5.

    Raises
    ------
    As `taxel._base.arrays.write_hdf5`.
    """
    columns = columns_of(source)

    def write(h5: h5py.File) -> None:
        h5.attrs[MARK] = VERSION
        for name, column in columns.items():
            if name in TEXTS:
                h5.create_dataset(name, data=str(column))
            elif not column.size:
                h5.create_dataset(name, data=column)
            else:
                rows = min(len(column), max(1, _PIECE_BYTES // column[:1].nbytes))
                chunks = (rows, *column.shape[1:])
                h5.create_dataset(
                    name, data=column, chunks=chunks, compression="gzip", compression_opts=4, shuffle=True
                )

    write_hdf5(path, write, overwrite=overwrite)
