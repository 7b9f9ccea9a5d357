"""The contents that a file of each kind can hold: the fields that a reader will return, and what is lost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel import _core, wire
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.contents import Contents, once, several, together
from taxel.recording.fates import after, sensor
from taxel.recording.kinds import ENDINGS, verdict_of
from taxel.recording.sidecars import calibration_beside, has_calibration
from taxel.recording.write_csv import array_in_csv
from taxel.recording.write_mcap import cut_raw, encoded

__all__ = ["STAMP_US", "is_made", "stored"]

#: The unit of the stamps of wire version 1, us.
STAMP_US = 100

#: Fields that describe how the datagrams are encoded.
_OF_DATAGRAMS = ("version_2", "differences", "origin_us", "unmarked")

#: The most numbers of repaired events in the description of a .mcap, which is limited to 16 MiB.
_MOST = 1_000_000


def stored(of: Contents, place: Path) -> Contents:
    """Return the contents that a file can hold of a recording; the kind of file is the ending of its path.

    Raises
    ------
    ProblemError : contents that the kind of file cannot hold at all (pictures in a .lsa)
    """
    ending = place.suffix.lower()
    if of.is_several and ending == ".mcap" and together(of.sources):
        parts = {name: stored(one.but(sources={}), place) for name, one in of.sources.items()}
        parts.update({name: one.but(name=f"{place.name} {name}", sources=parts) for name, one in parts.items()})
        return several(parts)
    common: dict[str, Any] = {"path": place, "name": place.name, "kind": ENDINGS[ending], "label": "board"}
    lines = {".mcap": _mcap, ".lsa": _lsa, ".csv": _csv, ".npz": _table, ".h5": _table}[ending]
    return lines(of, ending, common | _calibration(of, place))


def is_made(of: Contents) -> bool:
    """Return whether a file's bytes must be made of the events, as no datagrams contain exactly these events."""
    return of.is_slice or of.clock_of is not None or not (of.holds("datagrams") or of.holds("payload"))


def _calibration(of: Contents, place: Path) -> dict[str, Any]:
    """Return the calibration beside a new file."""
    return {"calibration": once(lambda: calibration_beside(place, of), lambda: has_calibration(place))}


def _left_beside(of: Contents, place: Path) -> list[str]:
    """Return a line if the recording's calibration does not lie beside the new file."""
    if not of.holds("calibration") or has_calibration(place):
        return []
    return ["the calibration, a file of its own: lay a copy beside the new one"]


def _table(of: Contents, ending: str, common: dict[str, Any]) -> Contents:
    """Return the contents of a .npz or a .h5: all but the raw datagrams."""
    place = common["path"]
    return after(ending, of, lambda: _left_beside(of, place), **common, source=of.source or of.name)


def _csv(of: Contents, ending: str, common: dict[str, Any]) -> Contents:
    """Return the contents of a .csv: events without markers, or pictures without their unit."""
    place = common["path"]
    table, events, frames = of.table, None, None
    own = array_in_csv(table)
    same = replace(of.array, name=own.name, names=None) == own
    lost = [f'the name of the sensor ("{of.array.name}")' if same else sensor(of.array)]
    lost += ["the names of the taxels"] * (of.array.names is not None)
    if isinstance(table, Events):
        lost += [f"{counted(len(table.markers), 'marker')} of start and stop"] * bool(table.markers)
        events = table[:]
        events.markers = ()
        events.array = array_in_csv(table)
    else:
        lost += [f"the unit ({table.unit})"] * (table.unit != "counts")
        array = array_in_csv(table)
        frames = Frames(table.values[:, : array.rows, : array.columns], table.t, array=array)
    changed: dict[str, Any] = {"events": events, "frames": frames, "array": array_in_csv(table)}
    return after(ending, of, lambda: [*lost, *_left_beside(of, place)], **common, **changed)


def _lsa(of: Contents, ending: str, common: dict[str, Any]) -> Contents:
    """Return the contents of a .lsa: the board's bytes as received, or made of the events."""
    place, events = common["path"], _events(of, common["path"])
    lost = [sensor(of.array)] * (of.array != Array.thesis())
    payload = of.payload if of.datagrams is None else of.datagrams.payload
    if payload is None or is_made(of) or of.version_2:
        lost += ["raw bytes (words that are no events)"] * of.holds("payload")
        times = np.concatenate([events.t, np.array([at for at, _ in events.markers], np.int64)])
        lost += ["times finer than 100 us"] * bool((times % STAMP_US).any())
        lost += ["which events are repaired"] * (events.repaired is not None)
        payload = np.frombuffer(_core.wire_encode(events._parts()), np.uint8)
    again = wire.decode(payload, array=of.array, differences=of.differences and not is_made(of))
    if len(again) != len(events):
        lost.append(f"the pairing of intensities ({counted(len(again), 'event')} when paired directly)")
    elif (again.t != events.t // STAMP_US * STAMP_US).any():
        lost.append("whole turns of 6.5536 s in times")
    changed: dict[str, Any] = {"array": Array.thesis(), "events": once(lambda: events), "frames": None}
    return after(ending, of, lambda: [*lost, *_left_beside(of, place)], **common, **changed, payload=payload)


def _mcap(of: Contents, ending: str, common: dict[str, Any]) -> Contents:
    """Return the contents of a .mcap: all; events without datagrams of exactly these events get new datagrams."""
    place, is_file = common["path"], of.kind != "events"
    # Of what recordings were merged stands in `source`.
    origin = [f"converted from {of.name}"] if is_file and of.kind != "merged" else []
    changed: dict[str, Any] = {
        "source": of.source or of.name or ("events" if of.has_events else "pictures"),
        "rebuilt": {},
        "truncated": False,
        "counts": once(lambda: of.counts),
        "verdict": verdict_of(of) if is_file else None,
        "remarks": once(lambda: tuple(dict.fromkeys((*of.remarks, *origin)))),
    }
    if of.samples is not None:
        stay = (*_OF_DATAGRAMS, "events", "frames", "clock", "datagrams", "payload", "label")
        changed |= {name: vars(of)[name] for name in stay}
        bad = of.counts.get("lines_that_could_not_be_read", 0)
        lines = [f"{bad} lines that could not be read"] * bool(bad)
        outside = of.clock is not None and len(of.clock.board_us) > len(of.samples)
        lines += ["arrival times of lines outside the part"] * outside
        return after(ending, of, lambda: [*lines, *_mended(of), *_left_beside(of, place)], **(common | changed))
    if not of.has_events:
        # Pictures have the times of the board alone.
        whole = "raw datagrams with their arrival times"
        lines = [whole] if of.holds("datagrams") else ["arrival times"] * of.holds("clock")
        lines += ["raw bytes (words that are no events)"] * of.holds("payload")
        held = {name: vars(of)[name] for name in ("frames", "label")}
        none = {"events": None, "clock": None, "datagrams": None, "payload": None}
        made = {"version_2": False, "differences": False, "origin_us": 0, "unmarked": ()}
        changed = common | changed | held | none | made
        return after(ending, of, lambda: [*lines, *_mended(of), *_left_beside(of, place)], **changed)
    events = _events(of, place)
    changed |= {"events": once(lambda: events), "frames": None, "payload": None}
    if not is_made(of):
        same = (*_OF_DATAGRAMS, "clock", "datagrams", "payload")
        changed |= {name: vars(of)[name] for name in same}
        if of.datagrams is None and of.payload is not None:
            changed["datagrams"] = cut_raw(of.payload)
        return after(ending, of, lambda: [*_mended(of), *_left_beside(of, place)], **common, **changed)
    clock = of.clock if of.clock is not None and len(of.clock.board_us) else None
    lost = ["raw datagrams"] * of.holds("datagrams") + ["raw bytes (words that are no events)"] * of.holds("payload")
    origin_us, datagrams, unmarked = encoded(events, of.held, clock)
    lost += [f"that {len(unmarked) - _MOST} of the events are repaired"] * (len(unmarked) > _MOST)
    changed |= {"datagrams": datagrams, "version_2": True, "differences": False, "clock": clock}
    changed |= {"origin_us": origin_us, "unmarked": tuple(unmarked[:_MOST].tolist())}
    return after(ending, of, lambda: [*lost, *_mended(of), *_left_beside(of, place)], **common, **changed)


def _mended(of: Contents) -> list[str]:
    """Return a line if a new .mcap is made of a damaged file, as the new file itself is undamaged."""
    return ["that its end is missing"] * of.truncated + ["what reading had to put up with"] * of.holds("rebuilt")


def _events(of: Contents, place: Path) -> Events:
    events = of.events
    if events is None:
        raise ProblemError(
            f"{place}: a {place.suffix.lower()} holds events and no pictures; write those to .mcap, .npz, .csv or .h5"
        )
    return events
