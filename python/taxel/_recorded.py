"""What a recording is to those below it: something that holds events or pictures."""

from __future__ import annotations

from typing import Protocol, TypeVar

from taxel.events import Events
from taxel.frames import Frames

__all__ = ["Recorded", "recorded"]

T = TypeVar("T")


class Recorded(Protocol):
    """Hold events or pictures, as `taxel.Recording` does."""

    @property
    def has_events(self) -> bool:
        """Whether it holds events (else pictures)."""
        ...

    @property
    def events(self) -> Events:
        """The changes at taxels."""
        ...

    def frames(self) -> Frames:
        """Return the pictures."""
        ...


def recorded(x: Events | Frames | Recorded | T) -> Events | Frames | T:
    """Return what a recording holds; anything else as it is."""
    if isinstance(x, type) or not all(hasattr(x, name) for name in ("has_events", "frames")):
        return x  # type: ignore[return-value]
    return x.events if x.has_events else x.frames()  # type: ignore[union-attr]
