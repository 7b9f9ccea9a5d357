"""The table of what each function does to each field of a recording's contents: carry, change or lose it.

`=`: the field is copied unchanged. `~`: the function sets another value. `-`: the field is lost; it gets its default,
and if it held anything, `LINES` adds a line to `Contents.lost`. A field of `Contents` without a row in this table fails
`tests/recording/test_fates.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from taxel._base.messages import counted
from taxel.array import Array
from taxel.recording.contents import UNKNOWN, Contents, once

__all__ = ["CARRIED", "CHANGED", "FATES", "LINES", "LOST", "after", "sensor"]

CARRIED, CHANGED, LOST = "=", "~", "-"

#: The last five columns are `convert` to that kind of file; `pictures` is its `frames_hz`, and `Recording.frames`.
_TABLE = """
                  between region merge on_clock with_notes calibrated pictures source .mcap .lsa .npz .csv .h5
path                 =      =      ~      =         =          =         =       =      ~     ~    ~    ~   ~
name                 =      =      ~      =         =          =         =       ~      ~     ~    ~    ~   ~
kind                 =      =      ~      =         =          =         =       =      ~     ~    ~    ~   ~
array                =      ~      ~      =         =          =         =       ~      =     ~    =    ~   =
label                =      =      ~      =         =          =         =       ~      ~     ~    ~    ~   ~
source               =      =      ~      =         =          =         =       ~      ~     -    ~    -   ~
side                 =      =      ~      =         =          =         =       ~      =     -    =    -   =
heel                 =      =      ~      =         =          =         =       ~      =     -    =    -   =
events               ~      ~      ~      ~         =          ~         ~       ~      ~     ~    =    ~   =
frames               ~      ~      ~      ~         =          ~         ~       ~      ~     ~    =    ~   =
stretch              ~      =      -      =         =          =         =       ~      -     -    -    -   -
held                 ~      ~      ~      =         =          ~         ~       ~      =     -    =    -   =
registers            =      =      ~      =         =          =         =       ~      =     -    =    -   =
register_changes     =      =      ~      =         =          =         =       ~      =     -    =    -   =
board_changes        =      =      ~      ~         =          =         =       ~      =     -    =    -   =
notes                ~      =      ~      ~         ~          =         =       ~      =     -    =    -   =
detections           ~      =      ~      ~         =          =         =       ~      =     -    =    -   =
zeroings             ~      ~      ~      ~         =          =         =       ~      =     -    =    -   =
calibration          =      ~      ~      =         =          ~         =       ~      ~     ~    ~    ~   ~
clock                =      =      ~      ~         =          =         =       ~      ~     -    -    -   -
clock_of             =      =      ~      ~         =          =         =       =      -     -    -    -   -
counts               =      =      ~      =         =          =         =       ~      ~     -    =    -   =
verdict              ~      =      ~      ~         =          =         =       ~      ~     -    =    -   =
remarks              =      =      ~      =         =          =         =       ~      ~     -    =    -   =
datagrams            =      -      -      =         =          =         =       ~      ~     -    -    -   -
payload              =      -      -      =         =          =         =       ~      ~     ~    -    -   -
version_2            =      -      -      =         =          =         =       ~      ~     -    -    -   -
differences          =      -      -      =         =          =         =       ~      ~     -    -    -   -
origin_us            =      -      -      =         =          =         =       ~      ~     -    -    -   -
unmarked             =      -      -      =         =          =         =       ~      ~     -    -    -   -
samples              ~      -      -      ~         =          -         =       ~      =     -    -    -   -
columns              =      ~      ~      =         =          =         =       ~      =     -    =    -   =
untimed              =      =      ~      =         =          =         =       ~      =     -    =    -   =
truncated            =      =      ~      =         =          =         =       ~      ~     -    =    -   =
rebuilt              =      =      ~      =         =          =         =       ~      ~     -    =    -   =
sources              ~      -      -      ~         ~          =         =       =      -     -    -    -   -
lost                 ~      ~      ~      ~         =          ~         =       ~      ~     ~    ~    ~   ~
"""

_HEADER, *_ROWS = _TABLE.strip("\n").splitlines()
STEPS = tuple(_HEADER.split())
#: By function and field.
FATES: dict[str, dict[str, str]] = {step: {} for step in STEPS}
for _row in _ROWS:
    _field, *_fates = _row.split()
    for _step, _fate in zip(STEPS, _fates, strict=True):
        FATES[_step][_field] = _fate

_DEFAULTS: dict[str, Callable[[], Any]] = {
    one.name: (lambda one=one: one.default) if one.default_factory is MISSING else one.default_factory  # type: ignore[misc]
    for one in fields(Contents)
    if one.default is not MISSING or one.default_factory is not MISSING
}


def sensor(array: Array) -> str:
    """Return the line of `lost` for a sensor."""
    some = "" if array.exists is None else f", {array.taxels} exist"
    return f'the sensor ({array.rows} x {array.columns} taxels{some}, {array._apart()}, "{array.name}")'


def _datagrams(of: Contents, step: str) -> str:
    if step == ".lsa" and not _made(of) and not of.version_2:
        return "arrival times, and where datagrams begin"
    return "raw datagrams" + " with their arrival times" * (FATES[step]["clock"] == LOST)


def _made(of: Contents) -> bool:
    """Return whether a file's bytes must be made of the events, as the datagrams are of another part or clock."""
    return of.is_slice or of.clock_of is not None


def _sources(of: Contents, _: str) -> list[str]:
    return [f"the source {name}" for name in of.sources if name != of.label]


#: The line of `lost` for a field that held anything. None: the field is part of another one, or follows from others.
LINES: dict[str, Callable[[Contents, str], str | list[str]] | None] = {
    "source": lambda of, _: f"where it came from ({of.source})",
    "side": lambda of, _: f"the side ({of.side})",
    "heel": lambda of, _: f"where the heel lies ({of.heel})",
    # A part that is written to a file becomes a recording of its own.
    "stretch": None,
    "held": lambda of, _: f"what {counted(int(np.sum(of.held != UNKNOWN)), 'taxel')} held at the beginning",
    "registers": lambda _, __: "the board's registers",
    "register_changes": lambda of, _: f"{counted(len(of.register_changes), 'setting')} of the registers",
    "board_changes": lambda of, _: f"{counted(len(of.board_changes), 'change')} of the board",
    "notes": lambda of, _: counted(len(of.notes), "note"),
    "detections": lambda of, _: counted(len(of.detections), "detection"),
    "zeroings": lambda of, _: counted(len(of.zeroings), "zeroed taxel"),
    "clock": lambda of, _: [] if of.holds("datagrams") else "arrival times",
    "clock_of": lambda of, _: f"by whose clock times are ({of.clock_of})",
    "counts": lambda _, __: "what was received and lost, by cause",
    # With counts, this is what they say.
    "verdict": lambda of, _: [] if of.holds("counts") else "what was lost, in one line",
    "remarks": lambda of, _: [f"the remark: {line}" for line in of.remarks],
    "datagrams": _datagrams,
    "payload": lambda _, __: "raw bytes (words that are no events)",
    # These fields describe how the datagrams are encoded; a .lsa has only the bytes of the datagrams.
    "version_2": None,
    "differences": lambda _, step: "that intensities are differences" if step == ".lsa" else [],
    "origin_us": None,
    "unmarked": None,
    "samples": lambda _, __: "the lines of the stream as they came",
    "columns": lambda of, _: f"the names of the columns ({', '.join(of.columns or ())})",
    "untimed": lambda _, __: "that its pictures have no times",
    "truncated": lambda _, __: "that its end is missing",
    "rebuilt": lambda _, __: "what reading had to put up with",
    "sources": _sources,
}


def after(step: str, of: Contents, lines: Callable[[], Iterable[str]] | None = None, **changed: Any) -> Contents:
    """Return new contents according to the column of a function in the table.

    Parameters
    ----------
    step : str
        The function: a column of the table.
    of : Contents
    lines : function that returns lines, optional
        Lines for information that is lost from the changed fields.
    **changed
        A value (or `once`) for each field that the table marks as changed, and for no other.
    """
    fates = FATES[step]
    expected = {name for name, fate in fates.items() if fate == CHANGED} - {"lost"}
    if changed.keys() != expected:
        raise TypeError(f"{step}: changes {sorted(changed)}; the table of fates says {sorted(expected)}")
    gone = [name for name, fate in fates.items() if fate == LOST]
    changed |= {name: _DEFAULTS[name]() for name in gone}
    if fates["lost"] == CHANGED:
        changed["lost"] = once(
            lambda: _together(of.lost, _lost_lines(step, of, gone), () if lines is None else lines())
        )
    return of.but(**changed)


def _lost_lines(step: str, of: Contents, gone: Iterable[str]) -> list[str]:
    lines = []
    for name in gone:
        line = LINES[name]
        if line is not None and of.holds(name):
            lost = line(of, step)
            lines += [lost] if isinstance(lost, str) else lost
    return lines


def _together(*every: Iterable[str]) -> tuple[str, ...]:
    """Return all lines in order, without duplicates."""
    return tuple(dict.fromkeys(line for lines in every for line in lines))
