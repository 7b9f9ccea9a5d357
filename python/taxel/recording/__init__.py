"""Recordings: functions that open, cut, merge and convert them, and convert their times to another clock."""

from taxel.clock import Clock
from taxel.reading import ENDINGS, BoardChange, Datagrams, Zeroing, kind_of_file
from taxel.recording.analysis.health import Health, health
from taxel.recording.convert import convert
from taxel.recording.cut import cut
from taxel.recording.merge import merge
from taxel.recording.opening import open_all, open_one
from taxel.recording.recording import Recording
from taxel.verdict import Verdict

__all__ = [
    "ENDINGS",
    "BoardChange",
    "Clock",
    "Datagrams",
    "Health",
    "Recording",
    "Verdict",
    "Zeroing",
    "convert",
    "cut",
    "health",
    "kind_of_file",
    "merge",
    "open_all",
    "open_one",
]
