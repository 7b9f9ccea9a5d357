"""The fields of a source, section by section, and the words that say that one is lost."""

from __future__ import annotations

from collections.abc import Sized
from dataclasses import fields
from typing import Any

import numpy as np

from taxel.calibration import Calibration
from taxel.clock import Clock
from taxel.recording.contents import RecordedSource, sections_of
from taxel.recording.once import UNKNOWN, Once
from taxel.recording.raw import Datagrams, Samples

#: What a line in `lost` says of a field that is lost: one of these.
WORDS: dict[str, tuple[str, ...]] = {
    "origin.source": ("the origin of the recording",),
    "sensor.array": ("the sensor", "the name of the sensor", "the names of the taxels"),
    "sensor.side": ("the side",),
    "sensor.heel": ("where the heel is",),
    "sensor.calibration": ("the calibration",),
    "settings.held": ("at the beginning",),
    "settings.registers": ("the board's registers",),
    "settings.register_changes": ("of the registers",),
    "marks.board_changes": ("of the board",),
    "marks.notes": ("note",),
    "marks.detections": ("detection",),
    "marks.zeroings": ("zeroed taxel",),
    "timing.clock": ("arrival times",),
    "timing.clock_of": ("the clock of the times",),
    "losses.counts": ("the counts of received and lost data, by cause",),
    "losses.verdict": ("the counts of received and lost data, by cause", "the summary of losses"),
    "losses.remarks": ("the remark: ",),
    "losses.truncated": ("the fact that the end of the recording is missing",),
    "losses.rebuilt": ("the remarks on reading the recording",),
    "frame_table.untimed": ("the fact that the frames have no times",),
    "frame_table.turned": ("the fact that the readings were inverted",),
    "frame_table.frame_us": ("the length of a frame that a readout assumed",),
    "stream.columns": ("the names of the columns",),
    "stream.samples": ("the lines of the stream as received",),
    "wire.datagrams": ("raw datagrams", "where datagrams begin"),
    "wire.payload": ("raw bytes",),
    "wire.differences": ("the fact that intensities are differences",),
}
#: How the bytes are encoded, which is lost with them.
OF_BYTES = {"wire.differences", "wire.version_2", "wire.origin_us", "wire.unmarked"}


def flat(source: RecordedSource) -> dict[str, Any]:
    """Return the values of all fields by section and name, each read."""
    values = {}
    for name, section in sections_of(source).items():
        for one in fields(section):
            value = getattr(section, one.name)
            values[f"{name}.{one.name}"] = value() if isinstance(value, Once) else value
    return values


def holds(value: Any) -> bool:
    """Return whether a field holds anything."""
    if isinstance(value, np.ndarray):
        return bool((value != UNKNOWN).any())
    if isinstance(value, Clock):
        return len(value.board_us) > 0
    if isinstance(value, dict):
        return any(map(holds, value.values()))
    return len(value) > 0 if isinstance(value, Sized) else bool(value)


def equal(a: Any, b: Any) -> bool:
    """Return whether two values of a field are the same."""
    if a is b:
        return True
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return a is not None and b is not None and np.array_equal(a, b)
    if isinstance(a, Calibration) and isinstance(b, Calibration):
        return a.to_json() == b.to_json()
    if isinstance(a, Clock | Datagrams | Samples):
        return type(a) is type(b) and all(equal(value, vars(b)[name]) for name, value in vars(a).items())
    return bool(a == b)


def unsaid(
    before: RecordedSource, after: RecordedSource, said: list[str] | tuple[str, ...], but: set[str]
) -> list[str]:
    """Return the fields that are neither as before nor said to be lost, nor among those that are checked elsewhere."""
    there, missing = flat(after), []
    for name, value in flat(before).items():
        if name in but or not holds(value) or (name in there and equal(value, there[name])):
            continue
        if name == "losses.remarks" and set(value) <= set(there[name]):
            continue
        # How bytes are encoded is of no use without them.
        names = ["wire.datagrams", "wire.payload"] if name in OF_BYTES else []
        words = [word for one in (name, *names) for word in WORDS.get(one, ())]
        if not any(word in line for word in words for line in said):
            missing.append(name)
    return sorted(missing)
