"""A client of the panel: what it is shown, and what it is sent."""

from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, Any

from msgspec.json import encode
from websockets.exceptions import ConnectionClosed

from taxel import _core
from taxel.panel.folder import Shown
from taxel.panel.threads import in_thread

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

#: A client that leaves as many bytes unread is disconnected.
_MOST_WAITING = 1 << 21


class Client:
    """A view of a live source or a recording, behind a web socket.

    Parameters
    ----------
    connection : ServerConnection
    live : PanelLive or None
        The live source that is followed at first.
    """

    def __init__(self, connection: ServerConnection, live: _core.PanelLive | None) -> None:
        self._connection, self.view = connection, _core.PanelView(live)
        #: The live source that is shown while no recording is.
        self.follows = live
        #: The recording that is shown; None: the live source.
        self.shown: Shown | None = None
        #: Frames that may be sent; none while a request is answered, so that a frame shows what was answered before it.
        self.credits, self.answers = 0, False
        self._advancing: asyncio.Task[None] | None = None

    async def say(self, message: dict[str, Any] | str) -> None:
        """Send a message; a client that does not read is disconnected, and one that has left is no error."""
        if self.is_behind(_MOST_WAITING):
            return self._connection.transport.abort()
        text = message if isinstance(message, str) else encode(message).decode()
        with contextlib.suppress(ConnectionClosed):
            await self._connection.send(text)
        return None

    def is_behind(self, bytes_: int = 0) -> bool:
        """Return whether more bytes than this wait for the client."""
        return self._connection.transport.get_write_buffer_size() > bytes_

    def follow(self, live: _core.PanelLive | None) -> None:
        """Show another live source, or the one there is no more."""
        self.follows = live
        self.view.set_live(live)

    async def send_frame(self) -> None:
        """Send a frame, if there is a new one and the client may get one; what takes long is done in another thread."""
        if not self.credits or self.answers or self.is_behind():
            return
        made = self.view.frame()
        if made is not None:
            frame, texts = made
            self.credits -= 1
            with contextlib.suppress(ConnectionClosed):
                await self._connection.send(frame)
            for text in texts:
                await self.say(text)
        if self.view.moves() and self._advancing is None:
            self._advancing = asyncio.create_task(self._advance())

    async def _advance(self) -> None:
        try:
            if await in_thread(self.view.advance):
                await self.say_transport()
        finally:
            self._advancing = None

    async def say_transport(self) -> None:
        """Say what the view shows, and whether it moves."""
        state, speed, t_us = self.view.transport()
        source = None if self.shown is None else self.shown.name
        await self.say({"type": "transport", "source": source, "state": state, "speed": speed, "t_us": t_us})
