"""From a board's datagrams to detections, as they arrive, and the panel that shows them in a browser."""

import warnings
from typing import Any

from taxel.detections import Detection
from taxel.live.bridge import Bridge
from taxel.live.client import PanelClient
from taxel.live.live import Live, heard
from taxel.live.panel import Panel
from taxel.live.remote import Remote
from taxel.live.sending import PORT, send
from taxel.live.source import Source
from taxel.live.summary import Summary
from taxel.live.summary import delays as delays
from taxel.live.viewer import Viewer, Viewing

__all__ = [
    "PORT",
    "Bridge",
    "Live",
    "Panel",
    "PanelClient",
    "Remote",
    "Source",
    "Summary",
    "Viewer",
    "Viewing",
    "heard",
    "send",
]


def __getattr__(name: str) -> Any:
    """Return what had another name until version 0.1."""
    if name == "Said":
        warnings.warn("taxel.live.Said is taxel.Detection now", DeprecationWarning, stacklevel=2)  # noqa: TID251  a fixed text
        return Detection
    raise AttributeError(f"module 'taxel.live' has no attribute {name!r}")
