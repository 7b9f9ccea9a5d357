"""Detections as they come, with the time at which each was reported."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.detections import Detection, Detections

__all__ = ["heard"]


def heard(said: Sequence[Detection]) -> Detections:
    """Return detections of a `Live` as `Detections`."""
    reported: Any = [one.said for one in said]
    return Detections._of(
        [one.label for one in said],
        [one.t for one in said],
        [one.known for one in said],
        [one.slope for one in said],
        reported,
        [one.repaired for one in said],
    )
