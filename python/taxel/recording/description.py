"""The description of a recording as JSON: the entry ``about`` of a .npz and of a .h5."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base import limits
from taxel._base.arguments import finite, flag, integer, number, text
from taxel._base.documents import of_json
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.detections import Detections
from taxel.events import Events
from taxel.formats.checks import sensor as checked
from taxel.frames import Frames
from taxel.labels import Note
from taxel.recording import sections
from taxel.recording.changes import BoardChange, Zeroing
from taxel.recording.contents import FrameSource, RecordedSource, source_from
from taxel.recording.kinds import verdict_of
from taxel.recording.once import known
from taxel.recording.verdict import Verdict
from taxel.wire import Registers


def json_of(source: RecordedSource) -> str:
    """Return all fields that are not columns of the table, as the JSON in files."""
    sensor, losses = source.sensor, source.losses
    registers, changes = source.settings.registers(), source.settings.register_changes()
    driven = registers.array if registers is not None else changes[0][1].array if changes else sensor.array
    document: dict[str, Any] = {
        "array": sensor.array._geometry(),
        "source": source.origin.source,
        "side": sensor.side,
        "heel": sensor.heel,
        "registers": None if registers is None else registers._held,
        "registers_array": None if driven == sensor.array else driven._geometry(),
        "register_changes": [[at, registers._held] for at, registers in changes],
        "board_changes": [[change.at_ns, change._described()] for change in source.marks.board_changes()],
        "notes": [{"text": n.text, "t_us": n.t, "at_ns": n.at_ns} for n in source.marks.notes()],
        "detections": [
            [0, d.label, d.t, d.known, None if np.isnan(d.slope) else d.slope, d.repaired]
            for d in source.marks.detections()
        ],
        "counts": dict(losses.counts()),
        "verdict": None if losses.verdict() is None else verdict_of(source).to_dict(),
        "remarks": losses.remarks,
        "zeroings": [
            {"t": z.t, "x": z.x, "y": z.y, "rest": z.rest, "before": z.before} for z in source.marks.zeroings()
        ],
        "columns": source.columns,
        "untimed": source.untimed,
        "turned": source.frame_table.turned if isinstance(source, FrameSource) else None,
        "frame_us": source.frame_table.frame_us if isinstance(source, FrameSource) else None,
        "truncated": losses.truncated,
        "rebuilt": dict(losses.rebuilt()),
        "lost": losses.lost(),
    }
    return json.dumps({name: value for name, value in document.items() if value or isinstance(value, float)})


def about_of(location: str, document: str) -> dict[str, Any]:
    """Return what a file's ``about`` holds by its entries, checked.

    Raises
    ------
    FormatError : not JSON of the expected form (names the entry)
    """
    entry = "the whole"
    fields: dict[str, Any] = {}
    try:
        about = of_json(location, document)
        if not isinstance(about, dict):
            raise ProblemError("not an object")
        for entry, read in _ENTRIES.items():
            if about.get(entry) is not None:
                fields[entry] = read(about[entry], location)
        driven = fields.pop("registers_array", None) or fields.get("array") or Array.thesis()
        for entry in ("registers", "register_changes"):
            if entry in fields:
                fields[entry] = _registers(fields[entry], driven)
    except FormatError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, ProblemError) as error:
        raise FormatError(
            f"{location}, {entry}: {first_line(error)}; the description must be JSON as taxel writes it"
        ) from None
    return fields


def described_source(
    table: Events | Frames, held: NDArray[np.uint16] | None, origin: sections.Origin, about: Mapping[str, Any]
) -> RecordedSource:
    """Return a source of a table and of what `about_of` read; its sensor is that of the table."""
    get = about.get
    none = Detections([], [], [])
    return source_from(
        table,
        replace(origin, source=get("source", "")),
        untimed=get("untimed", False),
        turned=get("turned"),
        frame_us=get("frame_us"),
        columns=get("columns", ()),
        sensor=sections.Sensor(table.array, get("side", ""), get("heel", "")),
        settings=sections.Settings(known(held), known(get("registers")), known(get("register_changes", ()))),
        marks=sections.Marks(
            board_changes=known(get("board_changes", ())),
            notes=known(get("notes", ())),
            detections=known(get("detections", none)),
            zeroings=known(get("zeroings", ())),
        ),
        losses=sections.Losses(
            counts=known(get("counts", {})),
            verdict=known(get("verdict")),
            remarks=get("remarks", ()),
            truncated=get("truncated", False),
            rebuilt=known(get("rebuilt", {})),
            lost=known(get("lost", ())),
        ),
    )


def array_of(geometry: Mapping[str, Any]) -> Array:
    """Return the sensor that a file describes."""
    if not isinstance(geometry, Mapping):
        raise ProblemError("not an object")
    return Array._from_geometry(dict(geometry))


def notes_of(records: Any) -> tuple[Note, ...]:
    """Return notes from records of text, t_us and at_ns."""
    return tuple(Note(text("text", n["text"]), _time("t_us", n["t_us"]), integer("at_ns", n["at_ns"])) for n in records)


def detections_of(records: Any) -> Detections:
    """Return detections from records of (host ns, label, t, known, slope, repaired); JSON has no NaN."""
    rows = list(records)
    slopes = [float("nan") if row[4] is None else float(row[4]) for row in rows]
    label, t, known, repaired = ([row[k] for row in rows] for k in (1, 2, 3, 5))
    return Detections._of(label, t, known, slopes, repaired=repaired)


def zeroings_of(records: Any) -> tuple[Zeroing, ...]:
    """Return zeroed taxels, in order of time, from records of t, x, y, rest and before."""
    zeroings = (
        Zeroing(
            integer("t", record["t"], -limits.TIME_US, limits.TIME_US),
            integer("x", record["x"], 0, 65_535),
            integer("y", record["y"], 0, 65_535),
            number("rest", record["rest"]),
            None if record["before"] is None else number("before", record["before"]),
        )
        for record in records
    )
    return tuple(sorted(zeroings, key=lambda zeroing: zeroing.t))


def board_changes_of(records: Any) -> tuple[BoardChange, ...]:
    """Return changes of the board from pairs of a host time (ns) and a record of t_us, change, version, asked."""
    return tuple(
        BoardChange(
            _time("t_us", record["t_us"]),
            integer("at_ns", at),
            text("change", record["change"]),
            None if record.get("version") is None else integer("version", record["version"], 0, 255),
            flag("asked", record.get("asked", False)),
        )
        for at, record in records
    )


def _time(name: str, value: Any) -> int | None:
    return None if value is None else integer(name, value, -limits.TIME_US, limits.TIME_US)


def _registers(values: Any, driven: Array) -> Any:
    """Return a set of registers, or a list of times and sets, checked against the array that they drive."""
    if isinstance(values, list):
        return tuple((integer("at_ns", at), Registers._of_file(registers, driven)) for at, registers in values)
    return Registers._of_file(values, driven)


def counts_of(counts: Any, depth: int = 0) -> dict[str, Any]:
    """Return counts by cause, whole numbers of 0 or more; those of the decoder are a nested mapping."""
    if not isinstance(counts, dict):
        raise ProblemError("not an object")
    return {
        name: n if n is None else counts_of(n, 1) if isinstance(n, dict) and depth == 0 else integer(name, n, 0)
        for name, n in counts.items()
    }


def turned_of(value: Any) -> float:
    """Return the number that readings were subtracted from, as a file states it."""
    return finite("turned", value, least=-limits.VALUE, most=limits.VALUE)


def frame_us_of(value: Any) -> float:
    """Return the time from one frame to the next, us, as a file states it."""
    return finite("frame_us", value, "us", least=1.0, most=3.6e9)


def _texts(texts: Any) -> tuple[str, ...]:
    if not isinstance(texts, list):
        raise ProblemError("not a list")
    return tuple(text("entry", entry) for entry in texts)


#: The reader of each entry by name; registers are checked later, as the array that they drive is another entry.
_ENTRIES: dict[str, Any] = {
    "array": lambda value, location: checked(location, array_of(value)),
    "source": lambda value, _: text("source", value),
    "side": lambda value, _: text("side", value, ("left", "right")),
    "heel": lambda value, _: text("heel", value, ("top", "bottom")),
    "registers": lambda value, _: value,
    "registers_array": lambda value, location: checked(location, array_of(value)),
    "register_changes": lambda value, _: value,
    "board_changes": lambda value, _: board_changes_of(value),
    "notes": lambda value, _: notes_of(value),
    "detections": lambda value, _: detections_of(value),
    "counts": lambda value, _: counts_of(value),
    "verdict": lambda value, _: Verdict.from_dict(value),
    "remarks": lambda value, _: _texts(value),
    "zeroings": lambda value, _: zeroings_of(value),
    "columns": lambda value, _: _texts(value),
    "turned": lambda value, _: turned_of(value),
    "frame_us": lambda value, _: frame_us_of(value),
    "untimed": lambda value, _: flag("untimed", value),
    "truncated": lambda value, _: flag("truncated", value),
    "rebuilt": lambda value, _: counts_of(value),
    "lost": lambda value, _: _texts(value),
}
