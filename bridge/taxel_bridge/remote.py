"""Boards of other computers, received as if they were connected to this one.

Zenoh transports their datagrams, by the wheel ``taxel_zenoh``, which only users of more than one computer build.
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

from taxel import DeviceError, ProblemError
from taxel.live import RemoteBoard
from taxel.live.remote import ParcelFeed

__all__ = ["Address", "Remote", "wheel", "with_taxel_errors"]

#: Zenoh's default port.
_PORT = 7447

#: Interval at which a wait checks whether to stop, s.
_POLL_S = 0.05

#: Number of clock comparisons at the beginning, and their interval afterwards, s.
_AT_FIRST, _COMPARE_S = 8, 0.25

#: Timeout of a query for the published boards, s.
_ASK_S = 0.5

#: Timeout of the TCP connection that finds out why no bridge answered, s.
_REACH_S = 2.0


class Address(NamedTuple):
    """Hold the address of a board of another computer: ``zenoh:HOST[:PORT][/NAME]``.

    Attributes
    ----------
    host : str
        The computer whose bridge listens, or a Zenoh router.
    port : int
    name : str or None
        The board; None if only one is published there.
    """

    host: str
    port: int
    name: str | None

    @classmethod
    def of(cls, address: str) -> Address:
        """Return the address that a text names.

        Parameters
        ----------
        address : str

        Raises
        ------
        ProblemError : the text is no such address

        Examples
        --------
        >>> Address.of("zenoh:192.168.1.5/left")
        Address(host='192.168.1.5', port=7447, name='left')
        """
        match = re.fullmatch(
            r"zenoh:(?P<host>\[[0-9a-fA-F:.]+\]|[\w.-]+)(:(?P<port>\d{1,5}))?(/(?P<name>[\w.-]{1,64}))?",
            address,
            re.ASCII,
        )
        port = _PORT if match is None else int(match["port"] or _PORT)
        if match is None or not 1 <= port <= 65_535:
            raise ProblemError(
                f"address {address!r}: must be zenoh:HOST:PORT/NAME, for example zenoh:192.168.1.5:7447/left"
            )
        return cls(match["host"], port, match["name"])

    @property
    def place(self) -> str:
        """HOST:PORT."""
        return f"{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"zenoh:{self.place}" + ("" if self.name is None else f"/{self.name}")


class Remote(RemoteBoard):
    """Receive a board of another computer, which a `Bridge` there publishes. A context manager.

    Give it to `Live`, which then decodes, shows, records and detects as if the board were connected here; or
    read the detections and frames of that computer: `detections`, `frames`.

    Parameters
    ----------
    address : str
        ``zenoh:HOST[:PORT][/NAME]``.
    congestion : {"block", "drop"}
        Where this computer is too slow: the bridge waits for it, as a recorder needs, or drops datagrams and counts
        them.
    timeout : float, s
        How long to wait for the bridge.

    Raises
    ------
    DeviceError : no bridge answers, or several boards are published and none is named; the wheel is not installed
    ProblemError : the text is no address

    Examples
    --------
    ``with Remote("zenoh:192.168.1.5/left") as remote, Live(remote=remote) as live: ...`` receives a board of another
    computer.

    >>> Remote("192.168.1.5")
    Traceback (most recent call last):
    taxel.ProblemError: address '192.168.1.5': must be zenoh:HOST:PORT/NAME, for example zenoh:192.168.1.5:7447/left

    Notes
    -----
    The computers' clocks are compared by round trips, four times a second: of each second the shortest counts, the
    drift is the median slope, and the offset the middle of what the shortest ones allow
    (`Live.counters["bridged"]["clock"]`).
    """

    def __init__(self, address: str, *, congestion: str = "block", timeout: float = 5.0) -> None:
        self.address = Address.of(address)
        if congestion not in ("block", "drop"):
            raise ProblemError(f"congestion is {congestion!r}: must be block or drop")
        self.congestion = congestion
        self._zenoh = with_taxel_errors(wheel().Subscriber, [self.address.place])
        try:
            self.name, about = self._find(timeout)
            super().__init__(str(self.address._replace(name=self.name)), about)
        except BaseException:
            self._zenoh.close()
            raise
        self._described = about["array"]
        self._ending = threading.Event()
        self._thread: threading.Thread | None = None

    def _find(self, timeout: float) -> tuple[str, dict[str, Any]]:
        """Return the board's name and description."""
        until = time.monotonic() + timeout
        while True:
            boards: dict[str, str] = dict(with_taxel_errors(self._zenoh.names, _ASK_S))
            name = self.address.name
            if name in boards:
                return name, json.loads(boards[name])
            if name is None and len(boards) == 1:
                ((name, about),) = boards.items()
                return name, json.loads(about)
            if name is None and boards:
                names = ", ".join(sorted(boards))
                raise DeviceError(f"{self.address}: publishes {names}; add /NAME")
            if time.monotonic() >= until:
                if boards:
                    raise DeviceError(f"{self.address}: publishes {', '.join(sorted(boards))}, not {name}")
                raise DeviceError(f"{self.address}: {self._why_unreachable()}")
            # A query on a link that is not established yet returns at once.
            time.sleep(_POLL_S)

    def _why_unreachable(self) -> str:
        """Return why no bridge answers, as far as this computer can tell."""
        begin = "start taxel bridge on that computer, with --listen and an address that other computers reach"
        try:
            with socket.create_connection((self.address.host.strip("[]"), self.address.port), timeout=_REACH_S):
                return f"publishes no board; {begin}"
        except socket.gaierror:
            return "the name of this computer is not known here; give its address"
        except TimeoutError:
            return f"does not answer; is the address right, and does a firewall allow TCP port {self.address.port}?"
        except OSError as error:
            if error.errno == errno.ECONNREFUSED:
                return f"the computer answers, but no program listens at this port; {begin}"
            return f"{(error.strerror or str(error)).lower()}; is the address right, and are both on one network?"

    def begin(self, feed: ParcelFeed) -> None:
        """Feed the pipeline of a `Live` from now on, which calls this."""
        self.in_use = True
        self._thread = threading.Thread(target=self._run, args=(feed,), name="taxel-bridge", daemon=True)
        self._thread.start()

    def _run(self, feed: ParcelFeed) -> None:
        """Feed received parcels until the pipeline ends, or `stop` is called."""
        try:
            self._compare(feed, _AT_FIRST)
            self._zenoh.listen(self.name, self.congestion)
            clocks = threading.Thread(target=self._clocks, args=(feed,), name="taxel-clocks", daemon=True)
            clocks.start()
            while not (feed.is_over() or self._ending.is_set()):
                parcel = self._zenoh.take(_POLL_S)
                while parcel is not None and not feed.take(parcel):
                    self._begin_session(feed)
                    if feed.is_over() or self._ending.is_set():
                        break
            clocks.join()
        except Exception as error:
            # The pipeline raises it in its callers.
            feed.fail(str(error))

    def _begin_session(self, feed: ParcelFeed) -> None:
        """Begin another session: it must be of the same sensor, and the clocks are compared again."""
        about = dict(with_taxel_errors(self._zenoh.names, _ASK_S)).get(self.name)
        if about is not None and json.loads(about)["array"] != self._described:
            raise DeviceError("another board is now at this address; make a new Remote")
        feed.begin_session()
        self._compare(feed, _AT_FIRST)

    def _compare(self, feed: ParcelFeed, times: int) -> None:
        for _ in range(times):
            trip = self._zenoh.compare(self.name)
            if trip is not None:
                feed.compare(*trip)

    def _clocks(self, feed: ParcelFeed) -> None:
        # A round trip takes up to a second if the other computer is gone: parcels must not wait for it.
        with contextlib.suppress(ConnectionError):
            while not (feed.is_over() or self._ending.wait(_COMPARE_S)):
                self._compare(feed, 1)

    def detections(self) -> Iterator[dict[str, Any]]:
        """Yield the detections of the other computer's readout, with the keys of ``taxel live --json``; endless."""
        return self._messages("detection")

    def frames(self) -> Iterator[dict[str, Any]]:
        """Yield the held values, ten times a second while events arrive: t_us, rows, columns, ticks; endless."""
        return self._messages("frame")

    def _messages(self, what: str) -> Iterator[dict[str, Any]]:
        if self.in_use:
            raise ProblemError("remote: is in use already; make another remote board")
        with_taxel_errors(self._zenoh.listen, self.name, what)
        while not self._ending.is_set():
            message = with_taxel_errors(self._zenoh.take, _POLL_S)
            if message is not None:
                yield json.loads(message)

    def stop(self) -> None:
        """Disconnect; discard what was received and not read."""
        self._ending.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        with_taxel_errors(self._zenoh.close)

    def __enter__(self) -> Remote:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def __repr__(self) -> str:
        return f"Remote({self.place!r}, congestion={self.congestion!r})"


def wheel() -> Any:
    """Return the module of the wheel taxel_zenoh."""
    try:
        return importlib.import_module("taxel_zenoh")
    except ImportError:
        raise DeviceError(
            "a bridge needs the wheel taxel_zenoh: run make bridge in a checkout of taxel (six minutes on one core)"
        ) from None


def with_taxel_errors(call: Any, *arguments: Any) -> Any:
    """Call a function of the wheel; raise its errors as errors of taxel."""
    try:
        return call(*arguments)
    except ConnectionError as error:
        raise DeviceError(f"bridge: {error}") from None
    except ValueError as error:
        raise ProblemError(str(error)) from None
