"""Boards and recordings in other programs: Rerun and Foxglove."""

from taxel_viewers.viewer import Viewer, Viewing

__all__ = ["Viewer", "Viewing"]
