"""A table by its columns: a .npz or .h5 that taxel writes, or one with these columns; and a .npy of events.

The root of a .h5 has the attribute ``taxel`` (2, the layout's version). Events are the data sets ``t`` (int64, us),
``x``, ``y`` (uint16), ``p`` (bool), optionally ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); frames are ``values`` (float32, frames x rows x columns) with
``unit`` (text) and ``t``, or ``number`` if they have no times. ``array`` is the sensor as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import hdf5, read_arrays, shapes, write_hdf5
from taxel._base.columns import frozen_whole
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.table import around
from taxel.frames import Frames
from taxel.reading import Facts, InMemory
from taxel.recording.stated import check_size

if TYPE_CHECKING:
    import h5py

#: The columns of events.
EVENTS: tuple[str, ...] = ("t", "x", "y", "p")
_MORE = ("intensity", "present", "repaired")
_OF_EVENTS = (*EVENTS, *_MORE, "markers")
_OF_FRAMES = ("values", "t", "number", "unit")
#: The entry with the sensor.
SENSOR = "array"
#: The columns that are converted as they are read.
DTYPES: dict[str, type[np.generic]] = {
    "values": np.float32,
    "t": np.int64,
    "number": np.int64,
    **dict.fromkeys(("x", "y", "intensity"), np.uint16),
    **dict.fromkeys(("p", "present", "repaired"), np.bool_),
}
#: The attribute of a .h5 that has the version of its layout.
MARK = "taxel"
VERSION = 2
#: Size of the chunks of a data set, which are compressed one by one.
_PIECE_BYTES = 1 << 20


def is_table(names: tuple[str, ...]) -> bool:
    """Return whether these are the columns of a table of taxel, by their names."""
    return SENSOR in names or ("t" in names and bool({"x", "y", "p", "values"} & set(names)))


def is_h5_of_taxel(path: Path) -> bool:
    """Return whether a .h5 is one that taxel wrote; false for a file that is not HDF5.

    It is true of a damaged one, which opening it reports.
    """
    try:
        with open(path, "rb") as file:
            if file.read(4) != b"\x89HDF":
                return False
        with hdf5(path) as h5:
            return MARK in h5.attrs
    except FormatError:
        return True
    except OSError:
        return False


def read_columns(path: Path, array: Array | None = None) -> InMemory:
    """Read a .npz or a .h5 with the columns of events or of frames.

    Parameters
    ----------
    path : Path
    array : Array, optional
        The sensor; default: that of the file, else one large enough for the events.

    Raises
    ------
    FormatError : damage, or columns that are missing or invalid
    ProblemError : the given sensor has other rows or columns than the frames
    """
    found = shapes(path, with_texts=True)
    are_frames = "values" in found
    names = _OF_FRAMES if are_frames else _OF_EVENTS
    required = ("values", "number" if "number" in found else "t") if are_frames else EVENTS
    missing = next((name for name in required if name not in found), None)
    if missing is not None:
        raise FormatError(
            f"{path}: {missing} is missing; must contain t, x, y, p (events) or values, t (frames), but contains "
            f"{', '.join(list(found)[:8]) or 'nothing'}"
        )
    chosen = [name for name in (*names, SENSOR) if name in found]
    return from_columns(path, path.suffix[1:].lower(), read_arrays(path, chosen, DTYPES), array)


def read_records(path: Path, array: Array | None = None) -> InMemory:
    """Read a .npy of events, with the fields ``t x y p`` (`Events.to_numpy`).

    Raises
    ------
    FormatError : damage, or a value that no event has
    """
    records = read_arrays(path, [""])[""]
    if records.ndim != 1:
        raise FormatError(f"{path}: records has shape {records.shape}: must have one record for each event")
    names = records.dtype.fields or ()
    columns = {name: records[name].copy() for name in (*EVENTS, *_MORE) if name in names}
    return from_columns(path, "records", columns, array)


def from_columns(path: Path, kind: str, columns: Mapping[str, NDArray[Any]], array: Array | None) -> InMemory:
    """Return the table that columns hold; the arrays are not copied.

    Raises
    ------
    FormatError : an invalid value
    ProblemError : the given sensor has other rows or columns than the frames
    """
    columns = {name: frozen_whole(values) for name, values in columns.items()}
    described = None if SENSOR not in columns else _sensor(path, str(columns[SENSOR]))
    # A sensor of unknown pitch says nothing against the pitch of the file.
    says_less = array is not None and described is not None and not array._is_measured and described.fits(array)
    sensor = described if says_less else array or described
    values = columns.get("values")
    if array is not None and values is not None and values.ndim == 3 and values.shape[1:] != array.shape:
        if values.shape[1:] != (1, array.rows * array.columns):
            check_size(path, values.shape[1:], array)
        values = values.reshape(-1, *array.shape)
    try:
        if values is not None:
            t = columns["t" if "t" in columns else "number"]
            unit = str(columns.get("unit", "counts"))
            table: Events | Frames = Frames(values, t, unit=unit, array=sensor)
        else:
            t, x, y, p = (columns[name] for name in EVENTS)
            markers = [(int(at), bool(start)) for at, start in columns.get("markers", np.empty((0, 2)))]
            more = {name: columns[name] for name in _MORE if name in columns}
            table = Events(t, x, y, p, array=sensor or around(x, y), markers=markers, **more)
    except (ProblemError, ValueError, TypeError, OverflowError) as error:
        raise FormatError(f"{path}: {first_line(error)}") from None
    return InMemory(Facts(path=path, array=table.array, kind=kind, timed="t" in columns), table)


def _sensor(path: Path, document: str) -> Array:
    """Return the sensor that a file describes."""
    try:
        return Array._from_geometry(dict(json.loads(document)))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, ProblemError) as error:
        raise FormatError(f"{path}, {SENSOR}: {first_line(error)}; must be a sensor as taxel writes it") from None


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
