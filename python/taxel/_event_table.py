"""Tables of labels as other programs write them: with times in ms or s, those of BIDS, and label tracks of Audacity.

The last two count their times from the beginning of their recording: tables with columns `onset` and `duration` in s,
and lines of begin, end and label between tabs, in s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from taxel._base.arguments import shown
from taxel._base.errors import unreadable
from taxel._base.header_table import HeaderTable
from taxel._base.messages import counted, warn

__all__ = ["are_of_bids", "are_of_events", "is_of_track", "track", "with_known_columns"]

#: The columns of times, and how many us their unit has; the columns of labels; capitals do not matter.
_US, _LABELS = {"t_us": 1.0, "t_ms": 1e3, "t_s": 1e6, "onset": 1e6}, ("label", "trial_type")
#: What else a table has that is one of labels alone.
_OTHERS = {"recording", "source", "host_ns", "replaces_us", "stop_us", "group", "duration"}
#: What BIDS writes where a value is missing.
_MISSING = "n/a"
#: What begins a line of a label track that says a range of frequencies.
_FREQUENCIES = "\\\t"


def with_known_columns(table: HeaderTable, separator: str) -> HeaderTable:
    """Return a table with its columns of labels and times named `label` and `t_us`, and its times in whole us.

    Parameters
    ----------
    table : HeaderTable
    separator : str
        Separator of its cells: unless it is a comma, numbers may have decimal commas.

    Raises
    ------
    FormatError : no column of times or of labels, a time that is no number (names line and column)

    Examples
    --------
    >>> table = HeaderTable.read("a.csv", ["t_s;label", "0,5;heel"])
    >>> list(with_known_columns(table, ";"))
    [(2, {'t_us': '500000', 'label': 'heel'})]
    """
    header, names = list(table.header), [name.lower() for name in table.header]
    if not header or {"label", "t_us"} <= set(header):
        return table
    time, label = (next((name for name in known if name in names), None) for known in (_US, _LABELS))
    if time is None or label is None:
        raise unreadable(
            f"column {'t_us' if time is None else 'label'!r} is missing; the columns are "
            f"{', '.join(map(shown, header))}; must be label,t_us ..., or with times in t_ms, t_s or onset",
            table.location,
            line=1,
        )
    at, of = names.index(time), names.index(label)
    time, label = header[at], header[of]
    header[at], header[of] = "t_us", "label"
    rows = list[tuple[int, tuple[str, ...]]]()
    for line, cells in table:
        us = _number(cells[time], separator) * _US[time.lower()]
        if cells[label].strip() == _MISSING:
            continue
        if not math.isfinite(us):
            raise unreadable(f"{time} is {shown(cells[time])}; must be a number", table.location, line=line)
        rows.append((line, tuple({**cells, time: str(round(us))}.values())))
    return replace(table, header=tuple(filter(None, header)), lines=tuple(rows))


def are_of_events(names: Sequence[str], *, named: bool = False) -> bool:
    """Return whether a table is one of labels, by its names: it has times and labels, and nothing else.

    One that the name of its file calls so (`named`) may have other columns.

    Examples
    --------
    >>> are_of_events(["t_s", "label"]), are_of_events(["t_s", "label", "palm"])
    (True, False)
    """
    known = {name.lower() for name in names}
    has_both = not known.isdisjoint(_US) and not known.isdisjoint(_LABELS)
    return are_of_bids(names) or (has_both and (named or known <= {*_US, *_LABELS, *_OTHERS}))


def are_of_bids(names: Sequence[str]) -> bool:
    """Return whether the columns of a table are those of BIDS."""
    return {name.lower() for name in names} >= {"onset", "duration"}


def is_of_track(line: str) -> bool:
    r"""Return whether a line is the first one of a label track; those of a table of numbers have no text.

    Examples
    --------
    >>> is_of_track("0.5\t0.75\theel\n"), is_of_track("0.5\t0.75\t3\n"), is_of_track("0,5\t0,75\theel strike")
    (True, False, True)
    """
    cells = line.rstrip("\r\n").split("\t")
    return len(cells) == 3 and [math.isnan(_number(cell, "\t")) for cell in cells] == [False, False, bool(cells[2])]


def track(location: str, lines: Sequence[str]) -> HeaderTable:
    r"""Return a label track as a table of labels; the end of a label is its column `stop_us`.

    Labels without a name are left out, with a warning.

    Raises
    ------
    FormatError : a line that is not begin, end and label (names it)

    Examples
    --------
    >>> list(track("a.txt", ["0.5\t0.75\theel\n"]))
    [(1, {'t_us': '500000', 'stop_us': '750000', 'label': 'heel'})]
    """
    rows, unnamed = [], 0
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith(_FREQUENCIES):
            continue
        cells = line.rstrip("\r\n").split("\t", 2)
        times = [_number(cell, "\t") for cell in cells[:2]]
        if len(cells) < 2 or not all(map(math.isfinite, times)):
            raise unreadable(
                f"{shown(line.strip())}; must be begin and end, s, and label, between tabs", location, line=number
            )
        label = "".join(cells[2:]).strip()
        unnamed += not label
        rows += [(number, (*(str(round(t * 1e6)) for t in times), label))] * bool(label)
    if unnamed:
        warn(f"{location}: left out {counted(unnamed, 'label')} without a name", stacklevel=4)
    return HeaderTable(location, ("t_us", "stop_us", "label"), tuple(rows))


def _number(cell: str, separator: str) -> float:
    """Return the number of a cell, with a decimal comma unless that is the separator; NaN for a text."""
    try:
        return float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return math.nan
