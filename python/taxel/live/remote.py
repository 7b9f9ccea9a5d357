"""Boards of other computers, heard as if they were here.

Zenoh carries what they send, by the wheel ``taxel-bridge``, which only those need who have more than one computer.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from types import TracebackType
from typing import Any, NamedTuple

from taxel import _core
from taxel._base.arguments import number, shown, text
from taxel._core import DeviceError, ProblemError
from taxel.array import Array

__all__ = ["Address", "Remote", "told", "wheel"]

#: Zenoh's own port.
_PORT = 7447

#: How long a wait lasts before it is asked whether to stop, s.
_LOOK_S = 0.05

#: The clocks are compared so often at the beginning, and so often afterwards, s.
_AT_FIRST, _COMPARE_S = 8, 0.25

#: Who answers is asked for so long, s.
_ASK_S = 0.5

#: So long it is tried to reach a computer on which nobody answered, to say why, s.
_REACH_S = 2.0


class Address(NamedTuple):
    """Say where a board of another computer is heard: ``zenoh:HOST[:PORT][/NAME]``.

    Attributes
    ----------
    host : str
        Of the computer whose bridge listens, or of a Zenoh router.
    port : int
    name : str or None
        Of the board; None where only one is published there.
    """

    host: str
    port: int
    name: str | None

    @classmethod
    def of(cls, said: str) -> Address:
        """Return the address that a text names.

        Raises
        ------
        ProblemError : it names none

        Examples
        --------
        >>> Address.of("zenoh:192.168.1.5/left")
        Address(host='192.168.1.5', port=7447, name='left')
        """
        found = re.fullmatch(
            r"zenoh:(?P<host>\[[0-9a-fA-F:.]+\]|[\w.-]+)(:(?P<port>\d{1,5}))?(/(?P<name>[\w.-]{1,64}))?",
            text("address", said),
            re.ASCII,
        )
        port = _PORT if found is None else int(found["port"] or _PORT)
        if found is None or not 1 <= port <= 65_535:
            raise ProblemError(f"address {said!r}: must be zenoh:HOST:PORT/NAME, as zenoh:192.168.1.5:7447/left")
        return cls(found["host"], port, found["name"])

    @property
    def place(self) -> str:
        """HOST:PORT."""
        return f"{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"zenoh:{self.place}" + ("" if self.name is None else f"/{self.name}")


class Remote:
    """Hear a board of another computer, which a `Bridge` there publishes. A context manager.

    Give it to `Live`, which then decodes, shows, records and detects as if the board were here; or read what that
    computer itself says: `detections`, `pictures`.

    Parameters
    ----------
    address : str
        ``zenoh:HOST[:PORT][/NAME]``.
    congestion : {"block", "drop"}
        Where this computer is slow: the bridge waits for it, as a recorder wants, or leaves out what is too much.
    timeout : float, s
        How long the bridge is waited for.

    Raises
    ------
    DeviceError : nobody answers, or several publish there and none is named; the wheel is not installed
    ProblemError : the address is none

    Notes
    -----
    The computers' clocks are compared by round trips, four times a second: of each second the shortest counts, the
    drift is the median slope, and the offset the middle of what the shortest ones allow
    (`Live.counters["bridged"]["clock"]`).
    """

    def __init__(self, address: str, *, congestion: str = "block", timeout: float = 5.0) -> None:
        self.address = Address.of(address)
        if congestion not in ("block", "drop"):
            raise ProblemError(f"congestion is {shown(congestion)}: must be block or drop")
        self.congestion = congestion
        self._zenoh = told(wheel().Subscriber, [self.address.place])
        try:
            self.name, self._about = self._find(number("timeout", timeout))
        except BaseException:
            self._zenoh.close()
            raise
        self._feed: _core.Feed | None = None
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None
        #: The sensor, as the other computer knows it.
        self.array: Array = Array._from_geometry(dict(self._about["array"]))

    def _find(self, timeout: float) -> tuple[str, dict[str, Any]]:
        """Return the board's name and what is said of it."""
        until = time.monotonic() + timeout
        while True:
            found: dict[str, str] = dict(told(self._zenoh.names, _ASK_S))
            wanted = self.address.name
            if wanted in found:
                return wanted, json.loads(found[wanted])
            if wanted is None and len(found) == 1:
                ((name, about),) = found.items()
                return name, json.loads(about)
            if wanted is None and found:
                names = ", ".join(sorted(found))
                raise DeviceError(f"{self.address}: publishes {names}; add /NAME")
            if time.monotonic() >= until:
                if found:
                    raise DeviceError(f"{self.address}: publishes {', '.join(sorted(found))}, not {wanted}")
                raise DeviceError(f"{self.address}: {self._unheard()}")
            # A link that does not stand yet answers at once.
            time.sleep(_LOOK_S)

    def _unheard(self) -> str:
        """Return why nobody answers, as far as that can be seen from here."""
        begin = "begin taxel bridge on that computer, with --listen and an address that others reach"
        try:
            with socket.create_connection((self.address.host.strip("[]"), self.address.port), timeout=_REACH_S):
                return f"no board is published there; {begin}"
        except socket.gaierror:
            return "no computer of that name is known here; name it by its address"
        except TimeoutError:
            return f"does not answer; is the address right, does a firewall let port {self.address.port} (TCP) through?"
        except OSError as error:
            if error.errno == errno.ECONNREFUSED:
                return f"that computer is reached, but nobody listens at this port; {begin}"
            return f"{(error.strerror or str(error)).lower()}; is the address right, are both on one network?"

    @property
    def registers(self) -> dict[str, Any]:
        """What the board's registers hold, in their own units."""
        return dict(self._about["registers"])

    @property
    def differences(self) -> bool:
        """Whether the board sends differences for intensities."""
        return bool(self._about["differences"])

    def _fed(self, queue_bytes: int | None) -> _core.Feed:
        """Return what a pipeline is fed by."""
        self._only_one()
        return _core.Feed(str(self.address._replace(name=self.name)), queue_bytes)

    def _begin(self, feed: _core.Feed) -> None:
        """Feed it, from here on."""
        self._feed = feed
        self._thread = threading.Thread(target=self._run, args=(feed,), name="taxel-bridge", daemon=True)
        self._thread.start()

    def _only_one(self) -> None:
        if self._feed is not None:
            raise ProblemError("remote: is listened to already; make another one")

    def _run(self, feed: _core.Feed) -> None:
        """Hand over what comes; ends with the pipeline that it feeds, or with `stop`."""
        try:
            self._compare(feed, _AT_FIRST)
            self._zenoh.listen(self.name, self.congestion)
            clocks = threading.Thread(target=self._clocks, args=(feed,), name="taxel-clocks", daemon=True)
            clocks.start()
            while not (feed.is_over() or self._ending.is_set()):
                parcel = self._zenoh.take(_LOOK_S)
                while parcel is not None and not feed.take(parcel):
                    self._meet(feed)
                    if feed.is_over() or self._ending.is_set():
                        break
            clocks.join()
        except Exception as error:
            # Said by the pipeline, to those who listen.
            feed.fail(str(error))

    def _meet(self, feed: _core.Feed) -> None:
        """Another session begins: it must be of the same sensor, and the clocks are compared anew."""
        about = dict(told(self._zenoh.names, _ASK_S)).get(self.name)
        if about is not None and json.loads(about)["array"] != self._about["array"]:
            raise DeviceError("the board there is another one now; begin anew")
        feed.meet()
        self._compare(feed, _AT_FIRST)

    def _compare(self, feed: _core.Feed, times: int) -> None:
        for _ in range(times):
            trip = self._zenoh.compare(self.name)
            if trip is not None:
                feed.compare(*trip)

    def _clocks(self, feed: _core.Feed) -> None:
        # A round trip may take as long as a second where the other is gone: what comes must not wait for it.
        with contextlib.suppress(ConnectionError):
            while not (feed.is_over() or self._ending.wait(_COMPARE_S)):
                self._compare(feed, 1)

    def detections(self) -> Iterator[dict[str, Any]]:
        """Yield what the other computer's readout says, as ``taxel live --json`` says it there; endless."""
        return self._messages("detection")

    def pictures(self) -> Iterator[dict[str, Any]]:
        """Yield what the taxels hold, ten times a second while something comes: t_us, rows, columns, ticks; endless."""
        return self._messages("picture")

    def _messages(self, what: str) -> Iterator[dict[str, Any]]:
        self._only_one()
        told(self._zenoh.listen, self.name, what)
        while not self._ending.is_set():
            message = told(self._zenoh.take, _LOOK_S)
            if message is not None:
                yield json.loads(message)

    def stop(self) -> None:
        """End; what still waits is let go."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        told(self._zenoh.close)

    def __enter__(self) -> Remote:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f"Remote({str(self.address._replace(name=self.name))!r}, congestion={self.congestion!r})"


def wheel() -> Any:
    """Return the wheel that carries it."""
    try:
        return importlib.import_module("taxel_bridge")
    except ImportError:
        raise DeviceError(
            "a bridge needs the wheel taxel-bridge: say make bridge in a checkout of taxel (six minutes of a core)"
        ) from None


def told(call: Any, *arguments: Any) -> Any:
    """Call the wheel; its errors are ours."""
    try:
        return call(*arguments)
    except ConnectionError as error:
        raise DeviceError(f"bridge: {error}") from None
    except ValueError as error:
        raise ProblemError(str(error)) from None
