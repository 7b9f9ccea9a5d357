"""A force-sensitive channel of each foot, five minutes of walking (PhysioNet, Gait in Neurodegenerative Disease 1.0.0).

A person is ``NAME.hea`` (WFDB header), ``NAME.let`` and ``NAME.rit`` (left and right, WFDB format 212) and ``NAME.ts``,
the authors' step times. Values are raw counts, not N, and they drift.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import Growing
from taxel._base.errors import refused
from taxel._base.limits import check_memory
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending, candidates, files_at, whole_us
from taxel.formats.trial import Trial, scored_around
from taxel.frames import Frames

__all__ = ["files", "format_212", "step_times", "trials"]

#: The value that format 212 stores for an invalid sample.
NO_SAMPLE = -2048
#: Samples, or three bytes with two of them, that are unpacked at once.
_AT_ONCE = 1 << 16

_TS_COLUMNS = [
    *("time", "left stride", "right stride", "left swing", "right swing", "left swing %", "right swing %"),
    *("left stance", "right stance", "left stance %", "right stance %", "double support", "double support %"),
]
_SOURCE = "step times that the authors derived from this channel (left foot only)"


def files(path: Path) -> list[Path]:
    """Find the headers of this format: ``NAME.hea`` with ``NAME.let`` beside it."""
    return [f for f in candidates(path, "*.hea") if f.suffix == ".hea" and f.with_suffix(".let").exists()]


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the left and the right channel of one person, or of all in a folder.

    The right channel has no step times, so its trial has no reference events. Invalid samples are skipped.

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : a file that breaks the format (names file and line or byte)
    """
    for header in files_at(path, files, "NAME.hea with NAME.let"):
        rate, samples, signals = _header(header)
        steps = header.with_suffix(".ts")
        for name, first, checksum in signals:
            file = header.parent / name
            foot = {".let": "left", ".rit": "right"}.get(file.suffix, "")
            values = _samples(file, samples, first, checksum)
            kept = Growing(header.name, t=((), np.int64), values=((1, 1), np.float32))
            for k in range(0, samples, _AT_ONCE):
                valid = k + np.flatnonzero(values[k : k + _AT_ONCE] != NO_SAMPLE)
                kept.add(t=whole_us(header.name, valid / rate, 0), values=values[valid, None, None])
            truth = step_times(steps) if foot == "left" and steps.exists() else {}
            yield Trial(
                name=f"{header.stem} {foot}".strip(),
                person=header.stem,
                recorded=Frames(
                    kept.column("values"),
                    ascending(header.name, kept.column("t"), 0),
                    unit="raw",
                    array=Array(1, 1, name="gaitndd foot"),
                ),
                truth=truth,
                source=_SOURCE,
                foot=foot,
                group="healthy" if header.stem.startswith("control") else "patient",
                scored=scored_around(truth),
            )


def format_212(data: bytes, name: str = "data") -> NDArray[np.int16]:
    """Unpack WFDB format 212: two signed 12-bit samples in three bytes.

    Parameters
    ----------
    data : bytes
    name : str
        The file's name, for the error.

    Returns
    -------
    int16, shape (2 * len(data) / 3,)

    Raises
    ------
    FormatError : a length that is not a multiple of 3

    Examples
    --------
    >>> format_212(bytes([0x01, 0x80, 0xFF]))
    array([   1, -1793], dtype=int16)
    """
    if not isinstance(data, bytes | bytearray | memoryview):
        raise refused("data", f" is {arguments.shown(data)}: must be bytes")
    if len(data) % 3:
        raise FormatError(
            f"{name}: {len(data)} bytes; must be a multiple of 3, because format 212 has two samples in three bytes"
        )
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
    path = Path(arguments.checked_path("path", path))
    rows = [line.split() for line in text.lines(path)]
    values = text.numbers(rows, path, 1, _TS_COLUMNS)
    if not len(values):
        raise FormatError(f"{path.name}: the file is empty; must have a line for each stride")
    time, stride, swing = values[:, 0], values[:, 1], values[:, 3]
    off = time - swing
    wrong = np.flatnonzero((np.diff(time, prepend=-np.inf) <= 0) | (stride <= 0) | (swing <= 0) | (swing >= stride))
    if len(wrong):
        raise FormatError(
            f"{path.name}, line {wrong[0] + 1}: times must ascend, and swing must be above 0 and below stride"
        )
    strikes = np.unique(whole_us(path.name, np.concatenate([[time[0] - stride[0]], time])))
    return {"contact": strikes, "foot_off": whole_us(path.name, off)}


def _header(path: Path) -> tuple[float, int, list[tuple[str, int, int]]]:
    """Return the rate, the number of samples, and file, first value and checksum of each signal."""
    rows = [(k, line.split()) for k, line in enumerate(text.lines(path), start=1) if line.strip() and line[0] != "#"]
    if not rows or len(rows[0][1]) < 4:
        raise FormatError(f"{path.name}, line 1: must contain name, signals, rate and samples")
    k, record = rows[0]
    signals = int(text.number(record[1], path, k, "number of signals"))
    rate = text.number(record[2].split("/")[0].split("(")[0], path, k, "rate")
    samples = int(text.number(record[3], path, k, "number of samples"))
    if not 0 < rate <= 1e6 or samples < 1 or signals < 1:
        values = f"{signals} signals, {rate:g} Hz, {samples} samples"
        raise FormatError(f"{path.name}, line {k}: {values}; must be above 0, and the rate at most 1000000 Hz")
    if len(rows) < 1 + signals:
        raise FormatError(f"{path.name}: {len(rows) - 1} lines of signals; must be {signals}, as line 1 states")
    channels = []
    for k, cells in rows[1 : 1 + signals]:
        if len(cells) < 7:
            raise FormatError(f"{path.name}, line {k}: {len(cells)} cells; must be file, format ... checksum")
        if cells[1] != "212":
            raise FormatError(f"{path.name}, line {k}: the format is {cells[1]}; must be 212")
        if not re.fullmatch(r"[\w.-]+", cells[0]):
            raise FormatError(f"{path.name}, line {k}: {cells[0]!r} is not a plain file name")
        first, checksum = (int(text.number(cells[c], path, k, w)) for c, w in ((5, "first value"), (6, "checksum")))
        channels.append((cells[0], first, checksum))
    return rate, samples, channels


def _samples(path: Path, samples: int, first: int, checksum: int) -> NDArray[np.int16]:
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise FormatError(f"{path.name}: the header names this file, but it is missing") from None
    with file:
        size = os.fstat(file.fileno()).st_size
        if size != 3 * ((samples + 1) // 2):
            raise FormatError(
                f"{path.name}: {size} bytes; must be {3 * ((samples + 1) // 2)} for {samples} samples of format 212"
            )
        # A frame of one channel has 12 bytes.
        check_memory(path.name, 12 * samples)
        read = Growing(path.name, values=((), np.int16))
        while data := file.read(3 * _AT_ONCE):
            read.add(values=format_212(data, path.name))
    values = np.asarray(read.column("values")[:samples], np.int16)
    expected = NO_SAMPLE if first == -32768 else first
    if values[0] != expected:
        raise FormatError(f"{path.name}: the first value is {values[0]}; must be {first}, as the header states")
    # In the header's checksum an invalid sample counts as -32768.
    plain = int(values.sum(dtype=np.int64))
    total = plain + (-32768 - NO_SAMPLE) * int(np.count_nonzero(values == NO_SAMPLE))
    if checksum not in {_int16(total), _int16(plain)}:
        raise FormatError(
            f"{path.name}: the sum of the samples is {_int16(total)} (16 bits); must be {checksum}, as the "
            f"header states"
        )
    return values


def _int16(value: int) -> int:
    return (value + 32768) % 65536 - 32768
