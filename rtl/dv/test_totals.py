"""The totals that the simulated logic answers a write of 9 to REG6 with, against what the emulated board counts."""

import numpy as np

from pair import Pair
from scenes import TOTALS, answered_and_counted
from taxel.wire import Command, Decoder


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
