"""Bytes to events and back: the board's wire in both versions, its commands and its registers.

Version 1 is the thesis' (Appendix 1, sections 3 to 5). Version 2 is ours, and every loss in it can be detected (docs:
*Wire version 2*).
"""

from taxel.wire.counts import Counts, Received, Status
from taxel.wire.decoder import Decoder, StreamReader, decode
from taxel.wire.encode import encode
from taxel.wire.registers import FRAME_US, PRESETS, Command, Registers, described

__all__ = [
    "FRAME_US",
    "PRESETS",
    "Command",
    "Counts",
    "Decoder",
    "Received",
    "Registers",
    "Status",
    "StreamReader",
    "decode",
    "described",
    "encode",
]
