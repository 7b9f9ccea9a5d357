"""Times since time 0: of the frame with its stamps, else of the step, cut down to 100 us and to 1 us."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from drivers import clocks, settled


@cocotb.test()
async def times_are_those_of_the_frame_or_the_step(dut):
    Clock(dut.clk, 10, "ns").start()
    dut.zero.value, dut.frame_start.value, dut.frame_sync.value = 0, 0, 0
    for _ in range(random.randrange(1, 300)):
        await FallingEdge(dut.clk)
    for _ in range(2):
        frame = ended = synchronous = 0
        for now in range(26_000):
            start = now == 0 or random.random() < 0.005
            if start:
                ended, frame, synchronous = now - frame, now, random.getrandbits(1)
            dut.zero.value, dut.frame_start.value, dut.frame_sync.value = int(now == 0), int(start), synchronous
            # A step may start anywhere.
            if start or random.random() < 0.1 or now % 100 in (0, 99):
                await settled()
                at = frame if synchronous else now
                assert int(dut.stamp.value) == at // 10_000
                assert int(dut.micros.value) == at // 100
                if start and now:
                    assert int(dut.ended.value) == ended // 100
            await FallingEdge(dut.clk)


@cocotb.test()
async def stamps_wrap(dut):
    Clock(dut.clk, 10, "ns").start()
    dut.zero.value, dut.frame_start.value, dut.frame_sync.value = 1, 1, 0
    await FallingEdge(dut.clk)
    dut.zero.value, dut.frame_start.value = 0, 0
    await FallingEdge(dut.clk)
    dut.counted.value, dut.clocks.value, dut.counted_us.value = 65535, 9000, (1 << 48) - 5
    for _ in range(998):
        await FallingEdge(dut.clk)
    await settled()
    assert int(dut.stamp.value) == 65535
    await clocks(dut.clk, 2)
    assert int(dut.stamp.value) == 0
    assert int(dut.micros.value) in (4, 5)


def test_time_stamper(simulate):
    simulate()
