"""Run the simulated logic as a board: a pseudo-terminal is its serial line, and datagrams go out by UDP.

It runs far slower than a board: a second of the board takes half a minute and more. Stamps are of the board's time,
as on a board. At rest its comparators trip near a value, with noise.

    .venv/bin/python rtl/dv/serve.py --button       starts with the pattern, as a board whose button was held
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import socket
import sys
import time
import tty
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from logic import Logic
from taxel.simulate import NOT_RETURNED
from verilated import missing

#: Clocks of 10 ns for which it runs before it looks at its serial line again.
CLOCKS = 2000
#: How often it tells where it is, s.
TELLS_S = 10.0


class Board:
    """The logic with comparators at rest, a serial line and a link.

    Parameters
    ----------
    columns, rows, channels : int
    pattern : bool
        Start with the pattern, as a board whose button was held.
    rest, noise : float, ticks
        Where comparators trip, and the standard deviation of that.
    loose : sequence of int
        Sense lines without a comparator: they never trip, as the pins are held low.
    stuck : sequence of int
        Sense lines whose comparators never return.
    seed : int
        Of the noise.
    """

    def __init__(
        self,
        columns: int = 64,
        rows: int = 64,
        channels: int = 64,
        *,
        pattern: bool = False,
        rest: float = 20.0,
        noise: float = 1.0,
        loose: Any = (),
        stuck: Any = (),
        seed: int = 1,
        **parameters: int,
    ) -> None:
        self.logic = Logic(columns, rows, channels, long=True, **parameters)
        self.rest, self.noise = rest, noise
        self.loose, self.stuck = list(loose), list(stuck)
        self.random = np.random.default_rng(seed)
        self.frames = 0
        self.logic.ticks(self.drawn())
        self.logic.reset(pattern=pattern)

    def drawn(self) -> Any:
        """Return when the comparators trip in a frame."""
        ticks = self.random.normal(self.rest, self.noise, self.logic.shape).round().clip(0, 60_000)
        ticks[self.loose] = 60_000
        ticks[self.stuck] = NOT_RETURNED
        return ticks.astype(np.uint16)

    def run(self, commands: bytes = b"") -> tuple[list[bytes], bytes]:
        """Run for some clocks; return the datagrams and the bytes of the serial line that came."""
        if commands:
            self.logic.send(commands)
        if self.logic.run(CLOCKS):
            self.frames += 1
            self.logic.ticks(self.drawn())
        return self.logic.datagrams(), self.logic.serial().encode()


@contextlib.contextmanager
def terminal(path: Path | None) -> Iterator[tuple[int, str]]:
    """Open a pseudo-terminal, under a name if one is given; yield the board's end and the host's name."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    name = os.ttyname(theirs)
    try:
        if path is not None:
            path.symlink_to(name)
        yield ours, str(path or name)
    finally:
        if path is not None:
            path.unlink(missing_ok=True)
        os.close(ours)
        os.close(theirs)


def serve(board: Board, line: int, to: tuple[str, int], until: Any) -> None:
    """Run a board until the event is set, and tell how fast it goes."""
    begun = told = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        while not until():
            commands = b""
            with contextlib.suppress(BlockingIOError):
                commands = os.read(line, 1024)
            datagrams, serial = board.run(commands)
            for datagram in datagrams:
                link.sendto(datagram, to)
            # A line that is not read fills up; as on a board, bytes without room are dropped.
            with contextlib.suppress(BlockingIOError):
                os.write(line, serial)
            now = time.monotonic()
            if now - told >= TELLS_S:
                told, seconds = now, board.logic.call("clock") / 1e8
                print(
                    f"{board.frames} frames, {seconds:.4f} s of the board: 1/{(now - begun) / seconds:.0f} of real time"
                )
                sys.stdout.flush()


def main() -> int:
    """Serve until Ctrl-C; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__.split("\n\n")[0], formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--columns", type=int, default=64)
    parser.add_argument("--rows", type=int, default=64)
    parser.add_argument("--channels", type=int, default=64, choices=(16, 64))
    parser.add_argument("--host", default="127.0.0.1", help="the machine that datagrams go to")
    parser.add_argument("--port", type=int, default=5208)
    parser.add_argument("--line", type=Path, help="a name for the serial line's pseudo-terminal")
    parser.add_argument("--button", action="store_true", help="start with the pattern, as where the button was held")
    parser.add_argument("--rest", type=float, default=20.0, help="where comparators trip, ticks")
    parser.add_argument("--noise", type=float, default=1.0, help="the standard deviation of that, ticks")
    parser.add_argument("--loose", type=int, nargs="*", default=[], help="sense lines without a comparator")
    parser.add_argument("--stuck", type=int, nargs="*", default=[], help="sense lines whose comparators never return")
    given = parser.parse_args()
    if reason := missing():
        print(reason, file=sys.stderr)
        return 3
    ended = False

    def end(*_: object) -> None:
        nonlocal ended
        ended = True

    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    board = Board(
        given.columns, given.rows, given.channels, pattern=given.button, rest=given.rest, noise=given.noise,
        loose=given.loose, stuck=given.stuck,
    )  # fmt: skip
    with terminal(given.line) as (line, name):
        print(f"serial line: {name}; datagrams go to {given.host}:{given.port}; Ctrl-C ends", flush=True)
        serve(board, line, (given.host, given.port), lambda: ended)
    return 0


if __name__ == "__main__":
    sys.exit(main())
