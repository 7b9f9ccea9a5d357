"""Detections of a `Live`, with the time of their output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel._base.arguments import instance, several
from taxel.detections import Detection, Detections

__all__ = ["heard"]


def heard(said: Sequence[Detection]) -> Detections:
    """Return detections of a `Live` as columns.

    Parameters
    ----------
    said : sequence of Detection

    Returns
    -------
    Detections

    Raises
    ------
    ProblemError : something that is no detection

    Examples
    --------
    >>> heard([Detection("contact", 1000, 1344)])
    Detections(1: contact 1; 1000 to 1000 us)
    """
    detections = [instance("said", one, Detection) for one in several("said", said)]
    times = [one.said for one in detections]
    reported: Any = None if None in times else times
    return Detections._of(
        [one.label for one in detections],
        [one.t for one in detections],
        [one.known for one in detections],
        [one.slope for one in detections],
        reported,
        [one.repaired for one in detections],
    )
