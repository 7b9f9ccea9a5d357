"""Data that arrive from a board while it is checked, and the values in them."""

from __future__ import annotations

import contextlib
import ipaddress
import math
import socket
import sys
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.array import Array
from taxel.wire import Counts, Decoder

#: The first byte of a datagram of version 2 (docs/wire-v2.md).
_MAGIC = 0x54
#: What the kernel is asked to hold, bytes; the largest datagram.
_WAITING, _LARGEST = 1 << 25, 65_535
#: How long it may take to read what the kernel holds, s.
_DRAINED_S = 5.0
#: Resolution of a stamp of version 1, us.
_STAMP_US = 100.0


@dataclass
class Capture:
    """Data that arrived, and the place."""

    datagrams: list[bytes] = field(default_factory=list)
    arrived_us: list[int] = field(default_factory=list)
    sender: str = ""
    interface: str = ""
    destination: str = ""


class Receiver:
    """The port that a board sends to."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _WAITING)
            if sys.platform != "win32":
                # The kernel tells by which interface a datagram came, and to which address.
                self.socket.setsockopt(socket.IPPROTO_IP, getattr(socket, "IP_PKTINFO", 8), 1)
            self.socket.bind((host, port))
        except BaseException:
            self.socket.close()
            raise

    def take(self, seconds: float, patience: float) -> Capture:
        """Receive for so long from the first datagram on, which may take up to `patience` s."""
        capture, until = Capture(), time.monotonic() + patience
        while (left := until - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                data, ancillary, (host, port) = self._receive()
            except TimeoutError:
                break
            if not capture.datagrams:
                until = time.monotonic() + seconds
                capture.sender = f"{host}:{port}"
                for level, _, info in ancillary:
                    if level == socket.IPPROTO_IP and len(info) >= 12:
                        with contextlib.suppress(OSError):
                            capture.interface = socket.if_indextoname(int.from_bytes(info[:4], "little"))
                        capture.destination = str(ipaddress.IPv4Address(info[8:12]))
            capture.datagrams.append(data)
            capture.arrived_us.append(round(time.monotonic() * 1e6))
        return capture

    def _receive(self) -> tuple[bytes, list[tuple[int, int, bytes]], tuple[str, int]]:
        """Return a datagram, what the kernel tells of it, and its sender."""
        if sys.platform == "win32":
            data, sender = self.socket.recvfrom(_LARGEST)
            return data, [], sender
        data, ancillary, _, sender = self.socket.recvmsg(_LARGEST, 64)
        return data, ancillary, sender

    def drain(self, seconds: float) -> None:
        """Let pass what has arrived, and what arrives within so long; then what waits."""
        begun = time.monotonic()
        while (passed := time.monotonic() - begun) < seconds + _DRAINED_S:
            self.socket.settimeout(max(seconds - passed, 0.0))
            try:
                self.socket.recv(_LARGEST)
            except (TimeoutError, BlockingIOError):
                if passed >= seconds:
                    return


@dataclass(frozen=True)
class DecodedValues:
    """The values of events as they were decoded, without those repaired by a state."""

    version: int
    counts: Counts
    t: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    value: NDArray[np.uint16]
    speed: float

    @property
    def resolution_us(self) -> float:
        """The step of stamps, us."""
        return _STAMP_US if self.version == 1 else 1.0


def decoded(capture: Capture, array: Array) -> DecodedValues:
    """Decode all datagrams."""
    version = 2 if capture.datagrams[0][:1] == bytes([_MAGIC]) else 1
    decoder, parts, times = Decoder(2 if version == 2 else 1, array=array), [], []
    for datagram, arrived in zip(capture.datagrams, capture.arrived_us, strict=True):
        for events in (decoder.push(datagram, arrived), decoder.end_of_datagram()):
            if not len(events):
                continue
            times.append((int(events.t[-1]), arrived))
            if events.intensity is None:
                continue
            here = np.ones(len(events), bool) if events.present is None else events.present
            if events.repaired is not None:
                here = here & ~events.repaired
            parts.append((events.t[here], events.x[here], events.y[here], events.intensity[here]))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)] if parts else [np.empty(0, np.int64)] * 4
    t, x, y, value = columns[0], *(column.astype(np.uint16) for column in columns[1:])
    passed = times[-1][1] - times[0][1] if times else 0
    speed = (times[-1][0] - times[0][0]) / passed if passed > 0 else math.nan
    return DecodedValues(version, decoder.counts, t, x, y, value, speed)
