"""Touch as events: from the bytes of a tactile array to detections with the time of each."""

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from taxel._base.drawing import draw_by
from taxel._core import DeviceError, Error, FormatError, NotFittedError, ProblemError, SceneError
from taxel.array import Array, Places
from taxel.calibration import Calibration, Load
from taxel.clock import Clock
from taxel.detections import Detection, Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.labels import Labels, Note
from taxel.neuron import Neuron
from taxel.regions import Axis, Region, axis, read_regions, write_regions
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

if TYPE_CHECKING:
    from taxel import (
        board_check,
        detect,
        device,
        encode,
        formats,
        information,
        learn,
        live,
        metrics,
        panel,
        plot,
        simulate,
        tasks,
        wire,
    )
    from taxel.detect import Readout
    from taxel.recording import BoardChange, Datagrams, Recording, Verdict, Zeroing, open_all
    from taxel.recording import open_one as open  # noqa: A004  taxel.open is a recording's
    from taxel.recording.analysis.health import Health, health
    from taxel.recording.convert import convert
    from taxel.recording.cut import cut
    from taxel.recording.merge import merge
    from taxel.tasks.train import train

__all__ = [
    "Array",
    "Axis",
    "BoardChange",
    "Calibration",
    "Clock",
    "Datagrams",
    "Detection",
    "Detections",
    "DeviceError",
    "Error",
    "Events",
    "FormatError",
    "Frames",
    "Health",
    "Labels",
    "Load",
    "Neuron",
    "NotFittedError",
    "Note",
    "Places",
    "ProblemError",
    "Readout",
    "Recording",
    "Region",
    "SceneError",
    "SpikeTrains",
    "Tare",
    "Verdict",
    "Zeroing",
    "axis",
    "board_check",
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
    "open_all",
    "panel",
    "plot",
    "read_regions",
    "simulate",
    "tasks",
    "train",
    "wire",
    "write_regions",
]


#: Where those names of a package are that are not loaded yet and have not the same name in `taxel.recording`.
_ELSEWHERE = {
    "open": ("taxel.recording", "open_one"), "Readout": ("taxel.detect", "Readout"), "train": ("taxel.tasks", "train")
}  # fmt: skip


# A noun's `plot` loads the plots, and matplotlib with them, when it is first called.
draw_by(lambda: import_module("taxel.plot"))


def __getattr__(name: str) -> Any:
    """Import a subpackage, or a name from one, at its first access, so that ``import taxel`` is quick."""
    if name == "__version__":
        return import_module("importlib.metadata").version("taxel")
    if find_spec(f"taxel.{name}") is not None:
        return import_module(f"taxel.{name}")
    if name in __all__:
        module, inside = _ELSEWHERE.get(name, ("taxel.recording", name))
        value = getattr(import_module(module), inside)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'taxel' has no attribute {name!r}")


def __dir__() -> list[str]:
    """List the public names, those not loaded yet among them."""
    return sorted({*globals(), *__all__})
