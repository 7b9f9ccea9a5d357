"""Reads events or frames as named columns: a .npz, and what a .h5 holds (`taxel.recording.readers.columns`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import read_arrays, shapes
from taxel._base.columns import frozen_whole
from taxel._base.errors import refused
from taxel._base.limits import TAXELS
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import table as limited
from taxel.frames import Frames
from taxel.recording.contents import RecordedSource
from taxel.recording.description import about_of, described_source
from taxel.recording.layout import check_size, is_row_of
from taxel.recording.readers.columns import COLUMNS, DIGEST, EVENTS, PIECE_BYTES, TEXTS, digest_of
from taxel.recording.sections import Origin

#: Columns of events, one entry each.
_OF_EVENTS = (*EVENTS, "intensity", "present", "repaired")
#: The columns that are converted as they are read.
DTYPES: dict[str, type[np.generic]] = {
    "values": np.float32,
    "t": np.int64,
    **dict.fromkeys(("x", "y", "intensity"), np.uint16),
    **dict.fromkeys(("p", "present", "repaired"), np.bool_),
}


def chosen(path: Path, shapes: Mapping[str, tuple[int, ...]]) -> list[str]:
    """Return the columns of a file that are read, by the shapes of all that it has; other entries are not.

    Raises
    ------
    FormatError : columns that do not fit each other
    """
    others = (*_OF_EVENTS[1:], "markers") if {"values", "t"} <= shapes.keys() else ("values", "unit")
    read_shapes = {name: shapes[name] for name in (*COLUMNS, DIGEST) if name in shapes and name not in others}
    for name, shape in read_shapes.items():
        if (right := _wrong_shape(name, read_shapes)) is not None:
            raise FormatError(f"{path}: {name} has shape {shape}: must be {right}")
    return list(read_shapes)


def _wrong_shape(name: str, shapes: Mapping[str, tuple[int, ...]]) -> str | None:
    """Return what the shape of a column must be, if it is another; None if it is right."""
    shape, frames = shapes[name], shapes.get("values")
    if name in TEXTS:
        return "one text" if shape else None
    if name == DIGEST:
        # A shorter one is damage, which `contents_of` says.
        return "16 bytes" if math.prod(shape) > 16 else None
    if name == "markers":
        return None if shape[1:] == (2,) else "for each marker its time, and 1 if it is a start"
    if name == "held":
        return f"one value for each taxel, for at most {TAXELS} taxels" if math.prod(shape) > TAXELS else None
    if frames is not None:
        is_right = name == "values" or shape == frames[:1]
        return None if is_right else f"one time for each of {counted(math.prod(frames[:1]), 'frame')}"
    is_right = len(shape) == 1 and shape == shapes.get("t", shape)
    return None if is_right else "one value for each event, as many as in t"


def source_of_columns(path: Path, kind: str, columns: dict[str, NDArray[Any]], array: Array | None) -> RecordedSource:
    """Return what a file of columns holds; the arrays are not copied.

    Parameters
    ----------
    path : Path
    kind : str
    columns : dict from name to array
    array : Array, optional
        The sensor; default: that of the file, else one large enough for the events.

    Raises
    ------
    FormatError : a column is missing or invalid, or the columns are not those of which the file has the checksum
    ProblemError : the given sensor has other rows or columns than the frames
    """
    if DIGEST in columns and not np.array_equal(columns[DIGEST], digest_of(columns)):
        raise FormatError(f"{path}: the file is damaged: its content differs from what was written")
    values = columns.get("values")
    if values is not None and values.dtype.kind == "f" and values.flags.writeable:
        # A damaged file may hold signalling NaNs, of which each computation would warn.
        for k in range(0, len(values) if values.ndim else 0, step := max(1, PIECE_BYTES // max(1, values[:1].nbytes))):
            block = values[k : k + step]
            np.copyto(block, np.nan, where=np.isnan(block))
    columns = {name: frozen_whole(values) for name, values in columns.items()}
    about = about_of(f"{path}, array about", str(columns.get("about", "{}")))
    described = about.get("array")
    # A sensor of unknown pitch says nothing against the pitch of the file.
    says_less = array is not None and described is not None and not array._is_measured and described.fits(array)
    sensor = described if says_less else array or described
    if array is not None and values is not None and values.ndim == 3:
        row = described or Array(*values.shape[1:])
        if is_row_of(row, array):
            columns["values"] = values.reshape(-1, *array.shape)
        else:
            check_size(path, values.shape[1:], array)
    try:
        if "values" in columns and "t" in columns:
            unit = str(columns.get("unit", "counts"))
            table: Events | Frames = Frames(columns["values"], columns["t"], unit=unit, array=sensor)
        else:
            missing = [name for name in EVENTS if name not in columns]
            if missing:
                names = ", ".join(columns) or "nothing"
                raise FormatError(
                    f"{path}: {missing[0]} is missing; must contain t, x, y, p (events) or values, t (frames), "
                    f"but contains {names}"
                )
            t, x, y, p = (columns[name] for name in EVENTS)
            markers = [(int(at), bool(start)) for at, start in columns.get("markers", np.empty((0, 2)))]
            extra = {name: columns[name] for name in ("intensity", "present", "repaired") if name in columns}
            table = Events(t, x, y, p, array=sensor or around(x, y), markers=markers, **extra)
        limited(path, table)
        held = _held(columns["held"], table.array) if "held" in columns else None
    except (ProblemError, ValueError, TypeError, OverflowError) as error:
        raise FormatError(f"{path}: {first_line(error)}") from None
    return described_source(table, held, Origin(path, path.name, kind), about)


def _held(held: NDArray[Any], array: Array) -> NDArray[np.uint16]:
    if held.dtype != np.uint16 or held.shape != array.shape:
        raise refused("held", f" is {held.dtype} of shape {held.shape}: must be uint16 of {array.shape}")
    return held


def read_npz(path: Path, array: Array | None) -> RecordedSource:
    """Read a .npz that taxel wrote, or one with the columns ``t x y p`` or ``values t``.

    Raises
    ------
    FormatError : damage, or no such columns
    """
    return source_of_columns(path, "npz", read_columns(path), array)


def read_columns(path: Path) -> dict[str, NDArray[Any]]:
    """Read the columns of a .npz or .h5.

    Raises
    ------
    FormatError : damage, or columns that do not fit each other
    """
    found = shapes(path, with_texts=True)
    # Other columns are not read, but the error for a missing column lists them.
    return read_arrays(path, chosen(path, found), DTYPES) or {name: np.empty(0) for name in list(found)[:8]}


def read_records(path: Path, array: Array | None) -> RecordedSource:
    """Read a .npy of events, with the fields ``t x y p`` (`Events.to_numpy`, `Events.to_tonic`, `Events.to_faery`).

    Raises
    ------
    FormatError : damage, or a value that no event has
    """
    records = read_arrays(path, [""])[""]
    if records.ndim != 1:
        raise FormatError(f"{path}: records has shape {records.shape}: must have one record for each event")
    names = records.dtype.fields or ()
    columns = {name: records[name].copy() for name in _OF_EVENTS if name in names}
    return source_of_columns(path, "records", columns, array)


def around(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Return the thesis' array, or a larger array if events are outside it."""
    thesis = Array.thesis()
    if not len(x):
        return thesis
    if min(x.min(), y.min()) < 0 or max(x.max(), y.max()) >= 65_535:
        raise ProblemError("x and y: must be from 0 to 65534")
    rows, columns = max(thesis.rows, int(y.max()) + 1), max(thesis.columns, int(x.max()) + 1)
    return thesis if (rows, columns) == thesis.shape else Array(rows, columns)
