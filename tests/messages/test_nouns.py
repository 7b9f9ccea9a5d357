"""What arrays, events, frames, spike trains, labels, tares, calibrations and detections say that is wrong."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from refusal import messages

import taxel
from taxel import Array, Calibration, Detections, Events, Frames, Labels, Load, SpikeTrains, Tare
from taxel._base.errors import helped

ARRAY = Array(2, 2)
TRAINS = SpikeTrains.from_lists([[1.0, 2.0], []], stop=5.0)


def still(value: float = 1.0) -> Frames:
    return Frames(np.full((1, 2, 2), value), [0], array=ARRAY, unit="counts")


def of_text(read: Callable[[Path], object], name: str, text: str) -> Callable[[Path], object]:
    """Return the call that reads a file of this text."""

    def call(folder: Path) -> object:
        file = folder / name
        file.write_text(text)
        return read(file)

    return call


CALLS: dict[str, Callable[[Path], object]] = {
    "remedy": lambda _: helped(taxel.ProblemError("text"), "tare", "pray"),
    "rows": lambda _: Array(0, 5),
    "pitch": lambda _: Array(5, 5, -1.0),
    "exists": lambda _: Array(5, 5, 1.0, np.ones((4, 5), bool)),
    "pitch unknown": lambda _: Array(2, 2, name="mat").row_mm,
    "whole times": lambda _: Events([0.5], [0], [0], [1], array=ARRAY),
    "outside the array": lambda _: Events([0], [2], [0], [1], array=ARRAY),
    "entries": lambda _: Events([0, 1], [0], [0], [1], array=ARRAY),
    "sign": lambda _: Events([0], [0], [0], [2], array=ARRAY),
    "no array": lambda _: Events([0], [0], [0], [1], array=None),
    "times of frames": lambda _: Frames(np.zeros((2, 2, 2)), [5, 5]),
    "shape of frames": lambda _: Frames(np.zeros((2, 2)), [0, 1]),
    "unit": lambda _: Frames(np.zeros((1, 2, 2)), [0], unit=""),
    "window": lambda _: SpikeTrains.from_lists([[7.0]], stop=5.0),
    "order of spikes": lambda _: SpikeTrains.from_lists([[2.0, 1.0]]),
    "graded values": lambda _: SpikeTrains.from_lists([[1.0]], values=[[0.0]], kind="graded"),
    "train": lambda _: TRAINS.select([2]),
    "merge": lambda _: TRAINS + SpikeTrains.from_lists([[1.0]], values=[[1.0]]),
    "no spike trains": of_text(SpikeTrains.load, "a.npz", "nonsense"),
    "no JSON": of_text(Tare.load, "tare.json", "{\n1}"),
    "no tare": lambda _: Tare.from_json("{}"),
    "tare of other taxels": lambda _: Tare.take(Frames(np.ones((2, 3, 3)), [0, 1])).off(still()),
    "no calibration": of_text(Calibration.load, "a.calibration.json", "{}"),
    "no load": lambda _: Calibration.fit([]),
    "load": lambda _: Calibration.fit([Load(still(), -1.0)]),
    "unit of a load": lambda _: Calibration.fit([Load(still(), 1.0, "kg")]),
    "readings": lambda _: Calibration.table(ARRAY, [1.0, 1.0], [1.0, 2.0], unit="N"),
    "label times": of_text(Labels, "labels.csv", "label,t_us\na,soon\n"),
    "label column": of_text(Labels, "labels.csv", "label,host_ns\na,5\n"),
    "label twice": of_text(Labels, "labels.csv", "label,t_us,t_us\na,5,5\n"),
    "label unit": of_text(Labels, "labels.csv", "time,event\n250,auf\n"),
    "detections": of_text(Detections.from_csv, "found.csv", "label,t_us\n"),
}


def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
