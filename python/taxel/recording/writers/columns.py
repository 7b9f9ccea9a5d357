"""Writes the table of a recording by its columns: as a .npz or a .h5, as `taxel.recording.readers.columns` reads them.

The root of a .h5 has the attribute ``taxel`` (2, the layout's version). Events are the data sets ``t`` (int64, us),
``x``, ``y`` (uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); frames are ``values`` (float32, frames x rows x columns) with
``unit`` (text) and ``t``, or ``number`` if they have no times. ``array`` is the sensor as JSON.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import write_hdf5
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.readers.columns import MARK, SENSOR, VERSION

if TYPE_CHECKING:
    import h5py

#: Size of the chunks of a data set, which are compressed one by one.
_PIECE_BYTES = 1 << 20


def columns_of(table: Events | Frames, *, timed: bool) -> dict[str, NDArray[Any]]:
    """Return a table as columns by name."""
    columns: dict[str, NDArray[Any]]
    if isinstance(table, Frames):
        columns = {"values": table.values, "t" if timed else "number": table.t, "unit": np.array(table.unit)}
    else:
        columns = {"t": table.t, "x": table.x, "y": table.y, "p": table.p}
        if table.intensity is not None and table.present is not None:
            columns |= {"intensity": table.intensity, "present": table.present}
        if table.repaired is not None:
            columns["repaired"] = table.repaired
        columns["markers"] = np.array(table.markers, np.int64).reshape(-1, 2)
    return columns | {SENSOR: np.array(json.dumps(table.array._geometry()))}


def write_npz(file: BinaryIO, table: Events | Frames, *, timed: bool) -> None:
    """Write a .npz."""
    columns: dict[str, Any] = columns_of(table, timed=timed)
    np.savez_compressed(file, **columns)


def write_h5(path: Path, table: Events | Frames, *, timed: bool, overwrite: bool) -> None:
    """Write a .h5.

    Raises
    ------
    As `taxel._base.arrays.write_hdf5`.
    """

    def write(h5: h5py.File) -> None:
        h5.attrs[MARK] = VERSION
        for name, column in columns_of(table, timed=timed).items():
            if not column.ndim:
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
