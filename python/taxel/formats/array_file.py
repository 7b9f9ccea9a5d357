"""Arrays of other programs by name (.npy, .npz, HDF5, MATLAB), read as a layout says, or as their axes look."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from taxel._base.arrays import read_arrays, shapes
from taxel._base.errors import unreadable
from taxel._base.messages import counted, warn
from taxel.formats.column_names import AXES, time_unit
from taxel.formats.layout import Data, Layout, advice
from taxel.formats.opened import readers_of, sources_of
from taxel.formats.roles import LIKELY, OF_AXES, OPEN, SURE, Changes, Question, Role, named, of_unit, refuse_open
from taxel.formats.times import in_order, unit_of_times
from taxel.reading import InMemory

#: The path of a numbered group within others: data/demo_0/ of data/demo_0/obs/tactile.
_NUMBERED = re.compile(r"(?:[^/]*[^/\d]/)*[^/]*\d+/")
#: Numbered groups of these names are parts of a body, at one time.
_PARTS = re.compile(r"sensor|taxel|finger|hand|foot|skin|patch|pad|device|board|channel|node|module", re.IGNORECASE)


def read_array_file(path: Path, layout: Layout) -> list[InMemory]:
    """Return a reader of the frames of a file of arrays, of each trial and each axis.

    Trials are along an axis, or are the groups of a HDF5 file, as robots' episodes are: data/demo_0/obs/tactile.

    Raises
    ------
    FormatError : no such array, several that may hold the frames, or axes that can be read in two ways (prints both)
    """
    groups = _groups(shapes(path), layout)
    if len(groups) > 1:
        warn(f"{path.name}: its groups are trials: {named([*groups])}", stacklevel=6)
    return [each for name, group in groups.items() for each in _read_group(path, layout, group, name)]


def _read_group(path: Path, layout: Layout, group: Group, trial: str) -> list[InMemory]:
    """Return the readers of the arrays of a file, or of the group of a trial."""
    how, said, roles = look_at(path, layout, group)
    shape = group.shapes[how.array or ""]
    named = (how.axes or "").split()
    if len(named) != len(shape):
        raise unreadable(
            f"{how.array or 'the array'} has {counted(len(shape), 'axis', 'axes')} ({_size(shape)}); the layout names "
            f"{len(named)}: axes = {how.axes!r}",
            path,
        )
    values = _in_order(path, group.read(path, how.array or "", np.float32), named, how)
    frames = values.shape[1]
    t = np.arange(frames, dtype=np.int64)
    if how.time is not None:
        import pandas as pd  # noqa: PLC0415  takes long

        times = group.read(path, how.time) if isinstance(how.time, str) else _of_column(path, group, named, how)
        if times.size != frames or times.dtype.kind not in "uif":
            stated = f"{counted(times.size, 'time')} ({times.dtype}) for {counted(frames, 'frame')}"
            raise unreadable(f"{how.time} contains {stated}", path)
        name = how.time if isinstance(how.time, str) else f"taxel {how.time}"
        t, order = in_order(path, pd.Series(times.ravel()), how.time_unit, said, name)
        values = values if order is None else values[:, order]
        values = values if isinstance(how.time, str) else np.delete(values, how.time - 1, axis=3)
    full = replace(layout, data=replace(how, array=how.array or None))
    values = values if values.shape[-1] > 1 else values[..., 0]
    unread = ", ".join(name for name in group.shapes if name not in (how.array or "", how.time))
    lost = (f"other arrays of the file: {unread}",) if unread else ()
    readers = list[InMemory]()
    for k, of_trial in enumerate(values, 1):
        sources = dict(sources_of(path, full, "", of_trial, t))
        # What was understood is said once.
        new = () if readers or group.number else said
        found = readers_of(path, "arrays", sources, full, new, timed=how.time is not None, lost=lost, roles=roles)
        name = " ".join(filter(None, (trial, f"trial{k}" * (len(values) > 1))))
        readers += [replace(each, facts=replace(each.facts, name=name or each.facts.name)) for each in found]
    return readers


@dataclass(frozen=True)
class Group:
    """Hold the shapes of the arrays of a file, or of those of a trial, by their names below a path."""

    shapes: Mapping[str, tuple[int, ...]]
    path: str = ""
    number: int = 0

    def read(self, path: Path, name: str, dtype: DTypeLike | None = None) -> NDArray[Any]:
        """Return one of the arrays."""
        whole = self.path + name
        return read_arrays(path, [whole], None if dtype is None else {whole: dtype})[whole]


def _groups(stored: Mapping[str, tuple[int, ...]], layout: Layout) -> dict[str, Group]:
    """Return the groups of arrays that are trials, by their names, if numbered groups hold arrays of like names."""
    found: dict[str, dict[str, tuple[int, ...]]] = {}
    for name, shape in stored.items():
        if numbered := _NUMBERED.match(name):
            found.setdefault(numbered[0], {})[name[numbered.end() :]] = shape
    stems = {re.sub(r"\d+/$", "", group) for group in found}
    common = set[str]().union(*found.values()).intersection(*found.values())
    is_stated = layout.data is not None and layout.data.array is not None and layout.data.array.strip("/") in stored
    if len(found) < 2 or len(stems) > 1 or not common or is_stated or any(map(_PARTS.search, stems)):
        return {"": Group(stored)}
    order = sorted(found, key=lambda group: int(re.findall(r"\d+", group)[-1]))
    return {
        group.strip("/").rpartition("/")[2]: Group(
            {name: found[group][name] for name in found[group] if name in common}, group, k
        )
        for k, group in enumerate(order)
    }


def _of_column(path: Path, group: Group, named: Sequence[str], how: Data) -> NDArray[Any]:
    """Return the times that are a taxel of the array, as it is stored: frames have 32 bits."""
    stored, number = group.read(path, how.array or ""), int(how.time or 0)
    if sorted(named) != ["taxel", "time"] or number > stored.shape[named.index("taxel")]:
        raise unreadable(f"[data] time is {number}, but the array has no such taxel", path)
    times: NDArray[Any] = np.take(stored, number - 1, axis=named.index("taxel"))
    return times


def look(path: Path, layout: Layout) -> None:
    """Refuse a file of arrays that cannot be read; the frames are not read.

    Raises
    ------
    FormatError : as of `read_array_file`
    """
    look_at(path, layout, next(iter(_groups(shapes(path), layout).values())))


def look_at(path: Path, layout: Layout, group: Group) -> tuple[Data, list[str], list[Role]]:
    """Return how the arrays of a file or of a trial are read, what was guessed of it, and what each is.

    Raises
    ------
    FormatError : as of `read_array_file`
    """
    stored = group.shapes
    if not stored:
        struct = "; if the data are in a struct, save its fields: save('FILE.mat', '-struct', 'NAME')"
        raise unreadable(
            f"contains no numbers; must hold an array of numbers{struct * (path.suffix.lower() == '.mat')}", path
        )
    how = _named(path, layout, stored)
    full, said, roles, questions = _axes(path, layout, how, group)
    questions = [question for question in questions if not question.keys & layout.stated]
    refuse_open(path, f"contains {_list(stored)}, which can be read in", full, roles, questions)
    assert full.data is not None  # it is that of the axes
    return full.data, said, roles


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape)) or "one number"


def _list(stored: Mapping[str, tuple[int, ...]]) -> str:
    """Return the names and shapes of the first arrays, those that could hold frames before the others."""
    first = sorted(stored.items(), key=lambda entry: len(entry[1]) < 2)[:8]
    names = [f"{name or 'an array'} ({_size(shape)})" for name, shape in first]
    return (", ".join(names) or "no numbers") + ", ..." * (len(stored) > 8)


def _named(path: Path, layout: Layout, stored: Mapping[str, tuple[int, ...]]) -> Data:
    """Return the names of the array of frames and of that of times, which are there; ask which it is of several."""
    how, is_npy = layout.data or Data(), path.suffix.lower() == ".npy"
    for key in ("array", "time"):
        name = getattr(how, key)
        if not isinstance(name, str):
            continue
        # A path within a .h5 may begin at its root.
        found = name if name in stored else name.strip("/")
        if is_npy or found not in stored:
            there = "its one array has no name" if is_npy else f"its arrays are {_list(stored)}"
            raise unreadable(f"contains no array {name}, which the layout states as [data] {key}; {there}", path)
        how = replace(how, **{key: found})
    if how.array is not None or is_npy:
        return how
    several = {name: shape for name, shape in stored.items() if math.prod(shape) > 1 and time_unit(name) is None}
    grids = [name for name, shape in several.items() if len(shape) >= 2 and math.prod(shape) > max(shape)]
    frames = grids or list(several)
    if not frames:
        raise unreadable(f"contains {_list(stored)}; {advice(path, 'name the array of frames')}: [data] array", path)
    if len(frames) > 1:
        is_time = {name: "no taxel" if time_unit(name) is None else "time" for name in stored}
        roles = [
            Role(name, [_size(shape)], is_time[name], "named so" * (is_time[name] == "time"))
            if name not in frames
            else Role(name, [_size(shape)], certainty=OPEN)
            for name, shape in stored.items()
        ]
        choices: dict[str, Changes] = {name: {"array": name} for name in frames}
        question = Question("which array holds the frames", frozenset({"array"}), choices)
        full = replace(layout, data=replace(how, array=frames[0]))
        refuse_open(path, f"contains {_list(stored)}, which can be read in", full, roles, [question])
    return replace(how, array=frames[0])


def _axes(path: Path, layout: Layout, how: Data, group: Group) -> tuple[Layout, list[str], list[Role], list[Question]]:
    """Return the layout with what each axis counts, what was guessed of it, what each array is, and what is open.

    Raises
    ------
    FormatError : an array that holds no frames
    """
    stored = group.shapes
    shape, called = stored[how.array or ""], how.array or "the array"
    if 0 in shape:
        raise unreadable(f"{called} is empty ({_size(shape)})", path)
    if len(shape) not in (1, 2, 3, 4):
        raise unreadable(f"{called} is {_size(shape)}; must be frames x rows x columns, or x taxels", path)
    stated = (how.axes or "").split()
    inner = {1: [], 2: ["taxel"], 3: ["row", "column"], 4: ["row", "column", "axis"]}[len(shape)]
    by_shape = len(shape) > 2 and shape[-1] == len(AXES) and (len(shape) == 4 or shape[1] > len(AXES))
    inner = ["taxel", "axis"] if by_shape and len(shape) == 3 else inner

    def with_time_at(axis: int) -> str:
        return " ".join([*inner[:axis], "time", *inner[axis:]])

    # Times are an array of their name, of as many as one axis counts.
    counts = {name: math.prod(size) for name, size in stored.items() if time_unit(name) is not None}
    fits = [name for name, count in counts.items() if shape.count(count) == 1]
    if stated:
        fits = [name for name, count in counts.items() if shape[stated.index("time")] == count]
    time = how.time if how.time is not None else next(iter(fits), None)
    said, questions = list[str](), list[Question]()
    if stated:
        axis = stated.index("time")
    else:
        axis = shape.index(counts[time]) if time in fits else int(np.argmax(shape))
        said.append(f"axis {axis} ({shape[axis]}) is the time")
    if isinstance(time, str) and how.time is None:
        how = _timed(layout, how, time, group.read(path, time), questions)
        said.append(f"time {time!r} in {how.time_unit}")
    likely: dict[str, Changes] = {f"axis {axis} ({shape[axis]}) is the time": {"axes": with_time_at(axis)}}
    if time is None:
        likely |= {f"axis 0 ({shape[0]}) is the time": {"axes": with_time_at(0)}} if axis else {}
        likely = (
            {**_with_time_in_it(group.read(path, how.array or "")), **likely}
            if axis == 0 and len(shape) == 2
            else likely
        )
    others = [name for name, size in stored.items() if size == shape[:1] and name not in (how.array, time)]
    if len(shape) > 2 and axis == 1 and others:
        trials = "trial time taxel" if len(shape) == 3 else "trial time row column"
        likely = {f"axis 0 ({shape[0]}) counts trials, as {others[0]} does": {"axes": trials}, **likely}
    if not stated and (len(likely) > 1 or (time is None and not layout.rate_hz)):
        questions.insert(0, Question("which axis is the time", frozenset({"axes"}), likely))
    named = stated or with_time_at(axis).split()
    if "axis" in named and shape[named.index("axis")] == len(AXES) and layout.axis is None:
        columns: Changes = {"axes": " ".join(named).replace("taxel", "row").replace("axis", "column")}
        more = {"three columns of taxels": columns} if len(shape) == 3 and not stated else {}
        questions.append(replace(OF_AXES, choices={**OF_AXES.choices, **more}))
    how = replace(how, axes=" ".join(named))
    certainty = OPEN if questions else SURE if stated else LIKELY
    roles = [
        Role(f"{called} axis {k}", [str(size)], name, "", certainty, axis=str(k))
        for k, (name, size) in enumerate(zip(named, shape, strict=False))
    ]
    roles += [
        Role(name, [], "time" if name == time else "no taxel", "named so" * (name == time))
        for name in stored
        if name != (how.array or "")
    ]
    return replace(layout, data=how), said, roles, questions


def _timed(layout: Layout, how: Data, time: str, stored: NDArray[Any], questions: list[Question]) -> Data:
    """Return the same with an array of times and their unit; ask for it if it is open."""
    times = stored.ravel().astype(np.float64)
    unit, possible = time_unit(time) or "", dict[str, float]()
    if not unit and "time_unit" not in layout.stated:
        unit, possible = unit_of_times(times)
    if possible:
        questions.append(of_unit(possible))
    return replace(how, time=time, time_unit=how.time_unit if "time_unit" in layout.stated else unit)


def _with_time_in_it(values: NDArray[Any]) -> dict[str, Changes]:
    """Return the layout of an array whose first taxel ascends in like steps, as the time does; none of others."""
    if values.shape[1] < 2:
        return {}
    column = values[:, 0]
    steps = np.diff(column.astype(np.float64)) if column.dtype.kind in "uif" else np.empty(0)
    if len(steps) < len(AXES) or not (steps > 0).all() or steps.max() > 2 * steps.min():
        return {}
    unit, several = unit_of_times(column.astype(np.float64))
    return {
        f"taxel 1 is the time, in {each}": {"axes": "time taxel", "time": 1, "time_unit": each}
        for each in [*several] or [unit]
    }


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
