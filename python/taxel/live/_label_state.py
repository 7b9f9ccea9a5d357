"""The file beside a table of labels that holds what taxel acknowledged of it: its place, and how it is read."""

from __future__ import annotations

import csv
import json
import os
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from taxel._core import FormatError, open_regular
from taxel.labels import Note
from taxel.live._label_join import Acknowledged

#: The size of the file of what was acknowledged, bytes.
MOST_SAVED = 1 << 26

#: Errors of reading a file that taxel did not save.
NOT_SAVED = (ValueError, TypeError, KeyError, IndexError, RecursionError)


#: A descriptor has one position, at which several threads may read.
_reading = threading.Lock()


def bytes_of(descriptor: int) -> bytes:
    with _reading, open(descriptor, "rb", closefd=False) as file:
        file.seek(0)
        return file.read()


def state_path(path: Path) -> Path:
    return path.with_name(f".{path.name}.acknowledged")


def to_json(known: Acknowledged) -> dict[str, Any]:
    def rows(notes: Sequence[Note] | None) -> list[Any] | None:
        if notes is None:
            return None
        return [
            [n.text, n.t, n.source, n.recording, n.replaces, n.at_ns, [list(column) for column in n.others]]
            for n in notes
        ]

    return {"labels": rows(known.labels), "deleted": rows(known.deleted), "table": rows(known.table)}


def integer(value: object, least: int, most: int) -> int:
    if type(value) is not int or not least <= value <= most:
        raise ValueError("a time is invalid")
    return value


def _time(t: object) -> int:
    return integer(t, -(2**52), 2**52)


def _text(text: object) -> str:
    if not isinstance(text, str) or len(text) > csv.field_size_limit():
        raise ValueError("a text is invalid")
    # Half of a pair of UTF-16 is no character.
    text.encode()
    return text


def from_json(saved: dict[str, Any]) -> Acknowledged:
    def rows(name: str) -> tuple[Note, ...]:
        return tuple(
            Note(
                _text(text),
                _time(t),
                integer(at_ns, 0, 2**63 - 1),
                _text(recording),
                _text(source),
                None if replaces is None else _time(replaces),
                tuple((_text(name), _text(cell)) for name, cell in others),
            )
            for text, t, source, recording, replaces, at_ns, others in saved[name] or ()
        )

    return Acknowledged(rows("labels"), rows("deleted"), None if saved["table"] is None else rows("table"))


def not_saved(path: Path, error: Exception) -> FormatError:
    reason = f"damaged, so taxel does not know which labels it had confirmed ({error})"
    return FormatError(f"{state_path(path)}: {reason}; delete this file to continue without them")


def newest_of(path: Path, link: Path | None) -> Path:
    """Return the table by whose name the newest state is saved: the file itself, or a link to it."""
    times = []
    for name in (path, link):
        try:
            times.append(-1 if name is None else os.stat(state_path(name)).st_mtime_ns)
        except FileNotFoundError:
            times.append(-1)
    # A state that is saved by the link's name is saved beside the file just before.
    return link if link is not None and times[1] > times[0] else path


def saved_of(path: Path) -> dict[str, Any] | None:
    """Return what was saved beside a table; None if nothing was."""
    try:
        descriptor = open_regular(state_path(path))
    except FileNotFoundError:
        return None
    try:
        if os.fstat(descriptor).st_size > MOST_SAVED:
            raise ValueError(f"more than {MOST_SAVED} bytes")
        saved = json.loads(bytes_of(descriptor))
        if not isinstance(saved, dict):
            raise TypeError("no object")
    except NOT_SAVED as error:
        raise not_saved(path, error) from None
    finally:
        os.close(descriptor)
    return saved
