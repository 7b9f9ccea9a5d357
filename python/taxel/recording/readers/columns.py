"""The columns of events or of frames by name, the common layout of .npz and .h5.

Events are ``t x y p``, optionally with ``intensity present``, ``repaired`` and ``markers``; frames are
``values t unit``. ``held`` is the values of the taxels at the beginning; ``about`` is JSON with all other fields.
``digest`` is a checksum over all of these, by which damage is found that the formats themselves do not notice.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

EVENTS: tuple[str, ...] = ("t", "x", "y", "p")
COLUMNS = (*EVENTS, "intensity", "present", "repaired", "markers", "values", "unit", "held", "about")
#: The columns that are a single text.
TEXTS = ("about", "unit")
#: The entry with the checksum over all columns; a file without it opens unverified.
DIGEST = "digest"
#: Bytes of a column that are taken into the checksum at once.
PIECE_BYTES = 1 << 20


def digest_of(columns: dict[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """Return BLAKE2b (16 bytes) over the columns by name: of each a line of JSON (name, dtype, shape), then its bytes.

    Bytes are in C order, little-endian; texts are UTF-32. Entries that are not columns of a recording do not count.
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
