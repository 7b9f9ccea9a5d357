"""The tasks of a user as functions: recordings, labels and options in, a result out.

Each task takes opened recordings and a frozen dataclass of options, reports its progress by one callback (step, done,
all), and returns a frozen result with `to_dict()` and `warnings`. No task writes a file; what a result holds is saved
by its own methods. The command line and the page call these functions.
"""

from taxel._base.parallel import Workers as Workers
from taxel.options import CalibrateOptions as CalibrateOptions
from taxel.options import DetectOptions as DetectOptions
from taxel.options import EncodeOptions as EncodeOptions
from taxel.options import InformationOptions as InformationOptions
from taxel.options import TrainOptions as TrainOptions
from taxel.recording.analysis.rest import Rest as Rest
from taxel.recording.analysis.rest import rest as rest
from taxel.tasks.calibrate import Calibrated as Calibrated
from taxel.tasks.calibrate import KnownLoad as KnownLoad
from taxel.tasks.calibrate import calibrate as calibrate
from taxel.tasks.calibrate import read_loads as read_loads
from taxel.tasks.detect import Detected as Detected
from taxel.tasks.detect import Detecting as Detecting
from taxel.tasks.detect import detect as detect
from taxel.tasks.encode import Encoded as Encoded
from taxel.tasks.encode import encode as encode
from taxel.tasks.info import Info as Info
from taxel.tasks.info import info as info
from taxel.tasks.information import Information as Information
from taxel.tasks.information import information as information
from taxel.tasks.train import train as train
from taxel.tasks.train_result import Training as Training

# The imports above say what is public.
__all__ = [name for name, value in sorted(globals().items()) if callable(value)]
