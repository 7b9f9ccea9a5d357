"""Writes layout files, and keys into one that a person may have written."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NoReturn

from taxel._base.errors import unreadable
from taxel._core import ProblemError
from taxel.array import Places
from taxel.formats.layout import Layout, advice

__all__ = ["of_layout", "refuse_to_choose", "with_keys"]

_RATE_NOT_SAID = "# rate_hz = 100  # frames per second, which the file does not state"

#: The line that begins a table of TOML.
_TABLE = re.compile(r"^[ \t]*\[", re.MULTILINE)


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


def with_keys(path: Path, text: str, keys: Mapping[str, Any]) -> str:
    """Return the text of a layout file with other values of some keys; all else stays, comments too.

    Parameters
    ----------
    path : Path
        The file, for errors.
    text : str
    keys : mapping of str to value
        Values by the names of the keys; a key in a table is, for example, "ros.topic".

    Raises
    ------
    FormatError : the text is not a layout, before or with these keys
    ProblemError : it is written so that only a person can change it

    Examples
    --------
    >>> print(with_keys(Path("a.toml"), "unit = 'N'  # newton", {"falls": True, "ros.topic": "/palm"}), end="")
    falls = true
    unit = 'N'  # newton
    <BLANKLINE>
    [ros]
    topic = "/palm"
    """
    Layout.of_text(path, text)
    wanted, made = tomllib.loads(text), text
    for name, value in keys.items():
        table, _, key = name.rpartition(".")
        (wanted.setdefault(table, {}) if table else wanted)[key] = value
        made = _set(made, table, f"{key} = {_written(value)}", key)
    Layout.of_text(path, made)
    if tomllib.loads(made) != wanted:
        raise ProblemError(
            f"{path}: taxel cannot edit this layout file; write {', '.join(keys)} in it with a text editor"
        )
    return made


def _set(text: str, table: str, line: str, key: str) -> str:
    """Return a text of TOML with a line in place of that of the same key in a table, or before the table's others."""
    begin = 0
    if table:
        head = re.search(rf"^[ \t]*\[[ \t]*{re.escape(table)}[ \t]*\].*(\n|\Z)", text, re.MULTILINE)
        if head is None:
            return f"{text.rstrip()}\n\n[{table}]\n{line}\n".lstrip("\n")
        begin = head.end()
    following = _TABLE.search(text, begin)
    end = len(text) if following is None else following.start()
    inside, count = re.subn(rf"^[ \t]*{re.escape(key)}[ \t]*=.*$", lambda _: line, text[begin:end], flags=re.MULTILINE)
    before = text[:begin] if begin == 0 or text[:begin].endswith("\n") else f"{text[:begin]}\n"
    return before + (inside if count else f"{line}\n{inside}") + text[end:]


def _written(value: object) -> str:
    """Return a value as TOML has it: JSON has the same escapes, numbers and lists."""
    return json.dumps(value, ensure_ascii=False)
