"""The simulated sender of UDP as an object of Python: payloads in, frames of Ethernet out."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from verilated import SOURCES, built

#: Bytes, and frames, that are fetched at once.
ROOM, MOST = 1 << 22, 1 << 16


class Sender:
    """The sender between a core that offers payloads and a PHY.

    Parameters
    ----------
    link_ps : int
        The period of the link's clock; the core's is 10 000 ps.
    phase_ps : int
        When the link's clock first changes.
    seed : int
        Of what registers without a reset hold at first.
    source : path, optional
        A folder of other sources than `rtl/src`: the tests' planted faults.
    **parameters : int
        Of `taxel_udp_sender`.
    """

    def __init__(
        self, *, link_ps: int = 8000, phase_ps: int = 1234, seed: int = 1, source: Path = SOURCES, **parameters: int
    ) -> None:
        self._library = ctypes.CDLL(str(built(source, parameters=parameters, top="taxel_udp_sender", bench="sender")))
        self._library.sender_new.restype = ctypes.c_void_p
        half, phase = ctypes.c_uint64(link_ps // 2), ctypes.c_uint64(phase_ps)
        self._bench = ctypes.c_void_p(self._library.sender_new(seed, half, phase))
        self._data = ctypes.create_string_buffer(ROOM)
        self.run(200, reset=True)
        self.run(200)
        self.frames()

    def run(self, clocks: int, *, reset: bool = False) -> None:
        """Run for so many clocks of the core."""
        self._library.sender_run(self._bench, ctypes.c_uint64(10_000 * clocks), int(reset))

    def offers(self, of_256: int) -> None:
        """Let a byte be offered in so many of 256 clocks."""
        self._library.sender_offers(self._bench, of_256)

    def send(self, payload: bytes) -> None:
        """Let a payload go, after those before."""
        self._library.sender_send(self._bench, payload, len(payload))

    def finish(self) -> None:
        """Run until everything was sent; raise RuntimeError where nothing goes any more."""
        waits, since = self._library.sender_waits(self._bench), 0
        while waits:
            self.run(1000)
            left = self._library.sender_waits(self._bench)
            since = since + 1 if left == waits else 0
            if since == 100:
                raise RuntimeError(f"{left} payloads wait, of which none goes")
            waits = left
        self.run(5000)

    def frames(self) -> list[tuple[bytes, int]]:
        """Return the frames that ended since this was last asked, each with the link's clocks of silence before it."""
        lengths, gaps = np.zeros(MOST, np.uint32), np.zeros(MOST, np.uint32)
        pointers = (values.ctypes.data_as(ctypes.c_void_p) for values in (lengths, gaps))
        count = self._library.sender_frames(self._bench, self._data, *pointers, ROOM, MOST)
        if count < 0:
            raise RuntimeError("more frames than there is room for: ask for them sooner")
        ends = np.cumsum(lengths[:count]).tolist()
        data = ctypes.string_at(self._data, ends[-1] if count else 0)
        starts = [0, *ends]
        return [(data[starts[k] : end], int(gaps[k])) for k, end in enumerate(ends)]
