"""A board of this computer, published to other computers."""

from __future__ import annotations

import contextlib
import errno
import json
import re
import socket
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any

from taxel import DeviceError, Error, ProblemError
from taxel.live import Live
from taxel_bridge.remote import wheel, with_taxel_errors

__all__ = ["PLACE", "Bridge"]

#: Default address: only this computer can connect to it.
PLACE = "127.0.0.1:7447"

#: Interval at which a wait checks whether to stop, s.
_POLL_S = 0.05

#: Interval at which the published description of the sensor is updated, s.
_UPDATE_S = 1.0


class Bridge:
    """Publish what a board sends to this computer: unchanged datagrams, low-rate frames, detections.

    A context manager. Recorders on other computers receive every datagram: the bridge buffers up to 64 MiB for a slow
    one, and disconnects it after 1.5 s without progress. Viewers that are too slow lose datagrams. Neither slows
    the `Live` of this computer. The data are neither encrypted nor protected: every computer that reaches `listen` can
    receive them.

    Parameters
    ----------
    live : Live
        The receiver of the board; its detections are published, and its frame ten times a second.
    name : str
        The name of the board: 1 to 64 letters, digits, - _ or .
    listen : str or sequence of str
        HOST:PORT of this computer to listen on.
    connect : str or sequence of str
        HOST:PORT of a Zenoh router, if there is one.
    clock_ahead_s : float, s
        For tests: offset of the clock of all published times.
    clock_drift_ppm : float, parts per million (share)
        For tests: drift of that clock.

    Raises
    ------
    DeviceError : the address cannot be bound; the wheel taxel_zenoh is not installed
    ProblemError : arguments that are invalid
    """

    def __init__(
        self,
        live: Live,
        *,
        name: str = "board",
        listen: str | Sequence[str] = PLACE,
        connect: str | Sequence[str] = (),
        clock_ahead_s: float = 0.0,
        clock_drift_ppm: float = 0.0,
    ) -> None:
        self.name, self.listen = name, _places("listen", listen)
        self._live = live
        zenoh = wheel()
        routers = _places("connect", connect)
        try:
            self._zenoh = with_taxel_errors(
                zenoh.Publisher,
                name,
                self.listen,
                routers,
                json.dumps(live.about),
                round(clock_ahead_s * 1e9),
                clock_drift_ppm,
            )
        except DeviceError:
            for place in self.listen:
                _refused(place)
            raise
        self._copies = live.copies()
        self._failed: BaseException | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="taxel-bridge", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Publish the copies of the pipeline until all are published."""
        send = {"parcel": self._zenoh.parcel, "frame": self._zenoh.frame, "detection": self._zenoh.detection}
        renewed = time.monotonic()
        try:
            while not (self._copies.is_over() or self._ending.is_set()):
                copied = self._copies.next(_POLL_S)
                if copied is not None:
                    send[copied[0]](copied[1])
                if time.monotonic() - renewed > _UPDATE_S:
                    # A panel may have written the registers.
                    renewed = time.monotonic()
                    with contextlib.suppress(ProblemError):
                        # The pipeline has ended: the loop ends too.
                        self._zenoh.tell(json.dumps(self._live.about))
        except Exception as error:
            # `stop` raises it, in the thread of its caller.
            self._failed = error

    @property
    def counts(self) -> dict[str, dict[str, Any]]:
        """Parcels sent and dropped for "block" (recorders) and "drop" (viewers), and whether there is a subscriber."""
        counts = dict(zip(("block", "drop"), with_taxel_errors(self._zenoh.counts), strict=True))
        return {what: dict(zip(("sent", "dropped", "subscribed"), row, strict=True)) for what, row in counts.items()}

    def stop(self) -> None:
        """Publish what waits, and end; stop the `Live` first if everything must be published.

        Raises
        ------
        DeviceError : publishing failed
        """
        if self._thread.is_alive():
            if not self._live.is_over:
                self._ending.set()
            self._thread.join()
        with_taxel_errors(self._zenoh.close)
        if self._failed is not None:
            failed, self._failed = self._failed, None
            raise DeviceError(f"bridge {self.name}: {failed}")

    def __enter__(self) -> Bridge:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            self.stop()
        else:
            # The first error is the one that is raised.
            with contextlib.suppress(Error, OSError):
                self.stop()

    def __repr__(self) -> str:
        return f"Bridge({self.name!r}, {', '.join(self.listen)})"


def _places(name: str, addresses: str | Sequence[str]) -> list[str]:
    places = [addresses] if isinstance(addresses, str) else list(addresses)
    for place in places:
        match = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[\w.-]+):(\d{1,5})", place, re.ASCII)
        if not match or not 1 <= int(match[2]) <= 65_535:
            raise ProblemError(f"{name} is {place!r}: must be HOST:PORT, for example {PLACE}")
    return places


def _refused(place: str) -> None:
    """Raise the reason if no program can listen at an address of this computer."""
    host, _, port = place.rpartition(":")
    try:
        ((family, kind, _, _, address), *_) = socket.getaddrinfo(host.strip("[]"), int(port), type=socket.SOCK_STREAM)
        with socket.socket(family, kind) as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            tried.bind(address)
            tried.listen()
    except socket.gaierror:
        raise DeviceError(f"listen {place}: the name of this host is not known here") from None
    except OSError as error:
        right = {
            errno.EADDRINUSE: "another program listens at this port: end that program, or use another port",
            errno.EADDRNOTAVAIL: "must be an address of this computer, or 0.0.0.0 for all its addresses",
        }.get(error.errno or 0)
        why = (error.strerror or str(error)).lower()
        raise DeviceError(f"listen {place}: {why}" + (f"; {right}" if right else "")) from None
