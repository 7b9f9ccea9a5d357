"""Detections of a `Live`, with the time of their output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from taxel.detections import Detections

__all__ = ["Said", "heard"]


class Said(NamedTuple):
    """Hold a detection and its times, all but the last in us of the board's clock.

    Parameters
    ----------
    label : str
        The name of the neuron.
    t : int, us
        Time of the event: the crossing minus the encoder's latency and the trained delay.
    known : int, us
        When it could first be detected: the end of the board's frame in which the potential crosses.
    slope : float, mV/ms
        How steeply the potential crossed its threshold, as a measure of how sure.
    said : int, us
        When it was output, by the host's clock minus the estimated offset between the clocks.
    said_ns : int, ns since 1970
        The same by the host's clock.
    repaired : bool
        Whether it may depend on values that states of wire version 2 repaired after a loss.

    Examples
    --------
    >>> Said("contact", 1000, 1192, 2.5, 1400, 1_700_000_000_000_000_000).label
    'contact'
    """

    label: str
    t: int
    known: int
    slope: float
    said: int
    said_ns: int
    repaired: bool = False


def heard(said: Sequence[Said]) -> Detections:
    """Return detections of a `Live` as `Detections`.

    Parameters
    ----------
    said : sequence of Said
        The detections.

    Examples
    --------
    >>> heard([Said("contact", 1000, 1192, 2.5, 1400, 1_700_000_000_000_000_000)]).t
    array([1000])
    """
    return Detections._of(
        [s.label for s in said],
        [s.t for s in said],
        [s.known for s in said],
        [s.slope for s in said],
        [s.said for s in said],
        [s.repaired for s in said],
    )
