"""Carries datagrams, each as it is, from a UDP port of one computer to one of another."""

from __future__ import annotations

import json
import re
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import closing

import zenoh

from taxel import DeviceError, ProblemError

__all__ = ["PLACE", "Bridge"]

#: Zenoh's port, on this computer alone.
PLACE = "tcp/127.0.0.1:7447"

#: Asked of the kernel for datagrams that wait, bytes; it may give less.
_KERNEL_BUFFER_BYTES = 32 << 20

#: How long a first connection may take, and how long a connection may say nothing until it is lost, ms.
_CONNECT_MS, _LEASE_MS = 5000, 1500

#: How long a datagram waits for a receiver that is too slow until it is dropped, us.
_WAIT_US = 300_000

#: Interval at which a wait looks whether its time is over, s.
_LOOK_S = 0.1


class Bridge:
    """One end of a bridge.

    Parameters
    ----------
    name : str
        The board's name, the same at both ends: 1 to 64 letters, digits, - _ or .
    say : callable
        Called with a line of text when the bridge has begun, and when the other end comes and goes.
    listen, connect : sequence of str
        Zenoh's addresses, tcp/HOST:PORT, to listen on, and to connect to; no other end is looked for.

    Raises
    ------
    DeviceError : an address cannot be listened on, or nobody answers at one within 5 s
    ProblemError : a name or an address that is none
    """

    def __init__(
        self, name: str, say: Callable[[str], object], *, listen: Sequence[str] = (), connect: Sequence[str] = ()
    ) -> None:
        if not re.fullmatch(r"[\w.-]{1,64}", name, re.ASCII):
            raise ProblemError(f"name is {name!r}: must be 1 to 64 letters, digits, - _ or .")
        for place in (*listen, *connect):
            if not re.fullmatch(r"[a-z]+/(\[[0-9a-fA-F:.]+\]|[\w.-]+):[0-9]{1,5}", place, re.ASCII):
                raise ProblemError(f"address is {place!r}: must be tcp/HOST:PORT, for example {PLACE}")
        settings = {
            "mode": "peer" if listen else "client",
            "listen/endpoints": list(listen),
            "connect/endpoints": list(connect),
            "connect/timeout_ms": _CONNECT_MS,
            "scouting/multicast/enabled": False,
            "transport/link/tx/lease": _LEASE_MS,
            "transport/link/tx/queue/congestion_control/drop/wait_before_drop": _WAIT_US,
        }
        config = zenoh.Config()
        for setting, value in settings.items():
            config.insert_json5(setting, json.dumps(value))
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            # Zenoh adds the lines of its own source.
            why = re.sub(r" at \S+\.rs:\d+\.?", "", str(error))
            if "Timeout" in why:
                why = f"nobody answers at {', '.join(connect)}: does taxel bridge run there, and is the port open?"
            raise DeviceError(f"bridge: {why}") from None
        self._name, self._key, self._say, self._warned = name, f"taxel/{name}", say, False

    def publish(self, host: str, port: int, seconds: float | None = None) -> int:
        """Carry what arrives at a UDP port of this computer; return how many datagrams were carried.

        Raises
        ------
        DeviceError : the port is taken
        """
        carried, until = 0, _until(seconds)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board, closing(self._session):
            board.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _KERNEL_BUFFER_BYTES)
            try:
                board.bind((host, port))
            except OSError as error:
                raise DeviceError(f"UDP {host}:{port}: {(error.strerror or str(error)).lower()}") from None
            board.settimeout(_LOOK_S)
            publisher = self._session.declare_publisher(
                f"{self._key}/datagram", congestion_control=zenoh.CongestionControl.DROP
            )
            self._watch("publish", "receive", "a receiver")
            self._say(f"listening on UDP {host}:{board.getsockname()[1]}; Ctrl-C ends")
            try:
                while time.monotonic() < until:
                    try:
                        datagram = board.recv(65_535)
                    except TimeoutError:
                        continue
                    publisher.put(datagram)
                    carried += 1
            except KeyboardInterrupt:
                pass
        return carried

    def receive(self, port: int, seconds: float | None = None) -> int:
        """Send the board's datagrams to a UDP port of this computer; return how many were sent."""
        sent, until = 0, _until(seconds)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as here, closing(self._session):

            def arrived(sample: zenoh.Sample) -> None:
                nonlocal sent
                datagram = sample.payload.to_bytes()
                here.sendto(datagram, ("127.0.0.1", port))
                sent += 1
                if not self._warned and datagram and datagram[0] & 0x80:
                    self._warned = True
                    self._say("version 1 of the wire has no numbers: losses on the way are not counted")

            self._say(f"sending board {self._name} to UDP 127.0.0.1:{port}; Ctrl-C ends")
            self._datagrams = self._session.declare_subscriber(f"{self._key}/datagram", arrived)
            # After the subscription, so that a board's computer that knows of this end reaches it.
            self._watch("receive", "publish", "the board's computer")
            try:
                while time.monotonic() < until:
                    time.sleep(_LOOK_S)
            except KeyboardInterrupt:
                pass
        return sent

    def _watch(self, own: str, other: str, noun: str) -> None:
        """Show this end to the other ones, and say when one of them comes and goes."""

        def told(sample: zenoh.Sample) -> None:
            came = sample.kind == zenoh.SampleKind.PUT
            self._say(f"{noun} is connected" if came else f"LOST: {noun} has ended, or cannot be reached")

        liveliness = self._session.liveliness()
        self._token = liveliness.declare_token(f"{self._key}/{own}/{self._session.zid()}")
        self._ends = liveliness.declare_subscriber(f"{self._key}/{other}/*", told, history=True)


def _until(seconds: float | None) -> float:
    return float("inf") if seconds is None else time.monotonic() + seconds
