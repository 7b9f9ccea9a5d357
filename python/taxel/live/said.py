"""Detections of a `Live`, with the time of their output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.detections import Detection, Detections

__all__ = ["heard"]


def heard(said: Sequence[Detection]) -> Detections:
    """Return detections of a `Live` as `Detections`.

    Parameters
    ----------
    said : sequence of Detection
        The detections.

    Examples
    --------
    >>> heard([Detection("contact", 1000, 1192, 2.5, 1400, 1_700_000_000_000_000_000)]).t
    array([1000])
    """
    reported: Any = [one.said for one in said]
    return Detections._of(
        [one.label for one in said],
        [one.t for one in said],
        [one.known for one in said],
        [one.slope for one in said],
        reported,
        [one.repaired for one in said],
    )
