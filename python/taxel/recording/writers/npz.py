"""Writes events or frames as named columns (`taxel.recording.readers.columns`), and as a .npz."""

from __future__ import annotations

from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from taxel.frames import Frames
from taxel.recording.contents import RecordedSource
from taxel.recording.description import json_of
from taxel.recording.readers.columns import DIGEST, digest_of


def columns_of(source: RecordedSource) -> dict[str, NDArray[Any]]:
    """Return a recording as columns by name, with their checksum."""
    table = source.table
    columns: dict[str, Any]
    if isinstance(table, Frames):
        columns = {"values": table.values, "t": table.t, "unit": np.array(table.unit)}
    else:
        columns = {"t": table.t, "x": table.x, "y": table.y, "p": table.p}
        if table.intensity is not None:
            columns |= {"intensity": table.intensity, "present": table.present}
        if table.repaired is not None:
            columns["repaired"] = table.repaired
        columns["markers"] = np.array(table.markers, np.int64).reshape(-1, 2)
    if (held := source.settings.held()) is not None:
        columns["held"] = held
    columns["about"] = np.array(json_of(source))
    return {**columns, DIGEST: digest_of(columns)}


def write_npz(file: BinaryIO, source: RecordedSource) -> None:
    """Write a .npz."""
    np.savez_compressed(file, **cast(dict[str, Any], columns_of(source)))
