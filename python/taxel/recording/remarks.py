"""What stands beside events or pictures in a file: where they came from, notes, detections, registers, losses."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from taxel._base import limits
from taxel._base.arguments import number, text, whole
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.detections import Detections
from taxel.formats.checks import sensor
from taxel.wire import Registers

__all__ = ["Note", "Remarks", "Zeroing", "array_of", "detections_of", "notes_of", "zeroings_of"]


@dataclass(frozen=True)
class Note:
    """Hold what a person wrote down while recording.

    Parameters
    ----------
    text : str
    t : int, us, optional
        The board's time, where it was known.
    at_ns : int, ns since 1970
        The host's time.
    """

    text: str
    t: int | None
    at_ns: int


@dataclass(frozen=True)
class Zeroing:
    """Hold that a person zeroed a taxel: from then on it rests at what it held.

    Parameters
    ----------
    t : int, us
        When: after all events up to then, before later ones.
    x, y : int
        The taxel's column and row.
    rest : float, ticks
        What it rests at from then on.
    before : float, ticks, optional
        What it rested at before, where that was known.
    """

    t: int
    x: int
    y: int
    rest: float
    before: float | None


@dataclass(frozen=True)
class Remarks:
    """Hold what a table of events or pictures cannot: as JSON it stands in a .npz and a .h5.

    Parameters
    ----------
    array : Array, optional
        The sensor, where the file says.
    source : str
        Where the bytes came from.
    registers : mapping, optional
        What the board's registers held.
    notes : tuple of Note
    detections : Detections
    counts : mapping
        What came and what was lost, by cause.
    verdict : str
        The same in one line.
    zeroings : tuple of Zeroing
    """

    array: Array | None = None
    source: str = ""
    registers: Mapping[str, Any] | None = None
    notes: tuple[Note, ...] = ()
    detections: Detections = field(default_factory=lambda: Detections([], [], []))
    counts: Mapping[str, Any] = field(default_factory=dict)
    verdict: str = ""
    zeroings: tuple[Zeroing, ...] = ()

    def to_json(self) -> str:
        """Return the remarks as files hold them."""
        found = self.detections
        said: dict[str, Any] = {
            "array": None if self.array is None else self.array._geometry(),
            "source": self.source,
            "registers": self.registers,
            "notes": [{"text": n.text, "t_us": n.t, "at_ns": n.at_ns} for n in self.notes],
            "detections": [
                [0, d.label, d.t, d.known, None if np.isnan(d.slope) else d.slope, d.repaired] for d in found
            ],
            "counts": dict(self.counts),
            "verdict": self.verdict,
            "zeroings": [{"t": z.t, "x": z.x, "y": z.y, "rest": z.rest, "before": z.before} for z in self.zeroings],
        }
        return json.dumps({name: value for name, value in said.items() if value})

    @classmethod
    def from_json(cls, place: str, said: str) -> Remarks:
        """Return the remarks that a file holds, checked.

        Raises
        ------
        FormatError : no JSON as taxel writes it (names the entry)
        """
        limits.unpacked(place, len(said), limits.DESCRIPTION)
        entry = "the whole"
        try:
            about = json.loads(said)
            if not isinstance(about, dict):
                raise ProblemError("no object")
            entry = "array"
            array = None if about.get(entry) is None else sensor(place, array_of(about[entry]))
            entry = "registers"
            if about.get(entry) is not None:
                Registers._of(about[entry], array or Array.thesis())
            entry = "notes"
            notes = notes_of(about.get(entry, ()))
            entry = "detections"
            detections = detections_of(about.get(entry, ()))
            entry = "counts"
            counts = _counts(about.get(entry, {}))
            entry = "source"
            source = text(entry, about.get(entry, ""))
            entry = "verdict"
            verdict = text(entry, about.get(entry, ""))
            entry = "zeroings"
            zeroings = zeroings_of(about.get(entry, ()))
        except FormatError:
            raise
        except RecursionError:
            raise FormatError(f"{place}: nested too deeply; must be JSON as taxel writes it") from None
        except (ValueError, KeyError, TypeError, AttributeError, IndexError, ProblemError) as error:
            said = str(error).split("\n", maxsplit=1)[0][:200]
            raise FormatError(f"{place}, {entry}: {said}; must be JSON as taxel writes it") from None
        return cls(array, source, about.get("registers"), notes, detections, counts, verdict, zeroings)


def array_of(said: Mapping[str, Any]) -> Array:
    """Return the sensor that a file describes."""
    if not isinstance(said, Mapping):
        raise ProblemError("no object")
    return Array._from_geometry(dict(said))


def notes_of(said: Any) -> tuple[Note, ...]:
    """Return notes from records of text, t_us and at_ns."""
    return tuple(
        Note(
            text("text", n["text"]),
            None if n["t_us"] is None else whole("t_us", n["t_us"], -limits.TIME_US, limits.TIME_US),
            whole("at_ns", n["at_ns"]),
        )
        for n in said
    )


def detections_of(said: Any) -> Detections:
    """Return detections from records of (host ns, label, t, known, slope[, repaired]); JSON has no NaN."""
    rows = list(said)
    slopes = [float("nan") if row[4] is None else float(row[4]) for row in rows]
    repaired = [row[5] if len(row) > 5 else False for row in rows]
    label, t, known = ([row[k] for row in rows] for k in (1, 2, 3))
    return Detections._of(label, t, known, slopes, repaired=repaired)


def zeroings_of(said: Any) -> tuple[Zeroing, ...]:
    """Return zeroed taxels, in order of time, from records of t, x, y, rest and before."""
    zeroings = (
        Zeroing(
            whole("t", one["t"], -limits.TIME_US, limits.TIME_US),
            whole("x", one["x"], 0, 65_535),
            whole("y", one["y"], 0, 65_535),
            number("rest", one["rest"]),
            None if one["before"] is None else number("before", one["before"]),
        )
        for one in said
    )
    return tuple(sorted(zeroings, key=lambda one: one.t))


def _counts(said: Any, depth: int = 0) -> dict[str, Any]:
    """Return counts by cause, whole numbers of 0 or more; those of the decoder stand in one of their own."""
    if not isinstance(said, dict):
        raise ProblemError("no object")
    return {
        name: n if n is None else _counts(n, 1) if isinstance(n, dict) and depth == 0 else whole(name, n, 0)
        for name, n in said.items()
    }
