"""A footscan-type plate, one barefoot footfall in each trial (jiku-data, SpeedPP2DS; J. Biomech. 41:1987, 2008).

A file ``subjNNN.h5`` holds one person: data sets ``imgNNN``, rows x columns x frames, 500 frames a second, heel at the
low rows. Values are counts of unknown unit. The file's rows are interpolated, three from two; the reader reverts this.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.arrays import datasets, hdf5, read_dataset
from taxel._base.columns import frozen
from taxel._base.errors import refused
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import candidates, files_at
from taxel.formats.trial import Trial
from taxel.frames import Frames

if TYPE_CHECKING:
    import h5py

__all__ = ["COLUMN_MM", "FRAME_US", "ROW_MM", "events", "files", "sensor_rows", "trials"]

#: Time between frames, us.
FRAME_US = 2000
#: Pitch of the sensors along the walk and across it, mm: that of the usual footscan plate, inferred from the
#: interpolation of three rows from two.
ROW_MM, COLUMN_MM = 7.62, 5.08

_SOURCE = (
    "the full plate: contact and foot-off are the first and the last loaded frame; heel-off is the time when the "
    "load of the heel region falls below 5 % of its peak"
)


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``subj*.h5``."""
    return [f for f in candidates(path, "subj*.h5") if re.fullmatch(r"subj\w+\.h5", f.name)]


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the footfalls of one person's file, or of all in a folder.

    Frames are of the plate's own sensors (7.62 mm along the walk, 5.08 mm across), from the first frame to the one
    after foot-off. Reference events are those of ``events.csv`` if the folder has it, else computed by `events` (by the
    same rules).

    Parameters
    ----------
    path : str or Path

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : a file that breaks the format
    """
    paths = files_at(path, files, "file subjNNN.h5")
    folder = paths[0].parent
    known, about = _events_table(folder / "events.csv"), _trials_table(folder / "trials.csv")
    for file in paths:
        person = file.stem
        with hdf5(file) as h5:
            for name in sorted(datasets(h5)):
                match = re.fullmatch(r"img([0-9]{1,18})", name)
                if match is None:
                    raise FormatError(f"{file.name}: the data set {name!r} must have a name like imgNNN")
                number, image = int(match[1]), _image(h5, name, file)
                yield _trial(person, number, image, file, known.get((person, number)), about.get((person, number)))


def _image(h5: h5py.File, name: str, file: Path) -> NDArray[np.int32]:
    values = read_dataset(h5, name)
    if values.dtype.kind not in "ui" or values.ndim != 3 or 0 in values.shape:
        raise FormatError(f"{file.name}, {name}: must contain whole numbers, rows x columns x frames")
    image: NDArray[np.int32] = arguments.numbers(f"{file.name}: {name}", values, np.int32)
    if image.min() < 0 or not image.any():
        raise FormatError(f"{file.name}, {name}: {'counts are below 0' if image.min() < 0 else 'no count is above 0'}")
    return image


def _trial(
    person: str,
    number: int,
    image: NDArray[np.int32],
    file: Path,
    known: dict[str, int] | None,
    about: dict[str, str | float] | None,
) -> Trial:
    frame = known or events(image)
    end = min(frame["foot_off"] + 1, image.shape[2])
    try:
        sensors = sensor_rows(image)[:, :, :end]
    except FormatError as error:
        raise FormatError(f"{file.name}, img{number:03d}: {error}") from None
    values = np.ascontiguousarray(sensors.transpose(2, 0, 1), np.float32)
    array = Array(values.shape[1], values.shape[2], (ROW_MM, COLUMN_MM), name="footscan plate")
    return Trial(
        name=f"{person}/{number:02d}",
        person=person,
        recorded=Frames(frozen(values), np.arange(end) * FRAME_US, unit="counts", array=array),
        truth={e: np.array([frame[e] * FRAME_US]) for e in ("contact", "heel_off", "foot_off")},
        source=_SOURCE,
        about={"row_mm": ROW_MM, "column_mm": COLUMN_MM, **(about or {})},
    )


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
    ProblemError : not counts of shape (rows, columns, frames), or no count above 0

    Notes
    -----
    With S the sensors and s the first row of the box: image[s + 3k] = S[2k] exactly, and the two rows after it are
    linearly interpolated to S[2k+1] and from there to S[2k+2], rounded down to whole counts. The phase is the one of
    three under which the fewest cells violate |3 (b - c) - (a - d)| <= 3, over the whole trial.
    """
    frames = _check_image(image)
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

    Raises
    ------
    ProblemError : not counts of shape (rows, columns, frames), or no count above 0
    """
    image = _check_image(image)
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


def _check_image(image: NDArray[np.int32]) -> NDArray[np.int32]:
    counts: NDArray[np.int32] = arguments.numbers("image", image, np.int32)
    if counts.ndim != 3 or not counts.any() or counts.min() < 0:
        raise refused(
            "image",
            f" has shape {counts.shape}: must be counts of 0 or more, rows x columns x frames, at least one of "
            f"them above 0",
        )
    return counts


def _events_table(path: Path) -> dict[tuple[str, int], dict[str, int]]:
    columns = {e: f"{e}_frame" for e in ("contact", "heel_off", "foot_off")}
    rows = text.table(path, ["subject", "trial", *columns.values()], optional=True)
    numbers = [
        {c: int(text.number(row[c], path, int(row["line"]), c)) for c in ("trial", *columns.values())} for row in rows
    ]
    return {
        (row["subject"], cells["trial"]): {event: cells[c] for event, c in columns.items()}
        for row, cells in zip(rows, numbers, strict=True)
    }


def _trials_table(path: Path) -> dict[tuple[str, int], dict[str, str | float]]:
    names = {"1": "slow", "2": "normal", "3": "fast"}
    return {
        (row["subject"], int(text.number(row["trial"], path, int(row["line"]), "trial"))): {
            "condition": names.get(row["condition"], row["condition"]),
            "speed_m_s": text.number(row["speed_m_s"], path, int(row["line"]), "speed_m_s"),
        }
        for row in text.table(path, ["subject", "trial", "condition", "speed_m_s"], optional=True)
    }
