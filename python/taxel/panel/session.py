"""The session of a client: what it is told at first, and the answers to its requests."""

from __future__ import annotations

import asyncio
import json
import time
from collections import deque
from collections.abc import Coroutine
from typing import TYPE_CHECKING, Any, ClassVar

from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.panel.client import Client
from taxel.panel.declared import Request
from taxel.panel.label_file import Edit
from taxel.panel.refusals import field_of, reason

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

    from taxel.panel.hub import Hub

#: Long requests at a time, and changes of labels that can be undone.
_MOST_LONG, _MOST_CHANGES = 8, 1000

#: A client with more refused requests than the first within the second is disconnected, s.
_MOST_REFUSED, _REFUSED_WITHIN_S = 100, 10.0


class Session(Client):
    """Answer the requests of a client.

    Parameters
    ----------
    hub : Hub
        What all clients share.
    connection : ServerConnection
        The client's web socket.
    """

    #: The requests by name.
    requests: ClassVar[dict[str, Request]] = {}

    def __init__(self, hub: Hub, connection: ServerConnection) -> None:
        super().__init__(connection, hub.source)
        self._hub = hub
        self._long: set[asyncio.Task[None]] = set()
        self._refusals: deque[float] = deque()
        #: What takes the newest changes of labels back, by the recording's name.
        self._changes: deque[tuple[str, tuple[Edit, ...]]] = deque(maxlen=_MOST_CHANGES)

    async def greet(self) -> None:
        """Say what the panel shows."""
        hub = self._hub
        await hub.prepare()
        for message in (
            hub.hello(self.follows),
            hub.presets(),
            hub.registers(),
            hub.recorder.message(),
            await hub.recordings(),
            hub.zeroed(self.follows),
        ):
            await self.say(message)
        for text in [] if hub.source is None else hub.source.latest_detections():
            await self.say(text)

    # ---------------------------------------------------------------------------------------------- answering

    async def answer(self, text: str) -> bool:
        """Carry out a request; return whether the client may go on."""
        number, kind = None, ""
        try:
            number, kind, asked, keys = self._parsed(text)
            arguments = asked.read(keys)
            if asked.is_long and len(self._long) >= _MOST_LONG:
                raise ProblemError("too many requests at a time: wait for their answers")
        except Exception as error:
            await self._refuse(error, number, kind)
            return self._may_go_on()
        work = self._carry_out(asked.method(self, **arguments), number, kind)
        if asked.is_long:
            task = asyncio.create_task(work)
            self._long.add(task)
            task.add_done_callback(self._long.discard)
            self._hub.keep(task)
        else:
            self.answers = True
            await work
            self.answers = False
        return self._may_go_on()

    async def _carry_out(self, work: Coroutine[Any, Any, None], number: int | str | None, kind: str) -> None:
        try:
            await work
        except Exception as error:
            await self._refuse(error, number, kind)
        else:
            if number is not None:
                await self.say({"type": "done", "id": number})

    async def _refuse(self, error: Exception, number: int | str | None, kind: str) -> None:
        self._refusals.append(time.monotonic())
        await self.say(
            {"type": "refused", "id": number, "what": kind, "reason": reason(error), "field": field_of(error)}
        )

    def _may_go_on(self) -> bool:
        while self._refusals and self._refusals[0] < time.monotonic() - _REFUSED_WITHIN_S:
            self._refusals.popleft()
        return len(self._refusals) <= _MOST_REFUSED

    def _parsed(self, text: str) -> tuple[int | str | None, str, Request, dict[str, Any]]:
        """Return number, name and keys of a request, and how it is carried out."""
        try:
            keys = json.loads(text)
        except (ValueError, RecursionError):
            keys = None
        if not isinstance(keys, dict):
            raise ProblemError("not a JSON object")
        number, kind = keys.pop("id", None), keys.pop("type", None)
        if number is not None and type(number) is not int and not (isinstance(number, str) and len(number) <= 64):
            raise refused("id", ": must be a whole number, or a text of 64 characters at most")
        asked = self.requests.get(kind) if isinstance(kind, str) else None
        if asked is None:
            raise refused("type", f": must be one of {', '.join(self.requests)}")
        return number, kind, asked, keys
