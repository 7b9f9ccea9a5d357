"""Where a viewer is: what the ways to Rerun and to Foxglove have in common."""

from __future__ import annotations

from typing import Protocol

from taxel.live._page import Item, Subject

__all__ = ["Gone", "Sink"]


class Gone(Exception):  # noqa: N818  it is the viewer that has gone
    """A viewer is not there any more."""


class Sink(Protocol):
    """A viewer of somebody else's."""

    @property
    def place(self) -> str:
        """Where it is, in words."""

    @property
    def trouble(self) -> str:
        """Why nobody is met."""

    def meet(self) -> bool:
        """Tell whether somebody is there who looks."""

    def begin(self, subject: Subject) -> None:
        """Show something else from here on."""

    def show(self, subject: Subject, item: Item) -> None:
        """Show the next. May wait for a viewer that reads slowly."""

    def settle(self) -> None:
        """Wait until the viewer has taken it all; raises `Gone` where it is not there any more."""
