"""Writes events or frames as named columns, the common layout of .npz and .h5.

Events are ``t x y p``, optionally with ``intensity present``, ``repaired`` and ``markers``; frames are
``values t unit``. ``held`` is the values of the taxels at the beginning; ``about`` is JSON with all other fields.
``digest`` is a checksum over all of these, by which damage is found that the formats themselves do not notice.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from taxel._base.limits import ABOUT, MARKERS, UNIT
from taxel._core import ProblemError
from taxel.frames import Frames
from taxel.recording.contents import Source
from taxel.recording.description import json_of

EVENTS = ("t", "x", "y", "p")
COLUMNS = (*EVENTS, "intensity", "present", "repaired", "markers", "values", "unit", "held", "about")
#: The columns that are a single text, and how many characters they may have; NumPy's have 4 bytes.
TEXTS = {"about": ABOUT // 6, "unit": UNIT}
#: The entry with the checksum over all columns; a file without it opens unverified.
DIGEST = "digest"
#: Bytes of a column that are taken into the checksum at once.
PIECE_BYTES = 1 << 20


def columns_of(source: Source) -> dict[str, NDArray[Any]]:
    """Return a recording as columns by name, with their checksum.

    Raises
    ------
    ProblemError : more markers, or a longer description, than are read again
    """
    table = source.table
    columns: dict[str, Any]
    if isinstance(table, Frames):
        if (count := len(table.unit)) > UNIT:
            raise ProblemError(
                f"{source.origin.name}: a unit of {count} characters; a .npz and a .h5 hold at most {UNIT}"
            )
        columns = {"values": table.values, "t": table.t, "unit": np.array(table.unit)}
    else:
        columns = {"t": table.t, "x": table.x, "y": table.y, "p": table.p}
        if table.intensity is not None:
            columns |= {"intensity": table.intensity, "present": table.present}
        if table.repaired is not None:
            columns["repaired"] = table.repaired
        if len(table.markers) > MARKERS:
            raise ProblemError(
                f"{source.origin.name}: {len(table.markers)} markers; a .npz and a .h5 hold at most {MARKERS}"
            )
        columns["markers"] = np.array(table.markers, np.int64).reshape(-1, 2)
    if (held := source.settings.held()) is not None:
        columns["held"] = held
    columns["about"] = np.array(json_of(source))
    return {**columns, DIGEST: digest_of(columns)}


def digest_of(columns: dict[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """Return BLAKE2b (16 bytes) over the columns by name: of each a line of JSON (name, dtype, shape), then its bytes.

    Bytes are in C order, little-endian; texts are UTF-32. Entries that are no columns of a recording do not count.
    """
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(columns.keys() & set(COLUMNS)):
        column = columns[name]
        little = column.dtype.newbyteorder("<")
        digest.update(json.dumps([name, little.str, column.shape]).encode() + b"\n")
        rows = np.atleast_1d(column)
        if rows.dtype.kind == "U" and rows.nbytes:
            little = np.dtype("<u4")
            rows = rows.view(rows.dtype.str[0] + "u4")
        step = max(1, PIECE_BYTES // max(1, rows[:1].nbytes))
        # A shape of many rows without bytes would take for ever.
        for k in range(0, len(rows) if column.nbytes else 0, step):
            digest.update(rows[k : k + step].astype(little, copy=False).tobytes())
    return np.frombuffer(digest.digest(), np.uint8)


def write_npz(file: BinaryIO, source: Source) -> None:
    """Write a .npz."""
    np.savez_compressed(file, **cast(dict[str, Any], columns_of(source)))
