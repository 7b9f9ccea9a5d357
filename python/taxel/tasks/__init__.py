"""What a user asks for, as functions: recordings, labels and options in, a result out.

Each task takes opened recordings and a frozen dataclass of options, reports its progress by one callback (step, done,
all), and returns a frozen result with `to_dict()` and `warnings`. No task writes a file; what a result holds is saved
by its own methods. The command line and the page call these functions; ``python -m taxel.tasks NAME`` runs one in a
process of its own (`taxel.tasks.__main__`).
"""

from taxel.tasks.calibrate import Calibrated, CalibrateOptions, KnownLoad, calibrate, read_loads
from taxel.tasks.detect import Detected, Detecting, DetectOptions, detect
from taxel.tasks.encode import Encoded, EncodeOptions, encode
from taxel.tasks.info import Info, info
from taxel.tasks.information import Information, InformationOptions, information
from taxel.tasks.rest import TakenRest, rest
from taxel.tasks.train import train
from taxel.tasks.training import Training, TrainOptions

__all__ = [
    "CalibrateOptions",
    "Calibrated",
    "DetectOptions",
    "Detected",
    "Detecting",
    "EncodeOptions",
    "Encoded",
    "Info",
    "Information",
    "InformationOptions",
    "KnownLoad",
    "TakenRest",
    "TrainOptions",
    "Training",
    "calibrate",
    "detect",
    "encode",
    "info",
    "information",
    "read_loads",
    "rest",
    "train",
]
