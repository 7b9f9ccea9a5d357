"""What sound calls are made of, and how a sound call is written down."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

import taxel

ARRAY = taxel.Array(4, 4, pitch_mm=2.0, name="small")
EVENTS = taxel.Events(
    [0, 200, 400], [0, 1, 2], [0, 1, 2], [True, False, True], array=ARRAY, intensity=[9, 8, 7], markers=[(0, True)]
)
FRAMES = taxel.Frames(np.ones((3, 4, 4)), [0, 192, 384], array=ARRAY)
TRAINS = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0, [[1.0, -1.0], [1.0]])
UNSIGNED = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0)
FOUND = taxel.Detections(["a", "b"], [10, 20], [11, 22], [0.5, 0.5])
TARE = taxel.Tare.take(FRAMES)
TICKS = taxel.Calibration.table(ARRAY, [5.0, 50.0], [1.0, 9.0], unit="N", reading_unit="ticks")
LEVELS = taxel.encode.LevelCrossing([0.5])
PLAIN = TRAINS.split_by_sign()
REGISTERS = taxel.wire.Registers()
BYTES = taxel.wire.encode(EVENTS)
Sound = Callable[[], tuple[Callable[..., Any], dict[str, Any]]]


def method(instance: Any, name: str, /, **arguments: Any) -> Sound:
    """A call of a method of something that calls do not change."""
    return lambda: (getattr(instance, name), arguments)


def fresh(make: Callable[[], Any], name: str, /, **arguments: Any) -> Sound:
    """A call of a method of something that each call gets anew."""
    return lambda: (getattr(make(), name), arguments)


def plain(function: Callable[..., Any], /, **arguments: Any) -> Sound:
    return lambda: (function, arguments)


def every(function: Callable[..., Iterator[Any]], **arguments: Any) -> Sound:
    """A call of a function that gives one thing after the other."""
    return lambda: (lambda **given: list(function(**given)), arguments)
