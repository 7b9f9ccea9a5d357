"""From a board's datagrams to detections, as they arrive."""

from taxel.live.live import Live
from taxel.live.sending import PORT, send
from taxel.live.summary import Summary
from taxel.live.summary import delays as delays

__all__ = [
    "PORT",
    "Live",
    "Summary",
    "send",
]
