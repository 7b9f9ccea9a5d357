"""Writes layout files."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NoReturn

from taxel._base.errors import unreadable
from taxel.array import Places
from taxel.formats.layout import Layout, advice

_RATE_NOT_SAID = "# rate_hz = 100  # frames per second, which the file does not state"


def of_layout(layout: Layout) -> str:
    r"""Return the text of a layout file: the keys that differ from their defaults.

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
        if key.name == "path" or value in (None, "") or value == {}:
            continue
        if is_dataclass(value) or isinstance(value, Mapping):
            tables += ["", f"[{key.name}]", *_lines(value)]
        else:
            own.append(f"{key.name} = {_written(value)}")
    return "\n".join([*own, *tables] if own else tables[1:]) + "\n"


def _lines(values: Any) -> list[str]:
    """Return the lines of a table of TOML."""
    if isinstance(values, Mapping):
        return [f"{key} = {_written(value)}" for key, value in values.items()]
    if isinstance(values, Places):
        columns = {"x": values.x, "y": values.y, "area": values.area}
        lines = [
            f"{key} = {_written(column.ravel().tolist())}" for key, column in columns.items() if column is not None
        ]
        return lines + ([] if values.unit is None else [f"unit = {_written(values.unit)}"])
    stated = ((key.name, getattr(values, key.name), key.default) for key in fields(values))
    return [
        f"{name} = {_written(value)}" for name, value, default in stated if value != default and value not in ([], ())
    ]


def refuse_to_choose(path: Path, why: str, choices: Mapping[str, Layout]) -> NoReturn:
    """Refuse a file that can be read in several ways, with the layout of each and what tells it from the others.

    Raises
    ------
    FormatError : always (the layouts are below its first line)
    """
    lines = list[str]()
    for number, (name, layout) in enumerate(choices.items(), 1):
        times = (getattr(layout.table, "time_column", None), getattr(layout.table, "frame_time", None))
        timed = any(each is not None for each in (*times, layout.rate_hz, getattr(layout.data, "time", None)))
        lines += [f"# {number}. {name}", *([] if timed else [_RATE_NOT_SAID]), of_layout(layout)]
    right = advice(path, f"write {'one of these' if len(choices) > 1 else 'this'}")
    error = unreadable(f"{why}; {right}:", path)
    error.args = (*error.args, "\n".join(lines).rstrip())
    raise error


def _written(value: object) -> str:
    """Return a value as TOML has it: JSON has the same escapes, numbers and lists."""
    return json.dumps(value, ensure_ascii=False)
