"""The server of the page: its files, and the web socket with the messages, on one port and in a thread of its own."""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import logging
import secrets
import socket
import threading
import time
from collections.abc import Coroutine
from concurrent.futures import Future
from http import HTTPStatus
from pathlib import Path
from typing import Any, TypeVar, cast
from urllib.parse import quote

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed, InvalidMessage
from websockets.http11 import Request, Response

from taxel.panel.hub import Hub
from taxel.panel.requests import Requests
from taxel.panel.threads import wait_for_threads

_T = TypeVar("_T")

#: The subprotocol, and the prefix of the one that carries the token.
_PROTOCOL, _TOKEN = "taxel.panel.1", "token."

#: Bytes of a message of a client, at most; 5000 labels are fewer.
_MOST_BYTES = 1 << 20

#: Clients at a time.
_MOST_CLIENTS = 64

#: Time from one frame to the next, and without clients from one look at the source to the next, s.
_FRAME_S, _IDLE_S = 1 / 60, 0.05

#: How often a client is asked whether it reads, and how long it may take to answer, s.
_ASK_S, _ANSWER_S = 5.0, 10.0

#: How long requests that run are waited for when the server ends, s.
_REQUESTS_S = 2.0

#: No frame is longer, so that sending one never waits for its client.
_WRITE_LIMIT = 1 << 22

_MEDIA = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".LICENSE": "text/plain; charset=utf-8",
}
_WEB = Path(__file__).parent / "web"
#: The files of the page by the exact names that a request may have.
_FILES = {
    file.relative_to(_WEB).as_posix(): (_MEDIA[file.suffix], file) for file in _WEB.rglob("*") if file.suffix in _MEDIA
}

_HEADERS = {
    # Scripts and styles from this server only; the page may make pictures (PNG) itself.
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}

# What strangers send is no matter of the program's log.
_QUIET = logging.getLogger("taxel.panel.strangers")
_QUIET.propagate = False
_QUIET.addHandler(logging.NullHandler())


class _Connection(ServerConnection):
    """Answer what the library closes in silence: what is no request for a page, as one with a body."""

    _is_answered = False

    def send_data(self) -> None:
        """Send what waits, behind that answer."""
        wrong = self.protocol.handshake_exc
        if not self._is_answered and isinstance(wrong, InvalidMessage) and not isinstance(wrong.__cause__, EOFError):
            self._is_answered = True
            answer = self.respond(HTTPStatus.BAD_REQUEST, "")
            answer.headers.update(_HEADERS)
            self.transport.write(answer.serialize())
        super().send_data()


class Server:
    """Serve the page and its messages until `stop`.

    Parameters
    ----------
    hub : Hub
        What all clients share; its work runs in this server's thread from now on.
    host, port : str, int
        The address of this machine to listen on; port 0 finds a free one.

    Raises
    ------
    OSError : the address is not of this machine, or the port is taken
    """

    def __init__(self, hub: Hub, host: str, port: int) -> None:
        self._hub = hub
        self.token = secrets.token_hex(32)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._socket = socket.create_server((host, port), family=family, backlog=128)
        except OSError as error:
            why = str(error.strerror).partition(" (while ")[0]
            raise OSError(error.errno, why, f"{host}:{port}") from None
        self.address: tuple[str, int] = self._socket.getsockname()[:2]
        ip = ipaddress.ip_address(self.address[0])
        self._anywhere = ip.is_unspecified
        shown = ("::1" if ip.version == 6 else "127.0.0.1") if self._anywhere else str(ip)
        self._shown = f"[{shown}]:{self.address[1]}" if ":" in shown else f"{shown}:{self.address[1]}"
        self._hosts = {self._shown}
        if ipaddress.ip_address(shown).is_loopback:
            self._hosts.add(f"localhost:{self.address[1]}")
        self._clients: set[asyncio.Task[None]] = set()
        ready: Future[asyncio.AbstractEventLoop] = Future()
        self._thread = threading.Thread(target=self._run, args=(ready,), name="taxel-panel", daemon=True)
        self._thread.start()
        self._loop = ready.result()

    def url(self, opened: str | None) -> str:
        """Return the address for a browser; the token is in the fragment, which is in no log."""
        return f"http://{self._shown}/#token={self.token}" + (f"&open={quote(opened, safe='')}" if opened else "")

    def call(self, work: Coroutine[Any, Any, _T]) -> _T:
        """Do work in the server's thread, and wait for it."""
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    def stop(self) -> None:
        """Tell the clients that the server ends, and end it."""
        if self._thread.is_alive():
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._ended.set)
            self._thread.join()
            wait_for_threads(_REQUESTS_S)

    def _run(self, ready: Future[asyncio.AbstractEventLoop]) -> None:
        try:
            asyncio.run(self._serve(ready))
        except BaseException as error:
            if not ready.done():
                ready.set_exception(error)
            raise

    async def _serve(self, ready: Future[asyncio.AbstractEventLoop]) -> None:
        self._ended = asyncio.Event()
        async with serve(
            self._client,
            sock=self._socket,
            process_request=self._gate,
            process_response=self._complete,
            create_connection=_Connection,
            subprotocols=[_PROTOCOL],  # type: ignore[list-item]
            compression=None,
            write_limit=_WRITE_LIMIT,
            max_size=_MOST_BYTES,
            ping_interval=_ASK_S,
            ping_timeout=_ANSWER_S,
            close_timeout=1,
            server_header=None,
            logger=_QUIET,
        ) as server:
            tasks = [asyncio.create_task(work) for work in (self._beat(), *self._hub.works())]
            ready.set_result(asyncio.get_running_loop())
            await self._ended.wait()
            for task in tasks:
                task.cancel()
            await self._hub.end()
            server.close()
            # A request that takes long is not waited for.
            for client in self._clients:
                client.cancel()

    # ---------------------------------------------------------------------------------------------- access

    def _gate(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file, or refuse a web socket; None lets it in."""
        hosts, path = request.headers.get_all("Host"), request.path.partition("?")[0]
        media, file = _FILES.get("index.html" if path == "/" else path.removeprefix("/"), ("", None))
        if len(hosts) != 1 or not self._accepts(hosts[0]):
            refused = HTTPStatus.MISDIRECTED_REQUEST
        elif request.method not in ("GET", "HEAD"):
            refused = HTTPStatus.METHOD_NOT_ALLOWED
        elif path == "/socket":
            return self._refusal(connection, request, hosts[0])
        elif file is None:
            refused = HTTPStatus.NOT_FOUND
        else:
            answer, body = connection.respond(HTTPStatus.OK, ""), file.read_bytes()
            for name, value in (("Content-Type", media), ("Content-Length", str(len(body)))):
                del answer.headers[name]
                answer.headers[name] = value
            answer.body = body if request.method == "GET" else b""
            return answer
        return connection.respond(refused, "")

    def _accepts(self, host: str) -> bool:
        """Return whether a request may name this host: of names localhost alone, as others may resolve to it."""
        if host in self._hosts:
            return True
        if not self._anywhere:
            return False
        name, _, port = host.rpartition(":")
        try:
            ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
        except ValueError:
            return False
        return port == str(self.address[1])

    def _refusal(self, connection: ServerConnection, request: Request, host: str) -> Response | None:
        if request.headers.get_all("Origin") != [f"http://{host}"]:
            return connection.respond(HTTPStatus.FORBIDDEN, "")
        offered = [one.strip() for one in ",".join(request.headers.get_all("Sec-WebSocket-Protocol")).split(",")]
        tokens = [one.removeprefix(_TOKEN) for one in offered if one.startswith(_TOKEN)]
        right = [hmac.compare_digest(token.encode(), self.token.encode()) for token in tokens]
        if _PROTOCOL not in offered or not any(right):
            return connection.respond(HTTPStatus.UNAUTHORIZED, "")
        is_full = len(self._hub.sessions) >= _MOST_CLIENTS
        return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "") if is_full else None

    def _complete(self, _connection: ServerConnection, _request: Request, response: Response) -> None:
        """Add the headers that every answer has."""
        response.headers.update(_HEADERS)

    # ---------------------------------------------------------------------------------------------- clients

    async def _client(self, connection: ServerConnection) -> None:
        session = Requests(self._hub, connection)
        self._hub.join(session)
        self._clients.add(this := cast("asyncio.Task[None]", asyncio.current_task()))
        try:
            await session.greet()
            async for message in connection:
                if isinstance(message, bytes):
                    await connection.close(1003, "text only")
                    break
                if not await session.answer(message):
                    await connection.close(1008, "too many refused messages")
                    break
        # The server cancels it at its end; the connection is closed in order then too.
        except (ConnectionClosed, asyncio.CancelledError):
            pass
        finally:
            self._clients.discard(this)
            self._hub.leave(session)

    async def _beat(self) -> None:
        """Build and send the frames of all clients, sixty times a second; nothing waits for a client here."""
        due = time.monotonic()
        while True:
            due = max(due + (_FRAME_S if self._hub.sessions else _IDLE_S), time.monotonic())
            await asyncio.sleep(due - time.monotonic())
            await self._hub.tell()
            for session in list(self._hub.sessions):
                await session.send_frame()
