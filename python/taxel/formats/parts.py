"""The tables in one file: sheets of a workbook that have the same columns, and lines that name their sensor."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from taxel._base.errors import unreadable
from taxel._base.table_text import Text
from taxel.formats.layout import Table
from taxel.formats.lines import has_marks, read_line

#: So many lines say whether they name their sensor; each sensor has at least this share of them.
_LINES, _SHARE = 200, 0.2
#: So many different texts are names of sensors, not remarks.
KEYS = 16


def parts_of(text: Text, how: Table | None) -> tuple[dict[str, Text], list[str]]:
    """Return the text of each table of a file by its name, "" for the only one, and the names of other sheets.

    Raises
    ------
    FormatError : a sheet that is stated is not there
    """
    if sheets := text.sheets:
        largest = max(sheets, key=lambda name: int(sheets[name].notna().to_numpy().sum()))
        stated = None if how is None else how.sheet
        if stated is not None and stated not in sheets:
            raise unreadable(f"contains no sheet {stated}; its sheets are {', '.join(sheets)}", text.path)
        head = sheets[largest].iloc[:1].to_csv()
        same = [name for name in sheets if sheets[name].iloc[:1].to_csv() == head and len(sheets[name]) > 1]
        chosen = [stated] if stated is not None else same or [largest]
        parts = {name if len(chosen) > 1 else "": text.of_sheet(name) for name in chosen}
        return parts, [name for name in sheets if name not in chosen and len(sheets[name])]
    names = sensors_in(text.head) if text.is_file else {}
    of_one = {name: text.of_lines(lambda line, name=name: sensor_of(line, names) == name) for name in names}  # type: ignore[misc]
    return of_one or {"": text}, []


def sensors_in(first: Sequence[str]) -> dict[str, frozenset[str]]:
    """Return the sensors that the first lines name, one a line in turn, with the names that only lines of each have.

    Examples
    --------
    >>> sorted(sensors_in(["left: 1,2", "right: 3,4"] * 4)), sensors_in(["left: 1,2"] * 8)
    (['left', 'right'], {})
    """
    lines = [line for line in first[:_LINES] if line.strip()]
    if 2 * sum(map(has_marks, lines[:20])) < len(lines[:20]) or not lines:
        return {}
    counts = Counter(map(names_of, lines))
    usual = [names for names, count in counts.items() if names and count >= max(2, _SHARE * len(lines))]
    common = frozenset.intersection(*usual) if usual else frozenset[str]()
    own = [names - common for names in usual]
    apart = sum(map(len, own)) == len(frozenset[str]().union(*own)) and all(own)
    return {" ".join(sorted(names)): names for names in own} if len(own) > 1 and apart else {}


def sensor_of(line: str, sensors: dict[str, frozenset[str]]) -> str:
    """Return the sensor that a line names; "" if none."""
    names = names_of(line)
    return next((name for name, own in sensors.items() if own <= names), "")


def names_of(line: str) -> frozenset[str]:
    """Return the names in a line of JSON, or before its numbers, without the places in lists."""
    found = read_line(line, "json" if line.lstrip()[:1] == "{" else "marked")
    names = found.names if found is not None else ()
    return frozenset(re.split(r"[\[.]", name)[0] for name in names if name)
