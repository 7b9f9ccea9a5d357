"""What Rerun and Foxglove have in common: the interface of a viewer in another program."""

from __future__ import annotations

from typing import Protocol

from taxel.live.client import Item, Subject

__all__ = ["Disconnected", "ExternalViewer"]


class Disconnected(Exception):  # noqa: N818  an expected event, not an error
    """The viewer does not run any more."""


class ExternalViewer(Protocol):
    """A viewer in another program."""

    @property
    def place(self) -> str:
        """Where it is, in words."""

    @property
    def why_not_connected(self) -> str:
        """Why no viewer is connected."""

    def is_connected(self) -> bool:
        """Return whether a viewer is connected."""

    def begin(self, subject: Subject) -> None:
        """Show another subject from now on."""

    def show(self, subject: Subject, item: Item) -> None:
        """Show the next item. May wait for a viewer that reads slowly."""

    def flush(self) -> None:
        """Wait until the viewer has read everything; raises `Disconnected` where it does not run any more."""
