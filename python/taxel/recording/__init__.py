"""Recordings: opened, cut, merged, put on a clock, converted."""

from taxel.recording.convert import convert
from taxel.recording.health import Health, health
from taxel.recording.opening import open_any
from taxel.recording.parts import cut, merge
from taxel.recording.recording import (
    ENDINGS,
    BoardChange,
    Clock,
    Datagrams,
    Note,
    Recording,
    Zeroing,
    in_memory,
    kind_of_file,
    open_recording,
)

__all__ = [
    "ENDINGS",
    "BoardChange",
    "Clock",
    "Datagrams",
    "Health",
    "Note",
    "Recording",
    "Zeroing",
    "convert",
    "cut",
    "health",
    "in_memory",
    "kind_of_file",
    "merge",
    "open_any",
    "open_recording",
]
