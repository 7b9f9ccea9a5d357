"""The logic beside the emulated board: the same trip times and writes for both."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from typing import Any

import numpy as np

from logic import WRITE_CLOCKS, Logic
from taxel import Array
from taxel.simulate import NOT_RETURNED, Board, Version2
from taxel.wire import Command, Registers

#: Values of `previous` and `intensity` of the emulated board as parameters of the logic.
PREVIOUS = {"last_sent": {}, "last_sample": {"PREVIOUS_SAMPLE": 1}}
INTENSITY = {"value": {}, "difference": {"DIFFERENCE": 1}, "nothing": {"VALUED": 0}}


def drawing(seed: int | None, *build: int) -> np.random.Generator:
    """Return what a test draws by, for such a build; without a seed another one each time, which is printed."""
    if seed is None:
        seed = secrets.randbelow(1 << 31)
    print(f"seed {seed}")
    return np.random.default_rng([*build, seed])


def session(ticks: Any, channels: int, ramp: int) -> int:
    """Return the number of a session whose frame before time 0 had these trip times: shape (rows, columns)."""
    rows, columns = ticks.shape
    steps = -(-max(rows, 64) // channels)
    crc = 0xFFFF_FFFF
    for x in range(columns):
        for y in (steps * channel + step for step in range(steps) for channel in range(channels)):
            if y >= rows:
                continue
            count = int(ticks[y, x])
            for byte in (count if count == NOT_RETURNED else min(count, ramp)).to_bytes(2, "little"):
                crc ^= byte
                for _ in range(8):
                    crc = crc >> 1 ^ 0x82F6_3B78 * (crc & 1)
    return ~crc & 0xFFFF


def answers(serial: str) -> str:
    """Return the whole lines that are no lines of faults."""
    lines = serial.splitlines(keepends=True)
    return "".join(line for line in lines if line.endswith("\n") and not line.startswith("fault"))


class Pair:
    """The logic and the emulated board, both at the start of a frame.

    Parameters
    ----------
    columns, rows, channels : int
    previous, intensity : str
        As of the emulated board.
    first : uint16, shape (rows, columns), ticks, optional
        Trip times of the frame before time 0, of which the session has its number.
    version_2 : mapping, optional
        Options of the emulated board's `Version2`, without its seed.
    **parameters : int
        Others of `Logic`.
    """

    def __init__(
        self,
        columns: int,
        rows: int,
        channels: int = 16,
        *,
        previous: Any = "last_sent",
        intensity: Any = "value",
        first: Any = None,
        version_2: dict[str, int] | None = None,
        **parameters: Any,
    ) -> None:
        self.array = Array(rows, columns)
        self.version_2 = version_2 or {}
        named = {name.upper(): value for name, value in self.version_2.items()}
        options = PREVIOUS[previous] | INTENSITY[intensity] | {"FAULT_CLOCKS": 5000} | named | parameters
        self.logic = Logic(columns, rows, channels, **options)
        self.csel_clocks = parameters.get("CSEL_CLOCKS", 8)
        self.options = {"previous": previous, "intensity": intensity, "queue": 1 << 30}
        self.registers = Registers(array=self.array, channels=channels)
        self.begin(np.zeros((rows, columns), np.uint16) if first is None else first)

    def begin(self, first: Any) -> None:
        """Begin a session: a new emulated board, and the logic after a reset and the frame before time 0."""
        seed = session(first, self.registers.channels, self.registers.ramp)
        version_2 = Version2(seed=seed, **self.version_2)
        self.board = Board(self.registers, self.array, version_2=version_2, **self.options)
        self.expected: list[bytes] = []
        self.received: list[bytes] = []
        self.answers = self.board.greeting
        self.serial = ""
        #: The command that was sent and that the emulated board has not got yet: it acts at a frame's edge.
        self.waits = b""
        self.logic.call("invert", 0)
        self.logic.call("lines", self.registers.lines)
        self.logic.ticks(first)
        self.logic.edge()
        self.logic.edge()

    def reset(self, first: Any) -> None:
        """Reset the logic; nothing of the session before comes any more."""
        self.logic.reset()
        self.begin(first)

    def frame(self, ticks: Any, data: bytes = b"", after: int = 0) -> None:
        """Scan a frame; in it, `after` clocks from its edge on, the host begins to send one command."""
        if self.waits and self.logic.call("sent_at") + WRITE_CLOCKS <= self.logic.call("edge"):
            self.answers += self.board.command(self.waits)
            self.waits = b""
        self.logic.call("invert", int(self.board.registers.invert_comparator))
        self.logic.call("lines", self.board.registers.lines)
        self.expected += self.board.frame(np.asarray(ticks, np.uint16))
        self.logic.ticks(ticks)
        if data:
            if self.waits or self.logic.run(after):
                raise ValueError("one command at a time, begun within the frame")
            self.logic.send(data)
            self.waits = data
        self.logic.edge()
        self.received += self.logic.datagrams()
        self.serial += self.logic.serial()

    def write(self, commands: Iterable[Command]) -> None:
        """Write registers of both, one after the other, in quiet frames."""
        still = np.zeros(self.array.shape, np.uint16)
        for command in commands:
            self.frame(still, command.to_bytes())
            while not self.answered:
                self.frame(still)

    @property
    def answered(self) -> bool:
        """Whether no command is on its way, nor an answer."""
        return not self.waits and self.answers == answers(self.serial)

    @property
    def agrees(self) -> bool:
        """Whether the logic sent what the emulated board did, but for the last few that may still be on their way."""
        count = len(self.received)
        return self.received == self.expected[:count] and len(self.expected) - count < 4

    def finish(self) -> None:
        """Scan quiet frames until everything was sent."""
        still = np.zeros(self.array.shape, np.uint16)
        self.frame(still)
        while not self.answered:
            self.frame(still)
        self.logic.edge()
        self.received += self.logic.datagrams()
        # A link that is behind catches up.
        for _ in range(200):
            if len(self.received) >= len(self.expected):
                break
            self.frame(still)
        # Status lines end when all of them are out, and a line of faults may follow.
        until = self.logic.call("clock") + 40_000
        while self.logic.call("clock") < until:
            self.logic.run(4000)
        self.serial += self.logic.serial()
