"""Arrays of other programs by name (.npy, .npz, HDF5, MATLAB), read as a layout says, or as their axes look."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import read_arrays, shapes
from taxel._base.columns import frozen_whole
from taxel._base.errors import unreadable
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.checks import table as limited
from taxel.formats.column_names import AXES, time_unit
from taxel.formats.layout import Data, Layout, advice, as_size
from taxel.formats.layout_text import of_layout
from taxel.formats.table import Opened, of_axis
from taxel.formats.table_form import unit_of_times
from taxel.formats.times import UNITS_US, repaired, us_of
from taxel.frames import Frames

__all__ = ["ARRAYS", "look", "read_array_file"]

#: The endings of files of arrays.
ARRAYS = (".npy", ".npz", ".h5", ".hdf5", ".mat")


def read_array_file(path: Path, layout: Layout) -> Opened:
    """Read the frames of a file of arrays.

    Raises
    ------
    FormatError : no such array, several that may hold the frames, or axes that can be read in two ways (prints both)
    """
    how, said, stored = look(path, layout)
    shape = stored[how.array or ""]
    named = (how.axes or "").split()
    if len(named) != len(shape):
        raise unreadable(
            f"{how.array or 'the array'} has {counted(len(shape), 'axis', 'axes')} ({_size(shape)}); the layout names "
            f"{len(named)}: axes = {how.axes!r}",
            path,
        )
    wanted = [how.array or "", *([how.time] if how.time is not None else [])]
    arrays = read_arrays(path, wanted, {wanted[0]: np.float32})
    values = _in_order(path, arrays[wanted[0]], named, how)
    frames = values.shape[1]
    t, order, timed = np.arange(frames, dtype=np.int64), None, how.time is not None
    if how.time is not None:
        t, order = _times(path, how, arrays[how.time], frames, said)
    if order is not None:
        values = values[:, order]
    full = replace(layout, data=replace(how, array=how.array or None))
    sources = dict(_sources(path, full, values, t, has_axis="axis" in named))
    unread = ", ".join(name for name in stored if name not in wanted)
    lost = (f"other arrays of the file: {unread}",) if unread else ()
    size = " and ".join(
        f"{counted(len(each), 'frame')} of {_size(each.array.shape)} taxels" for each in sources.values()
    )
    line = f"{path.name}: read as {size}: {'; '.join(said)}" if said else ""
    return Opened(sources, timed, full, line, lost=lost)


def look(path: Path, layout: Layout) -> tuple[Data, list[str], dict[str, tuple[int, ...]]]:
    """Return how the arrays of a file are read, what was guessed of it, and their shapes; the frames are not read.

    Raises
    ------
    FormatError : as of `read_array_file`
    """
    stored = shapes(path)
    if not stored:
        struct = "; if the data are in a struct, save its fields: save('FILE.mat', '-struct', 'NAME')"
        raise unreadable(f"contains no numbers{struct * (path.suffix.lower() == '.mat')}", path)
    how = _named(path, layout.data or Data(), stored)
    if how.axes is not None:
        return how, [], stored
    how, said = _axes(path, layout, how, stored, is_said=layout.data is not None or _is_given(path, layout))
    return how, said, stored


def _is_given(path: Path, layout: Layout) -> bool:
    return layout.path != path


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) or "one number"


def _list(stored: Mapping[str, tuple[int, ...]]) -> str:
    """Return the names and shapes of the first arrays, those that could hold frames before the others."""
    first = sorted(stored.items(), key=lambda entry: len(entry[1]) < 2)[:8]
    names = [f"{name or 'an array'} ({_size(shape)})" for name, shape in first]
    return (", ".join(names) or "no numbers") + ", ..." * (len(stored) > 8)


def _named(path: Path, how: Data, stored: Mapping[str, tuple[int, ...]]) -> Data:
    """Return the names of the array of frames and of that of times, which are there."""
    is_npy = path.suffix.lower() == ".npy"
    for key in ("array", "time"):
        name = getattr(how, key)
        if name is None:
            continue
        # A path within a .h5 may begin at its root.
        found = name if name in stored else name.strip("/")
        if is_npy or found not in stored:
            size = as_size(name)
            hint = f"; to state a size, write {size}" if size else ""
            there = "its one array has no name" if is_npy else f"its arrays are {_list(stored)}"
            raise unreadable(f"contains no array {name}, which the layout states as [data] {key}; {there}{hint}", path)
        how = replace(how, **{key: found})
    if how.array is not None or is_npy:
        return how
    several = {name: shape for name, shape in stored.items() if math.prod(shape) > 1 and time_unit(name) is None}
    grids = [name for name, shape in several.items() if len(shape) >= 2 and math.prod(shape) > max(shape)]
    frames = grids or list(several)
    if len(frames) != 1:
        raise unreadable(f"contains {_list(stored)}; {advice(path, 'name the array of frames')}: [data] array", path)
    return replace(how, array=frames[0])


def _axes(
    path: Path, layout: Layout, how: Data, stored: Mapping[str, tuple[int, ...]], *, is_said: bool
) -> tuple[Data, list[str]]:
    """Return what each axis counts, and what was guessed of it.

    Raises
    ------
    FormatError : axes that can be read in two ways, or frames without times that no layout describes (prints layouts)
    """
    shape = stored[how.array or ""]
    if len(shape) not in (1, 2, 3, 4) or 0 in shape:
        raise unreadable(
            f"{how.array or 'the array'} is {_size(shape)}; must be frames x rows x columns, or x taxels", path
        )
    inner = {1: [], 2: ["taxel"], 3: ["row", "column"], 4: ["row", "column", "axis"]}[len(shape)]
    if len(shape) == 3 and shape[-1] == len(AXES) and shape[1] > len(AXES) and layout.axis is not None:
        inner = ["taxel", "axis"]

    def with_time_at(axis: int) -> str:
        names = inner.copy()
        names.insert(axis, "time")
        return " ".join(names)

    if is_said or how.frames == "last":
        return replace(how, axes=with_time_at(len(shape) - 1 if how.frames == "last" else 0)), []
    times = {
        name: math.prod(size)
        for name, size in stored.items()
        if time_unit(name) is not None and max(size, default=0) == math.prod(size)
    }
    named = next((name for name, count in times.items() if shape.count(count) == 1), None)
    longest = int(np.argmax(shape))
    axis = longest if named is None else shape.index(times[named])
    said, choices = [f"axis {axis} ({shape[axis]}) is the time"], list[tuple[str, Layout]]()
    if named is not None:
        values = read_arrays(path, [named])[named].ravel()
        unit, open_units = _unit(named, values)
        how = replace(how, time=named, time_unit=unit)
        said.append(f"time {named!r} in {unit}")
        choices = [(f"times in {each}", replace(layout, data=replace(how, time_unit=each))) for each in open_units]
    how = replace(how, axes=with_time_at(axis))
    if named is None and layout.rate_hz is None:
        at = [longest, 0] if longest else [0]
        choices = [
            (
                f"axis {k} ({shape[k]}) is the time, whose rate the file does not state: rate_hz = 100",
                replace(layout, data=replace(how, axes=with_time_at(k))),
            )
            for k in at
        ]
    full = replace(layout, data=how)
    is_of_axes = len(shape) > 2 and shape[-1] == len(AXES) and axis != len(shape) - 1 and layout.axis is None
    if is_of_axes and (len(shape) == 4 or shape[1] > len(AXES)):
        of_axes = replace(how, axes=(how.axes or "").removesuffix("column") + "axis") if len(shape) == 3 else how
        of_axes = replace(of_axes, axes=(of_axes.axes or "").replace("row axis", "taxel axis"))
        choices = [(f'axis = "{each}"', replace(full, axis=each, data=of_axes)) for each in ("z", "all", "shear")]
    if choices and (len(choices) > 1 or named is None):
        _refuse(path, f"contains {_list(stored)}", choices)
    return how, said


def _unit(name: str, times: NDArray[Any]) -> tuple[str, list[str]]:
    """Return the unit of times: as their name says, by the years since 1970, or that of a usual rate; or two."""
    stated = time_unit(name)
    return (stated, []) if stated else unit_of_times(times.astype(np.float64))


def _refuse(path: Path, holds: str, choices: Sequence[tuple[str, Layout]]) -> NoReturn:
    lines = [f"# {k}. {name}\n{of_layout(layout)}" for k, (name, layout) in enumerate(choices, 1)]
    error = unreadable(f"{holds}; {advice(path, 'write one of these')}:", path)
    error.args = (*error.args, "\n".join(lines).rstrip())
    raise error


def _in_order(path: Path, values: NDArray[Any], named: Sequence[str], how: Data) -> NDArray[np.float32]:
    """Return values of shape (trials, frames, rows, columns, axes)."""
    if values.dtype.kind not in "uifb" or 0 in values.shape:
        raise unreadable(f"{how.array or 'the array'} contains {values.dtype} of shape {_size(values.shape)}", path)
    large = np.argwhere(np.isinf(values))
    if len(large):
        called = ("frame" if name == "time" else name for name in named)
        at = ", ".join(f"{name} {k}" for name, k in zip(called, large[0].tolist(), strict=True))
        raise unreadable(f"{how.array or 'the array'}, {at}: must fit 32 bits, or be NaN if it is missing", path)
    names = ["column" if name == "taxel" else name for name in named]
    order = [name for name in ("trial", "time", "row", "column", "axis") if name in names]
    turned = np.transpose(values, [names.index(name) for name in order])
    sizes = dict(zip(order, turned.shape, strict=True))
    full = [sizes.get(name, 1) for name in ("trial", "time", "row", "column", "axis")]
    return np.ascontiguousarray(turned, np.float32).reshape(full)


def _times(
    path: Path, how: Data, times: NDArray[Any], frames: int, said: list[str]
) -> tuple[NDArray[np.int64], NDArray[np.intp] | None]:
    """Return times in us, and the order of the frames, if it is another."""
    if times.size != frames or times.dtype.kind not in "uif":
        raise unreadable(
            f"{how.time} contains {counted(times.size, 'time')} ({times.dtype}) for {counted(frames, 'frame')}", path
        )
    import pandas as pd  # noqa: PLC0415  takes long

    us = us_of(pd.Series(times.ravel()), how.time_unit)
    if us.dtype.kind == "f":
        raise unreadable(f"{how.time}: a time is missing, or not within 142 years of 0", path)
    found = repaired(us, UNITS_US[how.time_unit])
    if found.wrong > max(2, 0.1 * frames):
        raise unreadable(f"{how.time}: {found.wrong} of {counted(frames, 'time')} are out of order", path)
    said += found.said
    return found.t, found.order


def _sources(path: Path, layout: Layout, values: NDArray[np.float32], t: NDArray[np.int64], *, has_axis: bool) -> Any:
    """Yield the frames of each trial, and of each axis where all are asked for."""
    for k, trial in enumerate(values, 1):
        name = f"trial{k}" if len(values) > 1 else ""
        if not has_axis:
            yield name, _frames(path, layout, trial[..., 0], t)
            continue
        if layout.axis is None or trial.shape[-1] != len(AXES):
            raise FormatError(f'{layout.path}: {path.name} has taxels with {trial.shape[-1]} axes; write axis = "z"')
        for axis, readings in of_axis(layout.axis, {a: trial[..., at] for at, a in enumerate(AXES)}):
            yield f"{name} {axis}".strip() if layout.axis == "all" else name, _frames(path, layout, readings, t)


def _frames(path: Path, layout: Layout, values: NDArray[np.float32], t: NDArray[np.int64]) -> Frames:
    rows, columns = values.shape[1:]
    if layout.rows is not None and layout.columns is not None and rows * columns != layout.rows * layout.columns:
        raise FormatError(
            f"{path}: contains frames of {rows} x {columns} values; {layout.path} states {layout.rows} x "
            f"{layout.columns} taxels"
        )
    try:
        array = layout.array(rows * columns, Array(rows, columns, name=path.stem))
        frames = Frames(
            frozen_whole(np.ascontiguousarray(values).reshape(-1, *array.shape)),
            frozen_whole(t),
            unit=layout.unit or "counts",
            array=array,
        )
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
    limited(path, frames)
    return frames
