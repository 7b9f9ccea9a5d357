"""The totals that the simulated logic answers a write of 9 to REG6 with, against what the emulated board counts."""

import re

import numpy as np

from pair import Pair
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command, Decoder

TOTALS = re.compile(r"status frames=(\d+) events=(\d+) dropped=(\d+) datagrams=(\d+) faults=(\d+)")


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


def test_quick_totals_are_those_of_the_last_frames_edge():
    answered, counted = answered_and_counted(Pair(8, 8, FAULT_CLOCKS=1 << 30), 12)
    assert answered == counted
    assert counted[-1][0] > 12
    assert min(counted[-1][1], counted[-1][3], counted[-1][4]) > 5


def test_quick_totals_count_what_found_no_room():
    logic = Pair(8, 8, QUEUE=16).logic
    logic.call("link", 0)
    logic.ticks(np.full((8, 8), 50, np.uint16))
    for _ in range(3):
        logic.edge()
    logic.send(Command(6, 9).to_bytes())
    logic.run(2000)
    logic.edge()
    logic.call("link", 256)
    text = logic.serial()
    while "status" not in text or not text.endswith("\n"):
        logic.run(1000)
        text += logic.serial()
    frames, events, dropped, datagrams, faults = map(int, TOTALS.search(text).groups())
    # The bench's three edges, less the initial frame's.
    assert (frames, datagrams, faults) == (3, 0, 0)
    decoder = Decoder()
    logic.run(10_000)
    assert events == 16 + 2 + 1
    assert dropped == 64 - events + 2 * (64 - events)
    assert sum(len(decoder.push(datagram)) for datagram in logic.datagrams()[:1]) == events
