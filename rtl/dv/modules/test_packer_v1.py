"""The packer of version 1: words of docs/wire.md, in datagrams that end with their frame or where there is no room."""

import random
from collections import deque

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import Pace, Sink, begin, clocks, settled, vary, within
from models import datagrams_1, words_1
from structs import NUMBERS, pack


def drawn(frames, valued, most):
    """Return entries of the queue, each with its frame, and the datagrams that they are."""
    entries, expected = [], []
    for k in range(frames):
        frame, words, time = k & 1, [], random.randrange(1 << 16)
        spikes = random.random() < 0.3
        words_each = 2 if valued or spikes else 1
        # As many as a datagram holds come in some frames: its last one may fill it, or find no room.
        full = within(most // words_each - 1, most // words_each + 1)
        for _ in range(random.choice([1, 1, 2, 5, 12, full if random.random() < 0.1 else 3])):
            x, y, more = random.randrange(64), random.randrange(64), random.getrandbits(1)
            value, marker = random.randrange(1 << 16), random.random() < 0.1
            kind = NUMBERS["ENTRY_MARKER" if marker else "ENTRY_EVENT"]
            form = {"spikes": spikes, "frame_sync": 1}
            if marker:
                x = y = 0
            entries.append(
                (frame, pack("event_t", kind=kind, format=form, frame=frame, at=time, x=x, y=y, more=more, value=value))
            )
            with_value = (valued or spikes) and not marker
            words.append(words_1(x, y, more, time, value if with_value else None, marker=marker))
        expected.append(words)
    return entries, expected


@cocotb.test()
async def events_become_words_in_datagrams(dut):
    most, valued = int(dut.MOST.value), bool(int(dut.VALUED.value))
    push_pace, ready_pace, link_pace = Pace(), Pace(), Pace()
    await begin(dut, ready=0, allowed=1, empty=1, frame=0, tready=0)
    queue = deque()
    entries, expected = drawn(300, valued, most)
    expected = [datagram for words in expected for datagram in datagrams_1(words, most)]
    entries, last = deque(entries), entries[-1][0]
    cocotb.start_soon(vary(dut.clk, 400, push_pace, ready_pace, link_pace))

    sink = Sink(dut, link_pace)
    # The queue: what is pushed comes to its output later; `frame` is that of the events to come.
    shown = False
    frame = since = 0
    began = False
    while since < 200:
        if queue and not shown:
            shown = ready_pace()
        dut.ready.value, dut.empty.value, dut.frame.value = int(shown), int(not queue), frame
        # With an entry of the other version there the datagram ends: here only where its frame does.
        dut.allowed.value = int(shown)
        if shown:
            dut.oldest.value = queue[0]
        await settled()
        # A byte stands the clock after an event was taken.
        assert int(dut.tvalid.value) or not began
        began = bool(int(dut.pop.value))
        if began:
            assert shown
            queue.popleft()
            shown = False
        if entries and push_pace() and entries[0][0] == frame:
            queue.append(entries.popleft()[1])
        elif not entries:
            frame = last ^ 1
        elif entries[0][0] != frame and random.random() < 0.3:
            frame = entries[0][0]
        since = 0 if entries or queue else since + 1
        await FallingEdge(dut.clk)
    while int(dut.busy.value):
        link_pace.often = 1.0
        await FallingEdge(dut.clk)
    await clocks(dut.clk, 3)
    assert sink.datagrams() == expected
    assert not sink.active


@pytest.mark.parametrize("build", ["MOST=7", "VALUED=0 MOST=280"])
def test_packer_v1(simulate, build):
    simulate(build)
