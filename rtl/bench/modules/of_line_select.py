"""The drive of lines: whatever the chain holds at first, in time a single one of the frame's lines is driven."""

import random

import cocotb
from cocotb.triggers import FallingEdge
from drivers import begin, reset, settled
from models import Chain


@cocotb.test()
async def in_time_a_single_line_is_driven(dut):
    columns, half = int(dut.COLUMNS.value), int(dut.HALF.value)
    await begin(dut, start=0)
    chain = Chain([random.getrandbits(1) for _ in range(columns)])
    lines, at, known = columns, 0, 0
    levels = [0, 0]

    async def clock():
        # Data stand half a pulse before the clock rises, and while it is high.
        before = [int(dut.csel_clk.value), int(dut.csel_din.value)]
        await FallingEdge(dut.clk)
        await settled()
        levels[:] = now = [int(dut.csel_clk.value), int(dut.csel_din.value)]
        chain.follow(*now)
        assert not now[0] or now[1] == before[1]

    for k in range(300):
        if k % 100 == 99:
            await reset(dut, start=0)
            chain.clock = known = 0
        if k % 100 == 0 or random.random() < 0.1:
            lines = random.randrange(1, columns + 1)
        line = random.randrange(lines)
        dut.start.value, dut.line.value, dut.lines.value = 1, line, lines - 1
        await clock()
        dut.start.value, dut.line.value, dut.lines.value = 0, random.randrange(128), random.randrange(128)
        # Two halves a pulse, one more where a new one goes in, and two clocks.
        on = at < line < lines <= known
        pulses = columns if lines > known else line - at if on else max(lines - at, line + 1)
        for left in reversed(range((2 * pulses + (not on)) * half + 2 - 1)):
            await clock()
            assert levels[0] == (left > 0) or left > half
        assert chain.driven(lines) == [line], k
        at, known = line, lines
        for _ in range(random.randrange(4)):
            await clock()
            assert not levels[0]
