"""From a board's datagrams to detections, while they come, and what a browser is shown of them."""

from taxel.live.panel import Panel
from taxel.live.way import PORT, Live, Said, Summary, delays, heard, send

__all__ = ["PORT", "Live", "Panel", "Said", "Summary", "delays", "heard", "send"]
