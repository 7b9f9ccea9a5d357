"""Touch as events: from the bytes of a tactile array to decisions that say when."""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

from taxel import detect, device, encode, formats, information, learn, live, metrics, simulate, wire, wire_v2
from taxel._core import DeviceError, Error, FormatError, NotFittedError, ProblemError, SceneError
from taxel.array import Array
from taxel.calibration import Calibration, Load
from taxel.detect import Readout
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Label, Labels
from taxel.neuron import Neuron
from taxel.recording import BoardChange, Clock, Datagrams, Health, Note, Recording, Zeroing, convert, cut, health, merge
from taxel.recording import open_any as open  # noqa: A004  taxel.open is a recording's
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

if TYPE_CHECKING:
    from taxel import plot

__version__ = "0.1.0"

__all__ = [
    "Array",
    "BoardChange",
    "Calibration",
    "Clock",
    "Datagrams",
    "Detections",
    "DeviceError",
    "Error",
    "Events",
    "FormatError",
    "Frames",
    "Health",
    "Label",
    "Labels",
    "Load",
    "Neuron",
    "NotFittedError",
    "Note",
    "ProblemError",
    "Readout",
    "Recording",
    "SceneError",
    "SpikeTrains",
    "Tare",
    "Zeroing",
    "convert",
    "cut",
    "detect",
    "device",
    "encode",
    "formats",
    "health",
    "information",
    "learn",
    "live",
    "merge",
    "metrics",
    "open",
    "plot",
    "simulate",
    "wire",
    "wire_v2",
]


def __getattr__(name: str) -> ModuleType:
    """Load `taxel.plot` when it is first asked for: matplotlib takes longer than all else together."""
    if name == "plot":
        return import_module("taxel.plot")
    raise AttributeError(f"module 'taxel' has no attribute {name!r}")
