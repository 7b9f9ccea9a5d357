"""What Rerun and Foxglove have in common: the interface of a viewer in another program, and the table of the kinds."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any, Protocol

from taxel.live.client import Item, Subject


class Disconnected(Exception):  # noqa: N818  an expected event, not an error
    """The viewer does not run any more."""


class ExternalViewer(Protocol):
    """A viewer in another program."""

    @property
    def place(self) -> str:
        """The viewer's address as text."""

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
        """Wait until the viewer has read everything; raises `Disconnected` if it does not run any more."""


@dataclass(frozen=True)
class ViewerKind:
    """A kind of viewer: its class, the modules that it needs, its default port, and whether a host may be named."""

    module: str
    name: str
    needs: tuple[str, ...]
    port: int
    has_host: bool

    def open(self, host: str, port: int) -> ExternalViewer:
        """Connect to a viewer, or open the port that viewers connect to."""
        # The modules of extras are imported only when they are used.
        kind: Any = getattr(importlib.import_module(self.module), self.name)
        viewer: ExternalViewer = kind(host, port) if self.has_host else kind(port)
        return viewer


#: The kinds by the name that `to` has.
KINDS = {
    "rerun": ViewerKind("taxel.live._to_rerun", "ToRerun", ("rerun", "websockets"), 9876, has_host=True),
    "foxglove": ViewerKind("taxel.live._to_foxglove", "ToFoxglove", ("foxglove", "websockets"), 8765, has_host=False),
}
