"""Events or frames to spikes, live or whole: the same spikes either way."""

from taxel.encode._encoder import Encoder, EncoderStream
from taxel.encode.change_events import ChangeEvents
from taxel.encode.contact_area import ContactArea
from taxel.encode.fa1 import FA1
from taxel.encode.level_crossing import LevelCrossing, RunningRange
from taxel.encode.moments import Moments
from taxel.encode.threshold_izhikevich import ThresholdIzhikevich

__all__ = [
    "FA1",
    "ChangeEvents",
    "ContactArea",
    "Encoder",
    "EncoderStream",
    "LevelCrossing",
    "Moments",
    "RunningRange",
    "ThresholdIzhikevich",
]
