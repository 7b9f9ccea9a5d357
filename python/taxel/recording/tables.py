"""Tables of events or pictures: .csv and .npz.

A .csv is either ``t_us,x,y,p[,intensity][,repaired]`` (an empty intensity is one that did not come), or ``t_us`` and
a column a taxel, named ``x3y5``. A .npz holds the same columns as arrays, and beside them, as JSON in ``about``, what
a .csv cannot hold: the sensor, registers, notes, detections and what was lost.
"""

from __future__ import annotations

import io
import math
import re
import zipfile
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.limits import COLUMNS, DESCRIPTION, TAXELS, UNPACKED, VALUE, unpacked
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.checks import table as limited
from taxel.frames import Frames
from taxel.recording.remarks import Remarks

__all__ = ["columns_of", "read_csv", "read_npz", "table_of", "write_csv", "write_npz"]

_EVENTS = ("t_us", "x", "y", "p")
_MORE = ("intensity", "repaired")
_COLUMNS = ("t", "x", "y", "p", "intensity", "present", "repaired", "markers", "values", "unit", "about")
_TAXEL = re.compile(r"x(\d{1,5})y(\d{1,5})")


def columns_of(table: Events | Frames) -> dict[str, NDArray[Any]]:
    """Return a table as columns by name, as .npz and .h5 hold it."""
    if isinstance(table, Frames):
        return {"values": table.values, "t": table.t, "unit": np.array(table.unit)}
    columns: dict[str, Any] = {"t": table.t, "x": table.x, "y": table.y, "p": table.p}
    if table.intensity is not None:
        columns |= {"intensity": table.intensity, "present": table.present}
    if table.repaired is not None:
        columns["repaired"] = table.repaired
    return {**columns, "markers": np.array(table.markers, np.int64).reshape(-1, 2)}


def write_npz(file: BinaryIO, table: Events | Frames, remarks: Remarks) -> None:
    """Write a .npz."""
    about = np.array(replace(remarks, array=table.array).to_json())
    np.savez_compressed(file, about=about, **cast(dict[str, Any], columns_of(table)))


def read_npz(path: Path, array: Array | None) -> tuple[Events | Frames, Remarks]:
    """Read a .npz of ours, or one with the columns ``t x y p`` or ``values t``."""
    try:
        columns = _unpacked(path)
    except (OSError, FormatError):
        raise
    # What numpy and zipfile raise on damage is no closed list: zlib.error, TokenError, struct.error ...
    except Exception as error:
        raise FormatError(f"{path}: a .npz that cannot be unpacked ({_line(error)}); write it again") from None
    return table_of(path, columns, array)


def table_of(path: Path, columns: dict[str, NDArray[Any]], array: Array | None) -> tuple[Events | Frames, Remarks]:
    """Make a table of the columns of a file, which become its own, with the remarks that stand beside them."""
    columns = {name: frozen(values) for name, values in columns.items()}
    remarks = Remarks.from_json(f"{path}, array about", str(columns.get("about", "{}")))
    sensor = array or remarks.array
    try:
        if "values" in columns and "t" in columns:
            unit = str(columns.get("unit", "counts"))
            return limited(path, Frames(columns["values"], columns["t"], unit=unit, array=sensor)), remarks
        missing = [name for name in _COLUMNS[:4] if name not in columns]
        if missing:
            names = ", ".join(columns) or "nothing"
            raise FormatError(
                f"{path}: holds {names}: {missing[0]} is missing; must be t, x, y, p (events) or values, t (pictures)"
            )
        t, x, y, p = (columns[name] for name in _COLUMNS[:4])
        markers = [(int(at), bool(start)) for at, start in columns.get("markers", np.empty((0, 2)))]
        extra = {name: columns[name] for name in ("intensity", "present", "repaired") if name in columns}
        return limited(path, Events(t, x, y, p, array=sensor or _around(x, y), markers=markers, **extra)), remarks
    except (ProblemError, ValueError, TypeError, OverflowError) as error:
        raise FormatError(f"{path}: {_line(error)}") from None


def _unpacked(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of a .npz that are ours, once all have said how large they are."""
    columns = {}
    with zipfile.ZipFile(path) as archive:
        members = {name.removesuffix(".npy"): name for name in archive.namelist()}
        wanted = [name for name in _COLUMNS if name in members]
        total = 0
        for name in wanted:
            with archive.open(members[name]) as file:
                shape, dtype = _described(file)
                begin = file.tell()
            place = f"{path}, array {name}"
            if dtype.hasobject:
                raise FormatError(f"{place}: holds Python objects; must be numbers or text")
            size = math.prod(shape) * dtype.itemsize
            total += size
            # Python keeps a character in 4 bytes.
            unpacked(place, size, 4 * DESCRIPTION if name in {"about", "unit"} else UNPACKED)
            unpacked(place, total)
            there = archive.getinfo(members[name]).file_size - begin
            if size != there:
                raise FormatError(f"{place}: says that it holds {size} bytes ({shape}, {dtype}); there are {there}")
        for name in wanted:
            with archive.open(members[name]) as file:
                columns[name] = np.lib.format.read_array(file, allow_pickle=False)
    # A column of another name is not read, but stands in the error of what is missing.
    return columns or {name: np.empty(0) for name in list(members)[:8]}


def _described(file: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the shape and the kind that an array says it has."""
    read = {1: np.lib.format.read_array_header_1_0, 2: np.lib.format.read_array_header_2_0}
    version = np.lib.format.read_magic(file)
    if version[0] not in read:
        raise ValueError(f"version {version[0]} of the description; there are 1 and 2")
    shape, _, dtype = read[version[0]](file)
    if any(isinstance(n, bool) or n < 0 for n in shape):
        raise ValueError(f"shape {shape}")
    return shape, dtype


def write_csv(file: BinaryIO, table: Events | Frames) -> None:
    """Write a .csv."""
    if isinstance(table, Frames):
        places = _places(table.array)
        names = ",".join(["t_us", *(f"x{x}y{y}" for x, y in places)])
        file.write(names.encode() + b"\n")
        for t, picture in zip(table.t, table.values, strict=True):
            # repr of a float32 is the shortest text that gives it back.
            values = (_shortest(picture[y, x]) for x, y in places)
            file.write(",".join([str(t), *values]).encode() + b"\n")
        return
    columns: list[NDArray[Any]] = [table.t, table.x, table.y, table.p.astype(np.uint8)]
    more = [name for name in _MORE if getattr(table, name) is not None]
    file.write(",".join([*_EVENTS, *more]).encode() + b"\n")
    block = 1 << 16
    for k in range(0, len(table), block):
        rows = [column[k : k + block].astype(str) for column in columns]
        if table.intensity is not None and table.present is not None:
            ticks = table.intensity[k : k + block].astype(str)
            rows.append(np.where(table.present[k : k + block], ticks, ""))
        if table.repaired is not None:
            rows.append(table.repaired[k : k + block].astype(np.uint8).astype(str))
        file.write("\n".join(map(",".join, zip(*(r.tolist() for r in rows), strict=True))).encode() + b"\n")


def read_csv(path: Path, array: Array | None) -> tuple[Events | Frames, Remarks]:
    """Read a .csv of events or of pictures."""
    raw = path.read_bytes().replace(b"\r\n", b"\n").removeprefix(b"\xef\xbb\xbf")
    head, _, body = raw.partition(b"\n")
    columns = head.count(b",") + 1
    if columns > COLUMNS:
        raise FormatError(f"{path}, line 1: {columns} columns; at most {COLUMNS} are read")
    try:
        names = [name.strip() for name in head.decode().split(",")]
    except UnicodeDecodeError:
        names = []
    if not names or names[0] != "t_us" or len(names) < 2:
        said = repr(head[:40].decode("utf-8", "replace"))
        raise FormatError(
            f"{path}, line 1: {said}: must be t_us,x,y,p[,intensity][,repaired], or t_us and a column a taxel"
        )
    if tuple(names[:4]) == _EVENTS:
        if names[4:] != [name for name in _MORE if name in names[4:]]:
            raise FormatError(
                f"{path}, line 1: {shown(','.join(names[4:]))} after p: only intensity and repaired may follow"
            )
        return limited(path, _csv_events(path, names, body, array)), Remarks()
    repeated = next((name for name, n in Counter(names).items() if n > 1), None)
    if repeated is not None:
        raise FormatError(f"{path}, line 1: column {shown(repeated)} stands there twice")
    return limited(path, _csv_frames(path, names, body, array)), Remarks()


def _csv_events(path: Path, names: list[str], body: bytes, array: Array | None) -> Events:
    if "intensity" in names:
        # An empty intensity is one that did not come; -1 stands for it while numbers are read.
        body = re.sub(rb",[ \t]*(?=,|\n|$)", b",-1", body)
    table = _numbers(path, names, body, np.int64)
    t, x, y, p = table[:, :4].T
    _within(path, "p", p, 0, 1)
    for name, column in (("x", x), ("y", y)):
        _within(path, name, column, 0, 65_535)
    extra: dict[str, Any] = {}
    if "intensity" in names:
        ticks = table[:, names.index("intensity")]
        _within(path, "intensity", ticks, -1, 65_535)
        extra = {"intensity": np.maximum(ticks, 0), "present": ticks >= 0}
    if "repaired" in names:
        repaired = table[:, names.index("repaired")]
        _within(path, "repaired", repaired, 0, 1)
        extra["repaired"] = repaired.astype(bool)
    try:
        return Events(t, x, y, p.astype(bool), array=array or _around(x, y), **extra)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def _csv_frames(path: Path, names: list[str], body: bytes, array: Array | None) -> Frames:
    table = _numbers(path, names, body, np.float64)
    found = [_TAXEL.fullmatch(name) for name in names[1:]]
    if all(found):
        places = [(int(m[1]), int(m[2])) for m in found if m is not None]
    elif any(found):
        odd = next(name for name, m in zip(names[1:], found, strict=True) if m is None)
        raise FormatError(f"{path}, line 1: column {shown(odd)} among taxels: must be named like x3y5")
    else:
        shape = (1, len(names) - 1) if array is None else array.shape
        if shape[0] * shape[1] != len(names) - 1:
            raise FormatError(
                f"{path}, line 1: {len(names) - 1} columns for an array of {shape[0]} x {shape[1]} taxels"
            )
        places = [(k % shape[1], k // shape[1]) for k in range(len(names) - 1)]
    x, y = np.array(places).T
    if array is None:
        rows, columns = int(y.max()) + 1, int(x.max()) + 1
        if rows * columns > TAXELS or len(table) * rows * columns > max(1 << 24, 16 * table.size):
            raise FormatError(f"{path}, line 1: {len(places)} columns for {rows} x {columns} taxels: most are missing")
        exists = np.zeros((rows, columns), bool)
        exists[y, x] = True
        array = Array(rows, columns, exists=None if exists.all() else exists)
    elif x.max() >= array.columns or y.max() >= array.rows:
        k = int(np.flatnonzero((x >= array.columns) | (y >= array.rows))[0])
        raise FormatError(f"{path}, line 1: column {names[k + 1]!r} lies outside {array.rows} x {array.columns} taxels")
    large = np.argwhere(np.abs(table[:, 1:]) > VALUE)
    if len(large):
        k, c = large[0]
        raise FormatError(f"{path}, line {k + 2}, column {names[c + 1]}: {table[k, c + 1]:g}; must fit 32 bits")
    unpacked(str(path), 4 * len(table) * array.rows * array.columns)
    values = np.zeros((len(table), *array.shape), np.float32)
    values[:, y, x] = table[:, 1:]
    try:
        return Frames(frozen(values), table[:, 0], array=array)
    except ProblemError as error:
        raise FormatError(f"{path}: {error}") from None


def _numbers(path: Path, names: list[str], body: bytes, dtype: type[Any]) -> NDArray[Any]:
    """Read the rows below the names; the error names line and column."""
    if not body.strip():
        return np.empty((0, len(names)), dtype)
    try:
        table = np.loadtxt(io.BytesIO(body), dtype=dtype, delimiter=",", comments=None, ndmin=2)
    except (ValueError, OverflowError) as error:
        place = re.search(r"at row (\d+)(?:, column (\d+))?", str(error))
        # Rows are counted from 0 in one of its messages, from 1 in the other.
        row = 0 if place is None else int(place[1]) - ("changed" in str(error))
        where = "" if place is None else f", line {_line_number(body, row)}"
        if place is not None and place[2] is not None and int(place[2]) <= len(names):
            where += f", column {names[int(place[2]) - 1]}"
        said = re.sub(r" at row .*|; use `usecols`.*", "", _line(error))
        raise FormatError(f"{path}{where}: {said}; must be {len(names)} numbers a line") from None
    if table.shape[1] != len(names):
        raise FormatError(f"{path}, line 2: {table.shape[1]} numbers; must be {len(names)} numbers a line")
    return table


def _line_number(body: bytes, row: int) -> int:
    """Return the line of the file that holds a row of numbers; empty lines are no rows."""
    rows = -1
    for k, line in enumerate(body.split(b"\n")):
        rows += bool(line.strip())
        if rows == row:
            return k + 2
    return row + 2


def _within(path: Path, name: str, column: NDArray[Any], low: int, high: int) -> None:
    wrong = np.flatnonzero((column < low) | (column > high))
    if len(wrong):
        k = int(wrong[0])
        raise FormatError(f"{path}, line {k + 2}, column {name}: is {column[k]}; must be {max(0, low)} to {high}")


def _around(x: NDArray[Any], y: NDArray[Any]) -> Array:
    """Return the thesis' array, or a larger one where events lie outside it."""
    thesis = Array.thesis()
    if not len(x):
        return thesis
    if min(x.min(), y.min()) < 0 or max(x.max(), y.max()) >= 65_535:
        raise ProblemError("x and y: must lie in 0 to 65534")
    rows, columns = max(thesis.rows, int(y.max()) + 1), max(thesis.columns, int(x.max()) + 1)
    return thesis if (rows, columns) == thesis.shape else Array(rows, columns)


def _places(array: Array) -> list[tuple[int, int]]:
    """Return column and row of each taxel that exists, row by row."""
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    return [(int(x), int(y)) for y, x in np.argwhere(exists)]


def _shortest(value: np.float32) -> str:
    text = str(value)
    return text.removesuffix(".0")


def _line(error: BaseException) -> str:
    said = str(error).split("\n", maxsplit=1)[0]
    return said if len(said) <= 200 else f"{said[:197]}..."
