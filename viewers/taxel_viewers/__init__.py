"""Recordings and running sensors in Rerun."""

from taxel_viewers.rerun import Viewer

__all__ = ["Viewer"]
