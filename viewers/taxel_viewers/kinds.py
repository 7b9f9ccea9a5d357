"""What Rerun and Foxglove have in common: the interface of a viewer in another program, and the table of the kinds."""

from __future__ import annotations

import importlib
import importlib.util
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from taxel import ProblemError
from taxel.live.client import Item, Subject

__all__ = ["KINDS", "Disconnected", "ExternalViewer", "ViewerKind", "viewer_at"]

_MOST_PORT = 65_535


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

    def close(self) -> bool:
        """End a `flush` that waits; return whether the viewer reads, so that its library can end too."""


@dataclass(frozen=True)
class ViewerKind:
    """A kind of viewer: its class, its default port, and whether a host may be named."""

    module: str
    name: str
    port: int
    has_host: bool


#: The kinds by the name that is typed, which is that of the extra and of the module that it brings as well.
KINDS = {
    "rerun": ViewerKind("taxel_viewers.to_rerun", "ToRerun", 9876, has_host=True),
    "foxglove": ViewerKind("taxel_viewers.to_foxglove", "ToFoxglove", 8765, has_host=False),
}


def viewer_at(to: str) -> Callable[[], ExternalViewer]:
    """Return what connects to the viewer that `to` names, or opens the port that viewers connect to.

    Raises
    ------
    ImportError : the viewer's library is not installed
    ProblemError : `to` names no viewer
    """
    address = re.sub(r"^rerun\+http://([^/]+)/proxy$", r"rerun:\1", str(to))
    found = re.fullmatch(r"(\w+)(?::(?:(.+):)?([0-9]{1,5}))?", address)
    kind = KINDS.get(found[1]) if found else None
    if found is None or kind is None or (found[3] and (bool(found[2]) != kind.has_host or int(found[3]) > _MOST_PORT)):
        forms = [form for name, k in KINDS.items() for form in (name, f"{name}:{'HOST:' * k.has_host}PORT")]
        raise ProblemError(f"to is {to!r}: must be {', '.join(forms[:-1])} or {forms[-1]}")
    if importlib.util.find_spec(found[1]) is None:
        raise ImportError(f"{found[1]} is not installed: pip install 'taxel[{found[1]}]'")
    host, port = found[2] or "127.0.0.1", int(found[3] or kind.port)
    # The modules of extras are imported only when they are used.
    viewer: Any = getattr(importlib.import_module(kind.module), kind.name)
    return partial(viewer, host, port) if kind.has_host else partial(viewer, port)
