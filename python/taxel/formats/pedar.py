"""novel pedar insoles: the ``.asc`` export, usually 2 x 99 sensors in kPa.

Some header lines, one of column names (``time[secs]``, then the sensors' numbers, left insole first), then a row for
each frame. Only the header has the frame rate.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import Growing
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats import text
from taxel.formats.checks import ascending, candidates, files_at, whole_us
from taxel.formats.trial import Trial, scored_around, stances
from taxel.frames import Frames

__all__ = ["contacts", "files", "trials"]

_SOURCE = "the sum of the same insole, at 10 % of its largest value: not independent of the readings"


def files(path: Path) -> list[Path]:
    """Find the files of this format: ``.asc`` whose head names time in seconds."""
    return [f for f in candidates(path, "*") if f.suffix.lower() == ".asc" and _is_export(f)]


def _is_export(path: Path) -> bool:
    return b"pressure values" in text.first_bytes(path, 65_536)


def trials(path: str | Path) -> Iterator[Trial]:
    """Yield the left and the right insole of one recording, or of all in a folder.

    The recording has no reference events: contact and foot-off are the times at which the sum of the foot crosses 10 %
    of its maximum.

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : a file that breaks the format (names file, line and column)
    """
    for file in files_at(path, files, "pedar .asc"):
        yield from _read(file)


def _read(file: Path) -> Iterator[Trial]:
    content = text.stream(file)
    before, columns = text.before(content, lambda line: line.startswith("time[secs]"))
    head = len(before)
    if columns is None:
        raise FormatError(f"{file.name}: the line of column names (time[secs] 1 2 ...) is missing")
    header = "\n".join(before)
    rate = re.search(r"scanning rate\s*\[Hz\]:\s*(\S+)", header)
    if rate is None:
        raise FormatError(f"{file.name}, line {head + 1}: a line 'scanning rate [Hz]' is missing above")
    hertz = text.number(rate[1], file, 1 + header[: rate.start()].count("\n"), "scanning rate")
    if hertz <= 0:
        raise FormatError(f"{file.name}: the scanning rate is {hertz:g} Hz; must be above 0")
    unit = re.search(r"pressure values in\s+(\S+)", header)
    names = columns.split()
    begins = [k for k, name in enumerate(names) if name == "1"]
    if len(begins) != 2:
        raise FormatError(
            f"{file.name}, line {head + 1}: the numbers of the columns begin at 1 {len(begins)} times; must be twice, "
            "for two insoles"
        )
    feet = {"left": slice(begins[0], begins[1]), "right": slice(begins[1], len(names))}
    shapes: dict[str, Any] = {foot: ((len(names[part]),), np.float32) for foot, part in feet.items()}
    read = Growing(file.name, t=((), np.int64), totals=((2,), np.float64), **shapes)
    for line, values in text.blocks((line.split() for line in content if line.strip()), file, head + 2, names):
        pressures = {foot: values[:, part] for foot, part in feet.items()}
        totals = np.stack([pressure.sum(axis=1) for pressure in pressures.values()], axis=1)
        read.add(t=whole_us(file.name, values[:, 0], line), totals=totals, **pressures)
    t = ascending(file.name, read.column("t"), head + 2)
    far = np.flatnonzero(np.abs((t[1:] - t[:-1]) - 1e6 / hertz) > 0.25e6 / hertz)
    if len(far):
        k = int(far[0])
        raise FormatError(
            f"{file.name}, line {head + 3 + k}: the time is {t[k + 1] - t[k]} us after that of the line above; must "
            f"fit {hertz:g} Hz"
        )
    for foot, total in zip(feet, read.column("totals").T, strict=True):
        frames = contacts(total)
        truth = {"contact": t[frames[:, 0]], "foot_off": t[frames[:, 1]]}
        yield Trial(
            name=f"{file.stem} {foot}",
            person=file.stem,
            recorded=Frames(
                (pressure := read.column(foot))[:, None],
                t,
                unit=unit[1] if unit else "kPa",
                array=Array(1, pressure.shape[1], name="pedar insole"),
            ),
            truth=truth,
            source=_SOURCE,
            foot=foot,
            scored=scored_around(truth),
            series={"total": total},
        )


def contacts(total: NDArray[np.float64]) -> NDArray[np.int64]:
    """Find stances: from the first sample of at least 10 % of the largest sum to the next one below.

    Parameters
    ----------
    total : float64, shape (samples,)

    Returns
    -------
    int64, shape (stances, 2)
        Stances that begin or end outside the recording are excluded.

    Examples
    --------
    >>> contacts(np.array([9.0, 0.0, 5.0, 10.0, 1.0, 0.5, 0.0]))
    array([[2, 5]])
    """
    total = arguments.floats("total", total)
    loaded = (total >= 0.1 * total.max()).astype(np.int8) if len(total) else np.zeros(0, np.int8)
    edges = np.diff(loaded)
    return stances(np.flatnonzero(edges > 0) + 1, np.flatnonzero(edges < 0) + 1)
