"""Events or pictures in a .h5: a data set a column, as `taxel convert` writes them.

The root has the attribute ``taxel`` (1, the layout's version). Events are the data sets ``t`` (int64, us), ``x``, ``y``
(uint16), ``p`` (bool) and where they came ``intensity`` (uint16, ticks), ``present`` and ``repaired`` (bool), with
``markers`` (int64, two columns: us, whether a start); pictures are ``values`` (float32, pictures x rows x columns)
with ``t`` and ``unit`` (text). ``held`` (uint16, rows x columns, 65 535 where nothing is known) is what the taxels held
at the beginning. ``about`` is JSON: the sensor, where it came from, registers, notes, detections and what was lost.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.limits import DESCRIPTION, unpacked
from taxel._core import FormatError
from taxel.array import Array
from taxel.recording.contents import Contents
from taxel.recording.npz import TEXTS, columns_of, contents_of

__all__ = ["is_ours", "read_h5", "write_h5"]

#: Of the layout.
_VERSION = 1
#: Of a data set's pieces, which are packed one by one.
_PIECE_BYTES = 1 << 20


def is_ours(path: Path) -> bool:
    """Tell whether a .h5 is of the layout that `taxel convert` writes; false too for what is no HDF5 file."""
    import h5py  # noqa: PLC0415  loads slowly

    try:
        with h5py.File(path) as h5:
            return "taxel" in h5.attrs
    # What h5py raises on damage is no closed list.
    except Exception:
        return False


def write_h5(part: Path, contents: Contents) -> None:
    """Write a .h5."""
    import h5py  # noqa: PLC0415  loads slowly

    with h5py.File(part, "w") as h5:
        h5.attrs["taxel"] = _VERSION
        for name, column in columns_of(contents).items():
            if name in TEXTS:
                h5.create_dataset(name, data=str(column))
                continue
            row = max(1, column[:1].nbytes)
            chunks = (max(1, min(len(column), _PIECE_BYTES // row)), *column.shape[1:]) if column.size else None
            packed = {"chunks": chunks, "compression": "gzip", "compression_opts": 4, "shuffle": True} if chunks else {}
            h5.create_dataset(name, data=column, **packed)


def read_h5(path: Path, array: Array | None) -> Contents:
    """Read a .h5 of ours.

    Raises
    ------
    FormatError : no HDF5 file, or one of another layout
    """
    import h5py  # noqa: PLC0415  loads slowly

    try:
        with h5py.File(path) as h5:
            if "taxel" not in h5.attrs:
                raise FormatError(
                    f"{path}: HDF5, but without the attribute taxel of what taxel convert writes; other people's files "
                    "are read by taxel.open and taxel.formats.trials"
                )
            version = int(h5.attrs["taxel"])
            if version != _VERSION:
                raise FormatError(f"{path}: layout {version}; this version reads {_VERSION}")
            columns = {name: _column(f"{path}, data set {name}", name, h5[name]) for name in h5}
    except (OSError, FormatError) as error:
        if isinstance(error, FormatError | PermissionError | FileNotFoundError | IsADirectoryError):
            raise
        raise FormatError(f"{path}: not a whole HDF5 file ({str(error).splitlines()[0][:200]})") from None
    # What h5py raises on damage is no closed list.
    except Exception as error:
        said = (str(error).splitlines() or [""])[0][:200]
        raise FormatError(f"{path}: not a whole HDF5 file ({said})") from None
    return contents_of(path, "h5", columns, array)


def _column(place: str, name: str, data: Any) -> NDArray[Any]:
    import h5py  # noqa: PLC0415  loads slowly

    if not isinstance(data, h5py.Dataset):
        raise FormatError(f"{place}: a group; must be a column")
    if name in TEXTS:
        if data.shape != () or h5py.check_string_dtype(data.dtype) is None:
            raise FormatError(f"{place}: must be a text")
        text = data.asstr()[()]
        unpacked(place, len(text), DESCRIPTION)
        return np.array(text)
    if data.dtype.kind not in "biuf":
        raise FormatError(f"{place}: holds {data.dtype}; must hold numbers")
    unpacked(place, int(np.prod(data.shape, dtype=object)) * data.dtype.itemsize)
    return np.asarray(data[...])
