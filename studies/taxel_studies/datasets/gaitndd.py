"""A force-sensitive channel of each foot, five minutes of walking (PhysioNet, Gait in Neurodegenerative Disease 1.0.0).

A person is ``NAME.hea`` (WFDB header), ``NAME.let`` and ``NAME.rit`` (left and right, WFDB format 212) and ``NAME.ts``,
the authors' step times. Values are raw counts, not N, and they drift.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Array, FormatError, Frames
from taxel.reading import InMemory
from taxel_studies.datasets import Trial, numbers, readers, scored_around, whole_us

__all__ = ["format_212", "knows", "read", "step_times", "trials"]

#: The value that format 212 stores for an invalid sample.
NO_SAMPLE = -2048

_TS_COLUMNS = [
    *("time", "left stride", "right stride", "left swing", "right swing", "left swing %", "right swing %"),
    *("left stance", "right stance", "left stance %", "right stance %", "double support", "double support %"),
]
_SOURCE = "step times that the authors derived from this channel (left foot only)"


def knows(path: Path) -> bool:
    """Return whether a file is one of the data set: ``NAME.hea`` with ``NAME.let`` beside it."""
    return path.suffix == ".hea" and path.is_file() and path.with_suffix(".let").exists()


def read(path: Path, _layout: Any = None) -> list[InMemory]:
    """Return a reader of each foot, for `taxel.open`."""
    return readers(path, "gaitndd", trials(path))


def trials(path: Path) -> Iterator[Trial]:
    """Yield the left and the right channel of one person.

    The right channel has no step times, so its trial has no reference events. Invalid samples are skipped.

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : a file that breaks the format, or whose sum is not the one that the header states (names it)
    """
    lines = [line.split() for line in path.read_text("latin-1").splitlines() if line.strip() and line[0] != "#"]
    steps = path.with_suffix(".ts")
    try:
        rate, samples = float(lines[0][2].split("/")[0].split("(")[0]), int(lines[0][3])
        signals = [(cells[0], int(cells[5]), int(cells[6])) for cells in lines[1 : 1 + int(lines[0][1])]]
        if not 0 < rate <= 1e6 or samples < 1 or any(cells[1] != "212" for cells in lines[1:]):
            raise ValueError("the rate must be above 0, and the format 212")
    except (ValueError, IndexError) as error:
        raise FormatError(f"{path.name}: must state signals of format 212, their rate and samples: {error}") from None
    for name, first, checksum in signals:
        file = path.parent / Path(name).name
        if not file.is_file():
            raise FormatError(f"{path.name}: names the signal file {file.name!r}, which is not beside it")
        values = _samples(file, samples, first, checksum)
        valid = np.flatnonzero(values != NO_SAMPLE)
        foot = {".let": "left", ".rit": "right"}.get(file.suffix, "")
        truth = step_times(steps) if foot == "left" and steps.exists() else {}
        array = Array(1, 1, name="gaitndd foot")
        yield Trial(
            name=f"{path.stem} {foot}".strip(),
            person=path.stem,
            frames=Frames(values[valid, None, None], whole_us(valid / rate), unit="raw", array=array),
            truth=truth,
            source=_SOURCE,
            foot=foot,
            group="healthy" if path.stem.startswith("control") else "patient",
            scored=scored_around(truth),
        )


def format_212(data: bytes) -> NDArray[np.int16]:
    """Unpack WFDB format 212: two signed 12-bit samples in three bytes.

    Examples
    --------
    >>> format_212(bytes([0x01, 0x80, 0xFF]))
    array([   1, -1793], dtype=int16)
    """
    b = np.frombuffer(data, np.uint8).reshape(-1, 3).astype(np.int16)
    pairs = np.stack([b[:, 0] + 256 * (b[:, 1] & 15), b[:, 2] + 256 * (b[:, 1] >> 4)], axis=1)
    return np.where(pairs > 2047, pairs - 4096, pairs).astype(np.int16).ravel()


def step_times(path: Path) -> dict[str, NDArray[np.int64]]:
    """Read the left foot's heel strikes and foot-offs from the authors' step times.

    Parameters
    ----------
    path : Path
        ``NAME.ts``: 13 columns; the first is the left heel strike that ends the row's left stride (verified: its
        differences are the strides), and the foot-off is one left swing before it.

    Returns
    -------
    dict of int64 times, us
        ``contact`` (including the start of the first stride) and ``foot_off``.

    Raises
    ------
    FormatError : a line without 13 numbers, or times that do not ascend (names file and line)
    """
    values = numbers(path, _TS_COLUMNS, r"\s+")
    time, stride, swing = values[:, 0], values[:, 1], values[:, 3]
    wrong = np.flatnonzero((np.diff(time, prepend=-np.inf) <= 0) | (stride <= 0) | (swing <= 0) | (swing >= stride))
    if len(wrong):
        raise FormatError(
            f"{path.name}, line {wrong[0] + 1}: times must ascend, and swing must be above 0 and below stride"
        )
    strikes = np.unique(whole_us(np.concatenate([[time[0] - stride[0]], time])))
    return {"contact": strikes, "foot_off": whole_us(time - swing)}


def _samples(path: Path, samples: int, first: int, checksum: int) -> NDArray[np.int16]:
    data = path.read_bytes()
    if len(data) != 3 * ((samples + 1) // 2):
        raise FormatError(f"{path.name}: {len(data)} bytes; must be {3 * ((samples + 1) // 2)} for {samples} samples")
    values = format_212(data)[:samples]
    # In the header's checksum an invalid sample counts as -32768, or as it is.
    plain = int(values.sum(dtype=np.int64))
    total = plain + (-32768 - NO_SAMPLE) * int(np.count_nonzero(values == NO_SAMPLE))
    sums = {(value + 32768) % 65536 - 32768 for value in (total, plain)}
    if values[0] != max(first, NO_SAMPLE) or checksum not in sums:
        raise FormatError(f"{path.name}: the first sample, or the sum of all, is not the one that the header states")
    return values
