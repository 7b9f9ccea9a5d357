"""What is counted since reset, and the totals: what was counted up to the last frame's end, and nothing after it."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

#: Clocks from an input to its count, and from a frame's end to its totals.
COUNTED, TOTALLED = 2, 3


@cocotb.test()
async def totals_are_those_of_whole_frames(dut):
    Clock(dut.clk, 10, "ns").start()
    changed = 0
    for _ in range(5):
        flags = ("event_sent", "queue_lost", "marker_lost", "not_returned", "refused", "datagram", "frame_over")
        for name in (*flags, "skipped"):
            dut[name].value = 0
        dut.reset.value = 1
        await FallingEdge(dut.clk)
        dut.reset.value = 0
        # Frames, events, dropped, datagrams, faults, and bytes and commands refused; after each clock since reset.
        counts, totals = [[0] * 6] * COUNTED, [[0] * 5] * TOTALLED
        for _ in range(1000):
            drawn = {name: int(random.random() < 0.4) for name in flags} | {"skipped": random.randrange(6)}
            drawn["frame_over"] = int(random.random() < 0.1)
            for name, value in drawn.items():
                dut[name].value = value
            lost, commands = drawn["queue_lost"] + drawn["marker_lost"], drawn["skipped"] + drawn["refused"]
            more = [drawn["frame_over"], drawn["event_sent"], lost, drawn["datagram"], drawn["not_returned"], commands]
            counts.append([a + b for a, b in zip(counts[-1], more, strict=True)])
            totals.append(counts[-1][:5] if drawn["frame_over"] else totals[-1])
            await FallingEdge(dut.clk)
            said = [int(count.value) for count in (dut.lost, dut.faults, dut.commands)]
            assert said == [counts[-COUNTED][k] for k in (2, 4, 5)]
            packed = int(dut.totals.value)
            assert [packed >> 48 * (4 - k) & (1 << 48) - 1 for k in range(5)] == totals[-TOTALLED]
            changed += drawn["frame_over"]
    assert changed > 100


def test_totals(simulate):
    simulate()
