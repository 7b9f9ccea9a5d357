"""Touch as events: from the bytes of a tactile array to decisions that say when."""

from taxel import detect, metrics
from taxel import encode, metrics
from taxel import detect, device, metrics, wire
from taxel import detect, encode, metrics
from taxel import detect, encode, metrics
from taxel._convert import convert
from taxel._core import DeviceError, Error, FormatError, ProblemError, SceneError
from taxel._health import Health, health
from taxel.array import Array
from taxel.detect import Readout
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.neuron import Neuron
from taxel.recording import Clock, Datagrams, Note, Recording
from taxel.recording import open_recording as open  # noqa: A004  taxel.open is a recording's
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

__version__ = "0.1.0"

__all__ = [
    "Array",
    "Clock",
    "Datagrams",
    "Detections",
    "DeviceError",
    "Error",
    "Events",
    "FormatError",
    "Frames",
    "Health",
    "Neuron",
    "Note",
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
    "Recording",
    "SceneError",
    "SpikeTrains",
    "Tare",
    "convert",
    "detect",
    "encode",
    "health",
    "metrics",
    "open",
]
