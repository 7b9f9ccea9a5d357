"""The order of lines: as docs/readings.md draws it, over frames of all lengths, in order or not, and after resets."""

import random

import cocotb
from cocotb.triggers import FallingEdge

from drivers import begin, clocks, reset
from models import Lines


@cocotb.test()
async def lines_come_in_the_order_that_is_drawn(dut):
    await begin(dut, next=0, first=0, random=0, lines=0)
    model = Lines()
    for frame in range(60):
        if frame % 25 == 24:
            await reset(dut, next=0)
            model = Lines()
        lines, shuffled = random.choice([1, 2, 3, 17, 64, 128]), random.random() < 0.7
        dut.random.value, dut.lines.value = int(shuffled), lines - 1
        for k, line in enumerate(model.order(lines, shuffled)):
            dut.next.value, dut.first.value = 1, int(k == 0)
            await FallingEdge(dut.clk)
            dut.next.value = 0
            dut.first.value = random.getrandbits(1)
            await clocks(dut.clk, 6 + random.choice([0, 0, 6]))
            assert int(dut.line.value) == line, (frame, k)


def test_random_lines(simulate):
    simulate()
