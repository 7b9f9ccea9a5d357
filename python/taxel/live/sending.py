"""Sends datagrams as a board does, to test or measure a receiver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel import _core
from taxel._base.arguments import flag, integer, number, several, shown, text
from taxel._core import ProblemError
from taxel.wire import FRAME_US

#: Where the board's datagrams go (reading: the thesis names no port).
PORT = 5208


def send(
    datagrams: Sequence[bytes],
    host: str = "127.0.0.1",
    port: int = PORT,
    *,
    each: int = 1,
    period_us: float = FRAME_US,
    seconds: float = 1.0,
    segment: bool = True,
) -> dict[str, Any]:
    """Send datagrams repeatedly, `each` of them every `period_us`, for `seconds`; return counts of what was sent.

    To test or measure a receiver.

    Parameters
    ----------
    datagrams : sequence of bytes, one or more
        Their payloads.
    host : str
        The machine to send to, by name or address.
    port : int, 1 to 65535
        The UDP port to send to.
    each : int, 1 or more
        Number of datagrams sent at a time.
    period_us : float, us, 0 or more
        Interval between two times; 0: as fast as possible. Default: a frame.
    seconds : float, s
        Duration.
    segment : bool
        Pass trains of datagrams to the kernel in one call if it can cut them (`UDP_SEGMENT`).

    Returns
    -------
    dict : messages (send calls), datagrams, bytes, segmenting

    Raises
    ------
    OSError : the system refuses to send
    ProblemError : arguments that are invalid

    Examples
    --------
    >>> send([bytes.fromhex("c000050304")], "127.0.0.1", 9, seconds=0.0)["datagrams"] >= 0
    True
    """
    return _core.send(
        text("host", host),
        integer("port", port, 1, 65_535),
        [_datagram(n, d) for n, d in enumerate(several("datagrams", datagrams))],
        integer("each", each, 1, 2**31 - 1),
        number("period_us", period_us),
        number("seconds", seconds),
        flag("segment", segment),
    )


def _datagram(n: int, data: object) -> bytes:
    if not isinstance(data, bytes | bytearray | memoryview):
        raise ProblemError(f"datagram {n} is {shown(data)}: must be bytes")
    return bytes(data)
