"""The drive of lines: whatever the chain holds at first and whatever is named when, in time a single line is driven."""

import random

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import begin, reset, settled
from models import Chain


@cocotb.test()
async def in_time_a_single_line_is_driven(dut):
    columns, half = int(dut.COLUMNS.value), int(dut.HALF.value)
    chain = Chain([random.getrandbits(1) for _ in range(columns)])
    await begin(dut, next=0, start=0)
    level = data = pulses = 0
    level_stood = data_stood = half

    async def clock():
        """Run for a clock, and look at what stood how long; count the pulses."""
        nonlocal level, data, pulses, level_stood, data_stood
        await FallingEdge(dut.clk)
        await settled()
        was, level = level, int(dut.csel_clk.value)
        assert was == level or level_stood >= half
        level_stood = level_stood + 1 if was == level else 1
        held, data = data, int(dut.csel_din.value)
        assert not (was and level) or held == data
        data_stood = data_stood + 1 if held == data else 1
        if level and not was:
            pulses += 1
            assert data_stood > half
        chain.follow(level, data)

    lines = at = known = 0
    jumps = cut = 0
    for k in range(300):
        if k % 100 == 0:
            if k:
                await reset(dut, next=0, start=0)
                level = data = chain.clock = 0
                level_stood = data_stood = half
            # After a reset the whole chain is shifted through.
            for _ in range(2 * half * columns + 2):
                await clock()
            assert chain.places == [0] * columns
            known, at, whole = -1, columns, True
        if k % 100 == 0 or random.random() < 0.1:
            lines = random.choice([1, columns, random.randrange(1, columns + 1)])
        line = random.choice([0, lines - 1, (at + 1) % lines, random.randrange(lines)])
        dut.next.value, dut.line.value, dut.lines.value = 1, line, lines - 1
        await clock()
        dut.next.value, dut.line.value, dut.lines.value = 0, random.randrange(128), random.randrange(128)
        pulses = 0
        early = random.choice([4, half + 3, random.randrange(4, half + 9)])
        for _ in range(early - 1):
            await clock()
        assert pulses == 0
        # It rises with the clock behind the start, where data and clock have stood.
        late = max(0, half - min(level_stood, data_stood))
        dut.start.value = 1
        await clock()
        dut.start.value = 0
        on = whole and at < line and lines <= known
        out = lines - at if at < lines else 0
        needed = line - at if on else max(out, line + 1)
        if whole:
            assert level == (late == 0)
            left = late + 2 * half * needed - half
            jumps += 1
        else:
            left = 2 * half * columns + half + 4
        whole = random.random() < 0.8
        if whole:
            for _ in range(left):
                await clock()
            assert not level
            assert chain.driven(lines) == [line], k
            at, known = line, lines
            for _ in range(random.choice([0, half, random.randrange(half + 3)])):
                await clock()
        else:
            # The next line comes before this one is driven alone.
            cut += 1
            at = line
            for _ in range(random.randrange(left)):
                await clock()
    assert jumps > 150
    assert cut > 20


@pytest.mark.parametrize("build", ["COLUMNS=9", "COLUMNS=6 HALF=3", "COLUMNS=5 HALF=1"])
def test_line_select(simulate, build):
    simulate(build)
