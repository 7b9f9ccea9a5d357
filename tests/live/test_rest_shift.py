"""Whether the taxels rest elsewhere after a gap: told live and on the page until they are zeroed."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import numpy as np
from loopback import until
from numpy.typing import NDArray

from live.boards import LOOPBACK
from taxel.detect import PlainRule
from taxel.live import Live

SHAPE = (6, 6)


@contextlib.contextmanager
def unplugged(shift: NDArray[np.float64]) -> Iterator[str]:
    """Yield the address of a mat that rests, is silent for more than a second, and then rests this much elsewhere."""
    over = threading.Event()
    with socket.create_server((LOOPBACK, 0)) as server:

        def serve() -> None:
            rng = np.random.default_rng(4)
            with contextlib.suppress(OSError):
                connection, _ = server.accept()
                with connection:
                    for k in range(3000):
                        if k == 150:
                            time.sleep(1.3)
                        frame = 500 + shift * (k >= 150) + rng.integers(-1, 2, SHAPE)
                        connection.sendall((",".join(f"{value:.0f}" for value in frame.flat) + "\n").encode())
                        if over.wait(0.01):
                            break

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"{LOOPBACK}:{server.getsockname()[1]}"
        finally:
            over.set()
            thread.join(10)


def test_a_rest_that_shifted_in_a_gap_is_told_until_the_taxels_are_zeroed() -> None:
    shift = np.where(np.arange(36).reshape(SHAPE) < 20, 32.0, 0.0)
    rule = PlainRule("total", 200.0, 0.6, noise_floor=8.0, unit="counts")
    with (
        unplugged(shift) as address,
        Live(sources=f"lines+tcp:{address},array=6x6,rate=100", readout=rule, tare=0.5) as live,
    ):
        assert live.counters["rest_shift"] is None
        until(lambda: live.counters["rest_shift"] is not None)
        line = live.counters["rest_shift"]
        assert " s, the rest of 20 of 36 taxels differs from the tare by up to 3" in line
        assert line.endswith(
            "remove everything from the sensor, then click Zero all on the page, or start again with --tare SECONDS"
        )
        seen = live.counters["frames"]
        until(lambda: live.counters["frames"] > seen + 30)
        zeroed = live.zero(*np.indices(SHAPE)[::-1].reshape(2, -1))
        assert live.counters["rest_shift"] is None
        # The noise is 1, and the middle of twenty frames is nearer to the rest than one of them.
        rests = np.array([zeroing.rest for zeroing in zeroed]).reshape(SHAPE)
        assert np.sqrt(np.mean((rests - 500 - shift) ** 2)) < 0.5
