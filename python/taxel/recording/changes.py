"""Changes of the sensor while recording: zeroed taxels, changes of the board."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Zeroing:
    """Hold that a person zeroed a taxel: its held value becomes its rest.

    Parameters
    ----------
    t : int, us
        Time of the zeroing: after all events up to it, before later ones.
    x, y : int, taxels
        The taxel's column and row.
    rest : float, ticks
        The rest after it.
    before : float, ticks, optional
        The rest before, if it was known.

    Examples
    --------
    >>> Zeroing(5000, 3, 2, rest=120.0, before=100.0)
    Zeroing(t=5000, x=3, y=2, rest=120.0, before=100.0)
    """

    t: int
    x: int
    y: int
    rest: float
    before: float | None


@dataclass(frozen=True)
class BoardChange:
    """Hold a change of the board while recording.

    Attributes
    ----------
    t : int, us, or None
        The board's time, which continues over the change; None if it was unknown.
    at_ns : int, ns since 1970
        Time at which the change was detected.
    change : str
        "reset": the board was reset, so the values of its taxels are unknown until their next event. "wire": it
        switched to another version of the wire.
    version : int, 1 or more, or None
        The version of the wire after it.
    asked : bool
        Whether the host requested the change; otherwise it was detected in the board's datagrams.

    Examples
    --------
    >>> BoardChange(5000, 1_700_000_000_000_000_000, "reset").asked
    False
    """

    t: int | None
    at_ns: int
    change: str
    version: int | None = None
    asked: bool = False

    def _described(self) -> dict[str, Any]:
        """Return the change as files hold it, without the host's time."""
        record: dict[str, Any] = {"t_us": self.t, "change": self.change}
        if self.version is not None:
            record |= {"version": self.version, "asked": self.asked}
        return record
