"""Scenes that tests play to the logic and the emulated board, and those by which planted faults are looked for."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from pair import Pair, answers
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command, Registers

#: Seeds of random pressures and writes: another one each time, and those that once failed.
SEEDS = [None]
#: Options of version 2 with which each kind of datagram comes within few frames.
OFTEN = {"board": 513, "states_us": 700, "heartbeat_us": 60}
TOTALS = re.compile(r"status frames=(\d+) events=(\d+) dropped=(\d+) datagrams=(\d+) faults=(\d+)")


def pressures(rng: np.random.Generator, pair: Pair, before: np.ndarray) -> np.ndarray:
    """Return trip times of the next frame: some move, by little or by much, or to the edges of the ramp."""
    ramp = pair.board.registers.ramp
    ticks = before.copy()
    moves = rng.random(ticks.shape) < rng.choice([0.0, 0.05, 0.5, 1.0])
    near = np.clip(ticks.astype(int) + rng.integers(-6, 7, ticks.shape), 0, 65_534)
    drawn = rng.choice([0, 1, 2, ramp - 1, ramp, ramp + 1, ramp + 2, 60_000], ticks.shape)
    far = rng.integers(0, ramp + 1, ticks.shape)
    chosen = np.where(rng.random(ticks.shape) < 0.5, near, np.where(rng.random(ticks.shape) < 0.2, drawn, far))
    ticks[moves] = chosen.clip(0, 65_534)[moves]
    ticks[rng.random(ticks.shape) < 0.01] = NOT_RETURNED
    return ticks


def write(rng: np.random.Generator, pair: Pair, in_version_2: float = 0.0) -> bytes:
    """Return a command: a register of a set that holds all rules, a bit of one that was flipped, or a read.

    A write of REG0 chooses version 2 of the wire with the given probability.
    """
    held = pair.board.registers
    kind = rng.choice(["timing", "floor", "flags", "record", "nonsense", "read"])
    if kind == "record":
        return Command(7, int(rng.integers(0, 2)) << 16).to_bytes()
    if kind == "floor":
        lines = int(rng.integers(0, pair.array.columns + 1))
        return Command(5, lines << 16 | int(rng.choice([0, 1, 3, 10, 255])) << 8).to_bytes()
    if kind == "flags":
        return Command(0, int(rng.integers(0, 16)) & ~2 | (rng.random() < in_version_2) << 4).to_bytes()
    if kind == "read":
        return Command(6, int(rng.integers(0, 9))).to_bytes()
    if kind == "nonsense":
        # Not the high bits of the line's period: frames would last for minutes.
        number = int(rng.choice([1, 2, 3, 4, 5, 7]))
        return Command(number, held.words[number] ^ 1 << int(rng.integers(0, 9 if number == 1 else 32))).to_bytes()
    least = held.channels + 10
    step_period = int(rng.integers(least, least + 80))
    step_read = step_period - int(rng.choice([1, 2, 20, 20, least - 1, 0]))
    steps = -(-max(pair.array.rows, 64) // held.channels)
    line_read = steps * step_period + int(rng.integers(0, 40))
    line_period = line_read + int(rng.choice([0, 1, 17, 300]))
    longest = 3 * round(100 * held.step_read)
    ramp = int(rng.choice([1, 2, longest - 5, longest - 1, longest, rng.integers(1, longest)]))
    number = int(rng.integers(1, 5))
    values = {1: line_period, 2: line_read, 3: max(step_read, 1) << 16 | step_period, 4: ramp}
    return Command(number, values[number]).to_bytes()


def clocks(registers: Registers) -> int:
    """Return how many clocks a frame takes."""
    return round(registers.frame_us * 100)


def settles(pair: Pair, command: bytes) -> bool:
    """Return whether the analogue side can follow a write.

    In random order, and where there are more lines than before, the whole chain may be shifted through before a read.
    """
    written, held = Command.from_bytes(command), pair.board.registers
    words = list(held.words)
    words[written.register] = written.value
    more = written.register == 5 and (written.value >> 16 & 0xFF) + 1 > held.lines
    settling = (words[3] & 0xFFFF) - (words[3] >> 16)
    shifts = more or held.random_lines or words[0] & 1
    return not shifts or settling > 2 * pair.csel_clocks * pair.array.columns + 4


def last_faults(lines: str) -> dict[str, int]:
    """Return the counts of the last line of each kind of fault."""
    return {line.split()[1]: int(line.split()[2]) for line in lines.splitlines() if line.startswith("fault")}


def in_version_2(pair: Pair) -> None:
    """Let both boards send version 2."""
    pair.write([Command(0, 0b11000)])
    assert pair.board.registers.wire_version == 2


def answered_and_counted(pair: Pair, frames: int) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Ask in each of some frames; return what the logic answers and what was counted at the frame's edge."""
    rng = np.random.default_rng(21)
    counted, text = [], ""
    # A link that does not accept a byte in each clock.
    pair.logic.call("link", 200)
    for frame in range(frames):
        counts = pair.board.counts
        events = counts["changes"] - counts["dropped"]
        counted.append((counts["frames"], events, counts["dropped"], len(pair.received), counts["not_returned"]))
        pair.logic.send(Command(6, 9).to_bytes())
        # In some frames no taxel changes, in others the one that is read last does.
        ticks = rng.integers(0, 150, pair.array.shape).astype(np.uint16) * np.uint16(frame % 4 > 1)
        ticks[-1, -1] = 50 + frame
        ticks[rng.random(ticks.shape) < 0.05] = NOT_RETURNED
        # A marker of a recording is no event.
        pair.frame(ticks, Command(7, frame % 2 << 16).to_bytes(), 900)
        # One answer a frame: a line takes longer on the serial line than a frame does.
        still = ticks.copy()
        while not (pair.serial[len(text) :].endswith("\n") and pair.serial.count("status") == len(counted)):
            pair.frame(still)
    return [tuple(map(int, found)) for found in TOTALS.findall(pair.serial)], counted


def differs(source: Path) -> bool:
    """Play frames of version 1, with writes around their edges; return whether the logic differs from the board."""
    pair = Pair(8, 8, source=source)
    rng = np.random.default_rng(3)
    writes = [
        Command(0, 0), Command(5, 7 << 16), Command(4, 33), Command(7, 1 << 16), Command(7, 1 << 16), Command(0, 4),
        Command(5, 7 << 16 | 20 << 8), Command(0, 8), Command(1, 1777), Command(7, 0), Command(5, 7 << 16),
    ]  # fmt: skip
    ticks = np.zeros((8, 8), np.uint16)
    for k in range(120):
        moved = rng.integers(-4, 5, (8, 8)) + np.where(rng.random((8, 8)) < 0.3, rng.integers(-99, 99, (8, 8)), 0)
        ticks = np.clip(ticks.astype(int) + moved, 0, 160).astype(np.uint16)
        sent = ticks.copy()
        sent[rng.random((8, 8)) < 0.02] = NOT_RETURNED
        command = writes.pop(0).to_bytes() if writes and pair.answered and k > 3 else b""
        # Some are complete around the last clock at which a write acts in the next frame.
        frame = round(pair.board.registers.frame_us * 100)
        at = frame - 420 + int(rng.integers(-6, 7)) if command else 0
        if not command and pair.answered and k > 60:
            # In the middle of a frame: the noise floor must not change before its end.
            command, at = Command(5, 7 << 16 | (5 if k % 2 else 60) << 8).to_bytes(), frame // 4
        pair.frame(sent, command, at)
    for _ in range(40):
        pair.frame(np.zeros((8, 8), np.uint16))
    same = pair.received == pair.expected[: len(pair.received)] and len(pair.expected) - len(pair.received) <= 2
    return not (same and answers(pair.serial) == pair.answers)


def differs_in_version_2(source: Path) -> bool:
    """Play frames of version 2; return whether the logic differs from the emulated board."""
    rng = np.random.default_rng(4)
    first = rng.integers(0, 150, (64, 3)).astype(np.uint16)
    pair = Pair(3, 64, source=source, first=first, version_2=OFTEN)
    held = pair.board.registers
    parts = [
        [],
        [Command(0, 0b11000)],
        [Command(4, 160)],
        [Command(0, 0b10000)],
        held.with_preset("2 kHz"),
        [Command(0, 0b11000)],
        [Command(4, 200)],
        [Command(0, 8)],
    ]
    for part in parts:
        pair.write(part if isinstance(part, list) else pair.board.registers.commands_to(part))
        for _ in range(30):
            moved = rng.random((64, 3)) < rng.choice([0.0, 0.02, 0.5])
            pair.frame(np.where(moved, rng.integers(0, 600, (64, 3)), 0).astype(np.uint16), b"")
    pair.finish()
    return not (pair.agrees and answers(pair.serial) == pair.answers)


def differs_in_spikes(source: Path, intensity: str) -> bool:
    """Play frames of afferents; return whether the logic differs from the emulated board."""
    rng = np.random.default_rng(7)
    pair = Pair(3, 64, source=source, intensity=intensity, version_2=OFTEN)
    spikes = 983 << 16 | 0b01010
    parts = [
        [Command(4, 33 << 16 | 150), Command(5, 2 << 16 | 3 << 8 | 51)],
        [Command(0, spikes)],
        [Command(0, 0b01000)],
        [Command(0, spikes)],
        [Command(4, 400 << 16 | 150)],
        [Command(0, spikes | 0b10000)],
        [Command(0, 0b11000)],
        [Command(0, spikes | 0b10000)],
        [Command(0, 0b11000), Command(4, 150), Command(0, spikes | 0b10000)],
    ]
    ticks = np.zeros((64, 3), np.uint16)
    for part in parts:
        pair.write(part)
        for _ in range(25):
            # Some taxels move by little around the ticks of which the table has an entry that differs in a fault.
            moved = rng.random((64, 3)) < rng.choice([0.0, 0.1, 0.5])
            drawn = np.where(rng.random((64, 3)) < 0.5, rng.integers(54, 60, (64, 3)), rng.integers(0, 150, (64, 3)))
            ticks = np.where(moved, drawn, ticks).astype(np.uint16)
            read = ticks.copy()
            read[rng.random((64, 3)) < 0.05] = NOT_RETURNED
            pair.frame(read)
    pair.finish()
    return not (pair.agrees and answers(pair.serial) == pair.answers)


def differs_in_totals(source: Path) -> bool:
    """Ask for totals; return whether those that the logic of `source` answers are not those that were counted."""
    answered, counted = answered_and_counted(Pair(8, 8, source=source, FAULT_CLOCKS=1 << 30), 8)
    return answered != counted


#: By name: what plays frames to the logic of a folder, and returns whether it differs from the emulated board.
SCENES = {
    "version 1": differs,
    "version 2": differs_in_version_2,
    "totals": differs_in_totals,
    "afferents": partial(differs_in_spikes, intensity="nothing"),
    "afferents, differences": partial(differs_in_spikes, intensity="difference"),
}
