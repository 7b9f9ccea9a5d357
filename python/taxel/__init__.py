"""Touch as events: from the bytes of a tactile array to decisions that say when."""

from taxel import detect, metrics
from taxel import encode, metrics
from taxel import detect, device, metrics, wire
from taxel import detect, encode, metrics
from taxel._core import DeviceError, Error, FormatError, ProblemError, SceneError
from taxel.array import Array
from taxel.detect import Readout
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

__version__ = "0.1.0"

__all__ = [
    "Array",
    "Detections",
    "DeviceError",
    "Error",
    "Events",
    "FormatError",
    "Frames",
    "Neuron",
    "ProblemError",
    "Readout",
    "SceneError",
    "SpikeTrains",
    "Tare",
    "detect",
    "encode",
    "device",
    "metrics",
    "wire",
]
