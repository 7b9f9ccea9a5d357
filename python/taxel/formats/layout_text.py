"""Writes layout files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel._base.errors import placed
from taxel.formats.layout import Data, Layout, Table, advice
from taxel.formats.roles import Changes, OpenRolesError, Question, Role, lines_of

_RATE_NOT_SAID = "# rate_hz = 100  # frames per second, which the file does not state"


def of_layout(layout: Layout) -> str:
    r"""Return the text of a layout file: the keys that differ from their defaults, or that it states.

    Examples
    --------
    >>> from taxel.formats.layout import Table
    >>> print(of_layout(Layout(Path("a.layout.toml"), unit="N", table=Table(separator=";", time_column=1))), end="")
    unit = "N"
    <BLANKLINE>
    [table]
    separator = ";"
    time_column = 1
    """
    own, tables = list[str](), list[str]()
    for key in fields(layout):
        value = getattr(layout, key.name)
        if key.name in ("path", "stated") or value in (None, ""):
            continue
        if is_dataclass(value):
            tables += ["", f"[{key.name}]", *_lines(value, layout.stated)]
        else:
            own.append(f"{key.name} = {_written(value)}")
    return "\n".join([*own, *tables] if own else tables[1:]) + "\n"


def _lines(values: Any, is_stated: frozenset[str]) -> list[str]:
    """Return the lines of a table of TOML."""
    every = ((key.name, _plain(getattr(values, key.name)), key.default) for key in fields(values))
    return [
        f"{name} = {_written(value)}"
        for name, value, default in every
        if value is not None and (name in is_stated or (value != default and value not in ([], ())))
    ]


def refuse_open(path: Path, about: str, layout: Layout, roles: Sequence[Role], questions: Sequence[Question]) -> None:
    """Refuse a file of which something is open: with the table of its roles, and the layout by each first answer.

    Each layout leaves out the keys of the questions that are still open then.

    Raises
    ------
    OpenRolesError : there is a question (the table and the layouts are below its first line)
    """
    if not questions:
        return
    (why, keys, choices), *others = ((each.why, each.keys, each.choices) for each in questions)
    also = "".join(f"; also open: {other}" for other, _, _ in others)
    ways = f"{about} {len(choices)} ways ({why})" if len(choices) > 1 else why
    later = frozenset[str]().union(*(keys for _, keys, _ in others)) - keys
    lines = [f"# {line}" for line in lines_of(roles)]
    for number, (name, changes) in enumerate(choices.items(), 1):
        full = without(changed(layout, changes), later)
        times = (getattr(full.table, "time_column", None), getattr(full.table, "frame_time", None))
        found = any(role.role == "time" for role in roles) and full.data is not None
        timed = found or any((*times, full.rate_hz, getattr(full.data, "time", None)))
        lines += [f"# {number}. {name}", *([] if timed else [_RATE_NOT_SAID]), of_layout(full)]
    right = advice(path, f"write {'one of these' if len(choices) > 1 else 'this'}")
    error = placed(OpenRolesError(f"{ways}{also}; {right}:", "\n".join(lines).rstrip()), path)
    error.layout, error.roles, error.questions = layout, roles, questions
    raise error


def changed(layout: Layout, changes: Changes) -> Layout:
    """Return a layout with other keys, of its own, its table or its data, which it states, except those of nothing."""
    layout = without(layout, frozenset(key for key, value in changes.items() if value is None))
    changes = {key: value for key, value in changes.items() if value is not None}
    said = {key for key, value in changes.items() if value != []} - {"left", "read"}
    if layout.table is not None and {"left", "read"} & changes.keys():
        left = [column for column in layout.table.leave_out if column not in changes.get("read", ())]
        more = (column for column in changes.get("left", ()) if column not in left)
        changes, said = {**changes, "leave_out": [*left, *more]}, said | {"leave_out"}
    return _with(layout, changes, layout.stated | said)


def without(layout: Layout, keys: frozenset[str]) -> Layout:
    """Return a layout that does not state some keys."""
    defaults = {key.name: key.default for kind in (Table, Data, Layout) for key in fields(kind) if key.name in keys}
    return _with(layout, defaults, layout.stated - keys)


def _with(layout: Layout, values: Mapping[str, Any], stated: frozenset[str]) -> Layout:
    """Return a layout with other values of its keys and of those of its table and its data."""
    inner: dict[str, Any] = {}
    for name in ("table", "data"):
        if (there := getattr(layout, name)) is not None:
            keys = {key.name for key in fields(there)} & values.keys()
            inner[name] = replace(there, **{key: values[key] for key in keys})
    own = {key.name for key in fields(Layout)} & values.keys() - {"columns"}
    return replace(layout, **{key: values[key] for key in own}, **inner, stated=stated)


def _plain(value: object) -> object:
    """Return a value as it is, but numbers of an array as a list."""
    return value.ravel().tolist() if isinstance(value, np.ndarray) else value


def _written(value: object) -> str:
    """Return a value as TOML has it: JSON has the same escapes, numbers and lists."""
    return json.dumps(value, ensure_ascii=False)
