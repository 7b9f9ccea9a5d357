"""Data sets of LeRobot, versions 2.0 to 3.0: a folder whose ``meta/info.json`` says where its tables of Parquet are.

Each episode is a recording, by the times of its column ``timestamp``; features whose names say touch are its sources
(https://huggingface.co/docs/lerobot/lerobot-dataset-v3).
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import Frames
from taxel.formats.column_names import AXES, axes_of
from taxel.formats.layout import Data, Layout
from taxel.formats.opened import readers_of, sources_of
from taxel.formats.roles import FIRST, LIKELY, OF_AXES, OPEN, SURE, Changes, Question, Role, refuse_open
from taxel.formats.times import in_order
from taxel.labels import Note, source_of
from taxel.reading import InMemory, damaged, read_parquet, refused, unreadable, values_in, warn
from taxel.recording.kinds import Kind

_TOUCH = re.compile(r"tactile|touch|taxel|pressure|force", re.IGNORECASE)
#: Columns of every data set that are no features of a robot, and kinds of features that hold no numbers.
_OWN = ("timestamp", "frame_index", "index", "episode_index", "task_index")
_NO_NUMBERS = ("image", "video", "string")
#: The label that is the task of an episode.
TASK = "task"


def knows(path: Path) -> bool:
    """Return whether a folder is a data set."""
    return (path / "meta" / "info.json").is_file()


def read(path: Path, layout: Layout | None = None) -> list[InMemory]:
    """Return a reader of each touch feature of each episode, or of the feature that `[data] array` of a layout names.

    Where the label_column of the layout is a feature, such as ``next.success``, its changes are labels, of a feature of
    true and false those to true; where it is "task", the task is one, at the first frame.

    Raises
    ------
    FormatError : damaged, or what is read is open (prints the layouts)
    ProblemError : no such feature
    ImportError : the extra ``tables`` is not installed
    """
    info = _info(path)
    features = {name: each for name, each in info["features"].items() if name not in _OWN}
    numbers = {name: each for name, each in features.items() if each["dtype"] not in _NO_NUMBERS}
    full = layout or Layout(path)
    full = replace(full, data=replace(full.data or Data(), time="timestamp"))
    assert full.data is not None  # it was replaced
    label = None if full.table is None else full.table.label_column
    if label is not None and label not in (*features, TASK):
        raise refused("label_column", f" is {label!r}: must be {TASK}, or a feature: {', '.join(features)}")
    touch = [name for name in numbers if _TOUCH.search(name) and name != label]
    chosen = touch if full.data.array is None else [name for name in numbers if name == full.data.array]
    columns = {"timestamp", "episode_index", *chosen, "task_index" if label == TASK else label or "timestamp"}
    tables = _tables(path, info, sorted(columns))
    first = next(tables)
    _ask(path, full, features, numbers, chosen, roles := _roles(features, first, chosen, label))
    left = ", ".join(name for name in features if name not in (*chosen, label))
    lost = [f"features that are not touch: {left}"] * bool(left)
    tasks = _tasks(path) if label == TASK else {}
    readers, said = list[InMemory](), list[str]()
    for number, part in [each for table in (first, *tables) for each in table.groupby("episode_index", sort=False)]:
        name = f"episode_{number:06d}"
        t, order = in_order(path, part["timestamp"], "s", said, f"timestamp of {name}")
        rows = part if order is None else part.iloc[order]
        cells = [] if label is None else rows["task_index"].map(tasks) if label == TASK else rows[label]
        sources: dict[str, Frames] = {}
        for feature in chosen:
            try:
                sensors, names = _values(rows[feature], numbers[feature])
            except (ValueError, TypeError) as error:
                stated = f"shape {numbers[feature]['shape']} in meta/info.json"
                raise unreadable(f"{feature} of {name} is not of {stated}: {error}", path) from None
            called = source_of(feature.removeprefix("observation."))
            for k, values in enumerate(sensors):
                sources.update(
                    sources_of(path, full, f"{called}_{k}" if len(sensors) > 1 else called, values, t, names)
                )
        notes = dict.fromkeys(sources, _notes(str(label), list(cells), t))
        for each in readers_of(path, "lerobot", sources, full, (), timed=True, lost=lost, notes=notes, roles=roles):
            readers.append(replace(each, facts=replace(each.facts, name=name, episode=int(number))))
    for text in dict.fromkeys(said):
        warn(f"{path.name}: {text}", stacklevel=6)
    return readers


def _info(path: Path) -> dict[str, Any]:
    """Return what ``meta/info.json`` says; refuse one without the features and the place of the data."""
    file = path / "meta" / "info.json"
    try:
        info: dict[str, Any] = json.loads(file.read_text("utf-8"))
        place = Path(info["data_path"])
        sound = all({"dtype", "shape"} <= each.keys() for each in info["features"].values())
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise damaged(file, "description of a data set", f"it lacks {error}") from None
    if not sound or place.is_absolute() or ".." in place.parts:
        raise unreadable("must state data_path within the folder, and dtype and shape of each feature", file)
    return info


def _tables(path: Path, info: Mapping[str, Any], columns: Sequence[str]) -> Iterator[Any]:
    """Yield the DataFrame of each file of the data: of many episodes from version 3.0 on, of one before."""
    places: list[dict[str, int]]
    if "file_index" in info["data_path"]:
        of_episodes = [read_parquet(file) for file in sorted(path.glob("meta/episodes/*/*.parquet"))]
        keys = ("chunk_index", "file_index")
        rows = [row for table in of_episodes for row in zip(*(table[f"data/{key}"] for key in keys), strict=True)]
        places = [dict(zip(keys, row, strict=True)) for row in dict.fromkeys(rows)]
    else:
        size = info.get("chunks_size", 1000)
        places = [{"episode_chunk": k // size, "episode_index": k} for k in range(info.get("total_episodes", 0))]
    if not places:
        raise unreadable("contains no episode", path)
    for place in places:
        yield read_parquet(path / info["data_path"].format(**place), columns)


def _tasks(path: Path) -> dict[int, str]:
    """Return the texts of the tasks: in a table from version 3.0 on, in lines of JSON before."""
    file = path / "meta" / "tasks.parquet"
    if file.is_file():
        table = read_parquet(file).reset_index()
        return dict(zip(table["task_index"], table.drop(columns="task_index").iloc[:, 0], strict=True))
    lines = file.with_suffix(".jsonl").read_text("utf-8").splitlines()
    return {row["task_index"]: row["task"] for row in map(json.loads, filter(str.strip, lines))}


def _roles(features: Mapping[str, Any], table: Any, chosen: Sequence[str], label: str | int | None) -> list[Role]:
    """Return what the time and each feature is."""
    roles = [Role("timestamp", [f"{value:g}" for value in table["timestamp"].iloc[:FIRST]], "time")]
    for name, each in features.items():
        role = "label" if name == label else "taxel" if name in chosen else "no taxel"
        why = {"taxel": "named so", "label": "stated"}.get(role, f"{each['dtype']}, not named as touch")
        is_sure = role == "label" or each["dtype"] in _NO_NUMBERS
        size = " x ".join(map(str, each["shape"]))
        roles.append(Role(name, [size], role, why, SURE if is_sure else LIKELY, source=name * (role == "taxel")))
    return roles


def _ask(
    path: Path,
    layout: Layout,
    features: Mapping[str, Any],
    numbers: Mapping[str, Any],
    chosen: Sequence[str],
    roles: Sequence[Role],
) -> None:
    """Refuse a data set of which no feature is named as touch, or whose taxels have axes, with the layouts."""
    choices: dict[str, Changes]
    questions = list[Question]()
    if not chosen:
        choices = {f"the feature {name}": {"array": name} for name in numbers}
        questions.append(Question("which feature is touch", frozenset({"array"}), choices))
    if layout.axis is None and any(_axes(features[name]) is not None for name in chosen):
        questions.append(OF_AXES)
    for role in roles:
        role.certainty = OPEN if questions and role.name in (chosen or numbers) else role.certainty
    refuse_open(path, "can be read in", layout, roles, questions)


def _names(feature: Mapping[str, Any]) -> list[str]:
    """Return the names of the numbers of a feature; in old versions they are below a word; none if there are none."""
    names = feature.get("names")
    names = next(iter(names.values()), None) if isinstance(names, dict) else names
    return list(map(str, names)) if isinstance(names, list) and len(names) == feature["shape"][-1] else []


def _axes(feature: Mapping[str, Any]) -> list[list[int]] | None:
    """Return the places of x, y and z of each taxel of the last or the last two dimensions; None without axes."""
    shape = feature["shape"]
    if len(shape) == 1:
        by_name = axes_of(_names(feature))
        return None if by_name is None else [[taxel[axis] for axis in AXES] for taxel in by_name.values()]
    is_last = shape[-1] == len(AXES) and (len(shape) == 3 or shape[0] > len(AXES))
    return np.arange(shape[-2] * len(AXES)).reshape(-1, len(AXES)).tolist() if is_last else None


def _values(cells: Any, feature: Mapping[str, Any]) -> tuple[NDArray[np.float32], list[str] | None]:
    """Return values of shape (sensors, frames, rows, columns), or with axes behind, and the names of taxels of a row.

    Three dimensions without axes are several sensors of rows and columns.

    Raises
    ------
    ValueError, TypeError : cells of another shape than the feature's
    """
    shape, names, axes = feature["shape"], _names(feature), _axes(feature)
    values = np.stack([values_in(cell) for cell in cells]).astype(np.float32)
    if values.ndim > len(shape) and list(values.shape[1:]) != shape:
        raise ValueError(f"shape {list(values.shape[1:])}")
    values = values.reshape(len(cells), *shape)
    if axes is not None:
        values = values.reshape(len(cells), *shape[:-2], -1)[..., axes]
        stems = [name.rstrip("xyzXYZ_. ") for name in names[:: len(AXES)]] if len(shape) == 1 else None
        return values.reshape(1, len(cells), -1, *values.shape[-2:]), stems
    sensors = values.reshape(len(cells), *[1] * (3 - len(shape)), *shape).swapaxes(0, 1)
    return sensors, names if len(shape) == 1 and names else None


def _notes(name: str, cells: Sequence[Any], t: NDArray[np.int64]) -> list[Note]:
    """Return the text of a label where it begins, or the name of its feature, with the number of one of numbers."""
    notes = list[Note]()
    for k, cell in enumerate(cells):
        if k and cell == cells[k - 1]:
            continue
        is_flag = isinstance(cell, bool | np.bool_)
        if isinstance(cell, str) or (k and (cell or not is_flag)):
            notes.append(Note(cell if isinstance(cell, str) else name if is_flag else f"{name} {cell:g}", int(t[k])))
    return notes


LEROBOT = Kind(knows, read, has_labels=True)
