"""Encoders: events or frames to spikes, with the same result for a stream as for a whole recording."""

from taxel.encode._composite import Composite as Composite
from taxel.encode._encoder import Encoder as Encoder
from taxel.encode._encoder import EncoderStream as EncoderStream
from taxel.encode.change_events import ChangeEvents as ChangeEvents
from taxel.encode.contact_area import ContactArea as ContactArea
from taxel.encode.fa1 import FA1 as FA1
from taxel.encode.fa2 import FA2 as FA2
from taxel.encode.level_crossing import LevelCrossing as LevelCrossing
from taxel.encode.level_crossing import RunningRange as RunningRange
from taxel.encode.local_load import LocalLoad as LocalLoad
from taxel.encode.moments import Moments as Moments
from taxel.encode.peak import Peak as Peak
from taxel.encode.sa1 import SA1 as SA1
from taxel.encode.sa2 import SA2 as SA2
from taxel.encode.threshold_izhikevich import ThresholdIzhikevich as ThresholdIzhikevich

# The imports above are the registry of encoders.
__all__ = [name for name, kind in sorted(globals().items()) if isinstance(kind, type)]
