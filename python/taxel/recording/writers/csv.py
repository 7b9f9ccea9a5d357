"""Writes tables of text: a .csv of events or of frames, as `taxel.recording.readers.csv` reads them."""

from __future__ import annotations

import re
from typing import Any, BinaryIO

import numpy as np

from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import around
from taxel.frames import Frames
from taxel.recording.readers.csv import EVENTS, sensor_of

#: Number of frames that are written at once.
_FRAMES = 4096


def array_in_csv(table: Events | Frames) -> Array:
    """Return the sensor that a reader of the .csv assumes: the file holds neither name nor pitch."""
    if isinstance(table, Events):
        return around(table.x, table.y)
    return sensor_of(*np.array(_places(table.array)).reshape(-1, 2).T)


def write_csv(file: BinaryIO, table: Events | Frames) -> None:
    """Write a .csv."""
    if isinstance(table, Frames):
        places = _places(table.array)
        names = ",".join(["t_us", *(f"x{x}y{y}" for x, y in places)])
        file.write(names.encode() + b"\n")
        x, y = np.array(places).T
        for k in range(0, len(table), _FRAMES):
            values = table.values[k : k + _FRAMES, y, x]
            # Each value is written once; as bits, because 0 equals -0.
            bits, positions = np.unique(values.view(np.uint32), return_inverse=True)
            # str of a float32 is the shortest text that reads back as the same value; -0 would read back as a whole 0.
            texts = np.array([re.sub(r"(?<!^-0)\.0$", "", str(value)) for value in bits.view(np.float32)], object)
            rows = texts[positions.reshape(values.shape)].tolist()
            times = table.t[k : k + _FRAMES].tolist()
            file.writelines(f"{t},{','.join(row)}\n".encode() for t, row in zip(times, rows, strict=True))
        return
    import pandas as pd  # noqa: PLC0415  takes long

    columns: dict[str, Any] = dict(zip(EVENTS, (table.t, table.x, table.y, table.p.astype(np.uint8)), strict=True))
    if table.intensity is not None and table.present is not None:
        columns["intensity"] = pd.arrays.IntegerArray(table.intensity.copy(), ~table.present)
    if table.repaired is not None:
        columns["repaired"] = table.repaired.astype(np.uint8)
    pd.DataFrame(columns).to_csv(file, index=False, lineterminator="\n")


def _places(array: Array) -> list[tuple[int, int]]:
    """Return column and row of each taxel that exists, row by row."""
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    return [(int(x), int(y)) for y, x in np.argwhere(exists)]
