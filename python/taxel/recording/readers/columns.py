"""Reads a table by its columns: a .npz or .h5 that taxel wrote, or one with these columns; and a .npy of events.

Events are ``t x y p``, optionally with ``intensity present``, ``repaired`` and ``markers``; frames are
``values t unit``, those without times ``values number unit``. ``array`` is the sensor as JSON.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import hdf5, read_arrays, shapes
from taxel._base.columns import frozen_whole
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import around
from taxel.frames import Frames
from taxel.reading import Facts, InMemory
from taxel.recording.stated import check_size

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
