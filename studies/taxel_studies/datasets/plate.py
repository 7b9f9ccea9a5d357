"""A footscan-type plate, one barefoot footfall in each trial (jiku-data, SpeedPP2DS; J. Biomech. 41:1987, 2008).

A file ``subjNNN.h5`` holds one person: data sets ``imgNNN``, rows x columns x frames, 500 frames a second, heel at the
low rows. Values are counts of unknown unit. The file's rows are interpolated, three from two; the reader reverts this.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Array, FormatError, Frames
from taxel.reading import InMemory, after_zeros
from taxel_studies.datasets import Trial, readers, table

__all__ = ["COLUMN_MM", "FRAME_US", "ROW_MM", "begun_unloaded", "events", "knows", "read", "sensor_rows", "trials"]

#: Time between frames, us.
FRAME_US = 2000
#: Pitch of the sensors along the walk and across it, mm: that of the usual footscan plate, inferred from the
#: interpolation of three rows from two.
ROW_MM, COLUMN_MM = 7.62, 5.08
#: So long before its first load the plate is read as unloaded, s: long enough for its rest to be known.
BEFORE_S = 0.6
_EVENTS = ("contact", "heel_off", "foot_off")

_SOURCE = (
    "the full plate: contact and foot-off are the first and the last loaded frame; heel-off is the time when the "
    "load of the heel region falls below 5 % of its peak"
)


#: The file's numbers of conditions.
_SPEEDS = {1: "slow", 2: "normal", 3: "fast"}


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: ``subjNNN.h5``."""
    return re.fullmatch(r"subj\w+\.h5", path.name) is not None and path.is_file()


def read(path: Path, _layout: Any = None) -> list[InMemory]:
    """Return a reader of each footfall, for `taxel.open`, each unloaded before it begins."""
    return readers(path, "plate", map(begun_unloaded, trials(path)))


def begun_unloaded(trial: Trial) -> Trial:
    """Return a footfall with frames of 0 before its first load.

    The plate starts itself at the first load, so that the frames before it, which the file lacks, are 0: without them
    no sensor would be seen to be loaded at contact, and its rest would not be known.
    """
    first = int(trial.frames.values.any(axis=(1, 2)).argmax())
    return replace(trial, frames=after_zeros(trial.frames[first:], BEFORE_S))


def trials(path: Path) -> Iterator[Trial]:
    """Yield the footfalls of one person's file.

    Frames are of the plate's own sensors (7.62 mm along the walk, 5.08 mm across), from the first frame to the one
    after foot-off. Reference events are those of ``events.csv`` if the folder has it, else computed by `events` (by the
    same rules).

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : a file that breaks the format
    """
    known, about = (
        {(row["subject"], row["trial"]): row for row in table(path.parent / name).to_dict("records")}
        for name in ("events.csv", "trials.csv")
    )
    for name, stored in _images(path):
        is_counts = stored.dtype.kind in "ui" and stored.ndim == 3 and stored.any() and stored.min() >= 0
        if not re.fullmatch(r"img[0-9]+", name) or not is_counts:
            raise FormatError(
                f"{path.name}, {name}: must be imgNNN, with counts, rows x columns x frames, some above 0"
            )
        key, image = (path.stem, int(name[3:])), stored.astype(np.int32)
        told = known.get(key)
        frame = events(image) if told is None else {event: int(told[f"{event}_frame"]) for event in _EVENTS}
        end = min(frame["foot_off"] + 1, image.shape[2])
        try:
            sensors = sensor_rows(image)[:, :, :end]
        except FormatError as error:
            raise FormatError(f"{path.name}, {name}: {error}") from None
        values = np.ascontiguousarray(sensors.transpose(2, 0, 1), np.float32)
        array = Array(values.shape[1], values.shape[2], (ROW_MM, COLUMN_MM), name="footscan plate")
        row = about.get(key)
        spoken = {} if row is None else {"condition": _SPEEDS.get(row["condition"], ""), "speed_m_s": row["speed_m_s"]}
        truth = {event: np.array([frame[event] * FRAME_US]) for event in _EVENTS}
        yield Trial(
            name=f"{path.stem}/{key[1]:02d}",
            person=path.stem,
            frames=Frames(values, np.arange(end) * FRAME_US, unit="counts", array=array),
            truth=truth,
            source=_SOURCE,
            scored=(0, (end - 1) * FRAME_US),
            about={"row_mm": ROW_MM, "column_mm": COLUMN_MM, **spoken},
        )


def _images(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield each data set of a file, one after the other, by its name."""
    import h5py  # noqa: PLC0415  takes long

    try:
        with h5py.File(path) as h5:
            for name in sorted(h5):
                data = h5[name]
                # The values may be in any other file of the user, by a link or as a data set.
                if not isinstance(data, h5py.Dataset) or data.file != h5 or data.external or data.is_virtual:
                    raise FormatError(f"{path.name}, {name}: must be a data set with its values in this file")
                yield name, data[...]
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise FormatError(f"{path.name}: the HDF5 file is damaged: {error}") from None


def sensor_rows(image: NDArray[np.int32]) -> NDArray[np.int32]:
    """Revert the interpolation of the rows: three image rows were made of every two sensor rows.

    Parameters
    ----------
    image : int, shape (rows, columns, frames), counts

    Returns
    -------
    int32, shape (sensor rows, columns, frames), counts
        Accurate to 1 count; begins with the first row of the footprint's bounding box.

    Raises
    ------
    FormatError : the rows were not made three from two

    Notes
    -----
    With S the sensors and s the first row of the box: image[s + 3k] = S[2k] exactly, and the two rows after it are
    linearly interpolated to S[2k+1] and from there to S[2k+2], rounded down to whole counts. The phase is the one of
    three under which the fewest cells violate |3 (b - c) - (a - d)| <= 3, over the whole trial.
    """
    frames = image
    # Cells outside of the box of all loaded columns and frames are 0 and are on every line.
    box = tuple(_span(np.flatnonzero(frames.any(axis=axes))) for axes in ((0, 2), (0, 1)))
    y = frames[:, *box]
    rows = y.shape[0]
    padded = np.concatenate([y, np.zeros((6, *y.shape[1:]), np.int32)])
    breaks = []
    for p in range(3):
        a, b, c, d = (padded[p + k : p + k + 3 * ((rows - p + 2) // 3) : 3] for k in range(4))
        breaks.append(int(np.count_nonzero(np.abs(3 * (b - c) - (a - d)) > 3)))
    phase = int(np.argmin(breaks))
    first = int(np.flatnonzero(y.any(axis=(1, 2)))[0])
    start = first - (first - phase) % 3
    if start < 0:
        raise FormatError(f"the interpolated rows begin at row {start}, before the first row: the image is cut")
    count = (rows - start + 2) // 3
    a, b, c, d = (padded[start + k : start + k + 3 * count : 3] for k in range(4))
    off = int(np.count_nonzero(np.abs(3 * (b - c) - (a - d)) > 3))
    if 100 * off > np.count_nonzero(a | b | c | d):
        raise FormatError(f"{off} cells do not fit rows that were interpolated, three image rows from two sensor rows")
    between = np.maximum(np.rint((3 * (b + c) - a - d + 2) / 4), 0).astype(np.int32)
    between[(b == 0) | (c == 0)] = 0
    sensors = np.zeros((2 * count, *frames.shape[1:]), np.int32)
    sensors[0::2, *box], sensors[1::2, *box] = a, between
    return sensors


def _span(there: NDArray[np.intp]) -> slice:
    """Return the span from the first to the last of ascending places."""
    return slice(int(there[0]), int(there[-1]) + 1)


def events(image: NDArray[np.int32]) -> dict[str, int]:
    """Find contact, heel-off and foot-off of one footfall, as frame numbers.

    Parameters
    ----------
    image : int, shape (rows, columns, frames), counts
        The image of the file, unchanged.

    Returns
    -------
    dict of int
        ``contact``: the first frame with any load; ``foot_off``: the frame after the last; ``heel_off``: the frame
        after the last in which the first 30 % of the rows ever loaded carry at least 5 % of their largest sum;
        ``p5``, ``p10``: the first frame with 5 %, 10 % of the largest sum, ``peak_sum``; ``flicker``: 1 if a frame in
        between has no load at all.
    """
    total = image.sum(axis=(0, 1), dtype=np.int64)
    loaded = np.flatnonzero(total > 0)
    rows = np.flatnonzero(image.any(axis=(1, 2)))
    n = int(rows[-1] - rows[0]) + 1
    heel = image[rows[0] : rows[0] + math.floor(0.3 * n + 0.5)].sum(axis=(0, 1), dtype=np.int64)
    peak = int(total.max())
    return {
        "contact": int(loaded[0]),
        "p5": int(np.flatnonzero(total * 20 >= peak)[0]),
        "p10": int(np.flatnonzero(total * 10 >= peak)[0]),
        "heel_off": int(np.flatnonzero(heel * 20 >= heel.max())[-1]) + 1,
        "foot_off": int(loaded[-1]) + 1,
        "peak_sum": peak,
        "flicker": int(len(loaded) < loaded[-1] - loaded[0] + 1),
    }
