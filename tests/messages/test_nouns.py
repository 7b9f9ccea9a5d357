"""What arrays, events, frames, spike trains, labels, tares, calibrations and detections say that is wrong."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from refusal import messages

import taxel
from taxel import Array, Calibration, Detections, Events, Frames, Labels, Load, Places, Region, SpikeTrains, Tare

ARRAY = Array(2, 2)
TRAINS = SpikeTrains.from_lists([[1.0, 2.0], []], stop=5.0)
TARE = Tare.take(Frames(np.ones((2, 2, 2)), [0, 1])).to_json()


def still(value: float = 1.0) -> Frames:
    return Frames(np.full((1, 2, 2), value), [0], array=ARRAY, unit="counts")


def of_text(read: Callable[[Path], object], name: str, text: str) -> Callable[[Path], object]:
    """Return the call that reads a file of this text."""

    def call(folder: Path) -> object:
        file = folder / name
        file.write_text(text)
        return read(file)

    return call


#: Columns of two events of which one entry, or their number, cannot be.
COLUMNS: list[tuple[str, Any]] = [
    ("t", [0, 0.5]), ("t", [0, np.nan]), ("t", [[0, 5]]), ("x", [1, -2]), ("x", [1, 12]), ("x", [1, 2.5]),
    ("y", [3, 8]), ("y", [3, 4, 5]), ("p", [2, 0]), ("p", [0.5, 0]), ("p", [True]), ("intensity", [1]),
    ("intensity", [1, -1]), ("intensity", [1, 65_536]), ("present", [True, False]), ("markers", [3]),
    ("markers", [(0.5, True)]),
]  # fmt: skip
EVENTS: dict[str, Any] = {"t": [0, 5], "x": [1, 2], "y": [3, 4], "p": [True, False], "array": Array(8, 12)}
FRAMES: list[dict[str, Any]] = [{"t": [0]}, {"t": [5, 3]}, {"t": [0, 0.5]}, {"t": [0, np.nan]}, {"array": Array(9, 9)}]
#: Lists of spikes, begin, end and values that cannot be those of trains.
LISTS: list[tuple[Any, ...]] = [
    ([[1.0, np.nan]],), ([[1.0], [np.inf]],), ([[5.0]], 6.0), ([[5.0]], 0.0, 4.0), ([[5.0]], 0.0, np.nan),
    ([[5.0]], -np.inf, 9.0), ([["a"]],), ([[[1.0, 2.0]]],), ([[1.0]], 0.0, 2.0, [[1.0, 2.0]]),
]  # fmt: skip
OFFSETS: list[list[int]] = [[0, 2, 1], [1, 2], [0, 3], [], [0, -1, 2]]
#: Values of two spikes that are not those of their kind.
VALUES: list[tuple[Any, str]] = [
    ([1.0, np.nan], "graded"), ([1e39, 1.0], "graded"), ([1.0, -0.0], "graded"), ([1.0, 1e-60], "graded"),
    ([1.0], "graded"), (None, "graded"), (None, "signed"), ([1.0, 1.0], "unsigned"), ([1.0, 1.0], "loud"),
]  # fmt: skip
#: Pieces and places that a noun does not have.
PLACES: dict[str, Callable[[], object]] = {
    "events, between": lambda: Events(**EVENTS).between(2, 1),
    "events, region": lambda: Events(**EVENTS).region(slice(0, 8, 2), slice(2)),
    "events, place": lambda: Events(**EVENTS)[[0, 9]],
    "events, mask": lambda: Events(**EVENTS)[np.array([True])],
    "frames of events, period": lambda: Frames.from_events(Events(**EVENTS), 0),
    "frames of events, number": lambda: Frames.from_events(Events(**EVENTS, intensity=[1, 2]), 1, 0, 10**15),
    "frames of events, values": lambda: Frames.from_events(Events(**EVENTS), 100),
    "frames, backwards": lambda: Frames(np.zeros((2, 2, 2)), [0, 1])[::-1],
    "frames, two at a time": lambda: Frames._joined([still(), still()]),
    "frames, region": lambda: still().region(slice(1, 1), slice(None)),
    "region, nothing": lambda: Region("a"),
    "region, no name": lambda: Region("", taxels=((0, 0),)),
    "region, corners": lambda: Region("a", ((0, 0), (1, 1))),
    "region, pairs": lambda: Region("a", ((0, 0, 1), (1, 1, 1))),
    "region, crossing": lambda: Region("a", ((0, 0), (9, 9), (9, 0), (0, 9))),
    "region, off": lambda: Region.rectangle("a", 9, 9, 12, 12, "taxels").shares(ARRAY),
    "region, taxel": lambda: Region("a", taxels=((0, 5),)).shares(ARRAY),
    "region, unit": lambda: Region.rectangle("a", 0, 0, 1, 1).shares(ARRAY),
    "region, channels": lambda: Region.rectangle("a", 0, 0, 1, 1).shares(Array(1, 8)),
    "axis": lambda: taxel.axis([[0, 1], [0, 1]], ARRAY),
    "trains, between": lambda: TRAINS.between(3, 2),
    "trains, place": lambda: TRAINS.select([-3]),
    "trains, no delay": lambda: TRAINS.delayed([]),
    "trains, delays": lambda: TRAINS.delayed([1.0, 1.0]),
    "centre": lambda: still().centre(-1),
}
CALLS: dict[str, Callable[[Path], object]] = {
    **{f"events, {name} {value}": lambda _, c={name: value}: Events(**EVENTS | c) for name, value in COLUMNS},
    **{f"frames, {c}": lambda _, c=c: Frames(**{"values": np.zeros((2, 2, 3)), "t": [0, 1]} | c) for c in FRAMES},
    **{f"trains, {arguments}": lambda _, a=arguments: SpikeTrains.from_lists(*a) for arguments in LISTS},
    **{f"offsets, {offsets}": lambda _, o=offsets: SpikeTrains([1.0, 2.0], o, 0.0, 5.0) for offsets in OFFSETS},
    **{f"{k} {v}": lambda _, v=v, k=k: SpikeTrains([1.0, 2.0], [0, 2], 0.0, 5.0, v, kind=k) for v, k in VALUES},
    **{name: lambda _, call=call: call() for name, call in PLACES.items()},
    "rows": lambda _: Array(0, 5),
    "columns": lambda _: Array(5, 65_536),
    "pitch": lambda _: Array(5, 5, -1.0),
    "exists": lambda _: Array(5, 5, 1.0, np.ones((4, 5), bool)),
    "pitch unknown": lambda _: Array(2, 2, name="mat").row_mm,
    "no array": lambda _: Events([0], [0], [0], [1], array=None),
    "times of frames": lambda _: Frames(np.zeros((2, 2, 2)), [5, 5]),
    "shape of frames": lambda _: Frames(np.zeros((2, 2)), [0, 1]),
    "unit": lambda _: Frames(np.zeros((1, 2, 2)), [0], unit=""),
    "order of spikes": lambda _: SpikeTrains.from_lists([[2.0, 1.0]]),
    "train": lambda _: TRAINS.select([2]),
    "no spike trains": of_text(SpikeTrains.load, "a.npz", "nonsense"),
    "no JSON": of_text(Tare.load, "tare.json", "{\n1}"),
    "no tare": lambda _: Tare.from_json("{}"),
    "tare of nothing": lambda _: Tare.take(still()),
    "stretch of a tare": lambda _: Tare.take(Frames(np.ones((2, 2, 2)), [0, 1]), start_us=900, stop_us=900),
    "missing in a tare": lambda _: Tare.take(Frames(np.full((2, 1, 1), np.nan), [0, 1])),
    "noise of a tare": lambda _: Tare.from_json(TARE.replace('"noise":[0.0', '"noise":[-1.0')),
    "rests of a tare": lambda _: Tare.from_json(TARE.replace('"rest":[1.0', '"rest":[1.0,1.0')),
    "tare of other taxels": lambda _: Tare.take(Frames(np.ones((2, 3, 3)), [0, 1])).off(still()),
    "no calibration": of_text(Calibration.load, "a.calibration.json", "{}"),
    "no load": lambda _: Calibration.fit([]),
    "no reading": lambda _: Calibration.fit([Load(still(0.0), 1.0)]),
    "place of a load": lambda _: Calibration.fit([Load(still(), 1.0, "N", (9, 0))]),
    "loads of each": lambda _: Calibration.fit([Load(still(), 1.0)], each=True),
    "first reading": lambda _: Calibration.table(ARRAY, [0.0, 1.0], [1.0, 2.0], unit="N"),
    "unit of a table": lambda _: Calibration.table(ARRAY, [1.0], [1.0], unit="bar"),
    "date": lambda _: Calibration.table(ARRAY, [1.0], [1.0], unit="N", date="yesterday"),
    "rest": lambda _: Calibration.table(ARRAY, [1.0], [1.0], unit="N", rest=[[1.0]]),
    "load": lambda _: Calibration.fit([Load(still(), -1.0)]),
    "pitch and places": lambda _: Array(1, 2, 1.0, places=Places([0, 1], [0, 0])),
    "places of other taxels": lambda _: Array(2, 2, places=Places([0, 1, 2], [0, 1, 2])),
    "lengths of places": lambda _: Places([0, 1, 2], [0, 1, 2, 3]),
    "unit of places": lambda _: Places([0, 1], [0, 0], unit="inch"),
    "place missing": lambda _: Array(1, 2, places=Places([0, np.nan], [0, 0])),
    "area of a place": lambda _: Array(1, 2, places=Places([0, 1], [0, 0], [1.0, 0.0])),
    "unit of a load": lambda _: Calibration.fit([Load(still(), 1.0, "kg")]),
    "readings": lambda _: Calibration.table(ARRAY, [1.0, 1.0], [1.0, 2.0], unit="N"),
    "label times": of_text(Labels, "labels.csv", "label,t_us\na,soon\n"),
    "label column": of_text(Labels, "labels.csv", "label,host_ns\na,5\n"),
    "label twice": of_text(Labels, "labels.csv", "label,t_us,t_us\na,5,5\n"),
    "label unit": of_text(Labels, "labels.csv", "time,event\n250,auf\n"),
    "entries of detections": lambda _: Detections(["a"], [1], [1, 2]),
    "detections with one slope": lambda _: Detections(["a"], [1], [1], [0.5, 0.5]),
    "detections": of_text(Detections.from_csv, "found.csv", "label,t_us\n"),
}


def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
