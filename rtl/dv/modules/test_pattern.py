"""The pattern: each taxel's value in each frame since it began, as docs/registers.md has it."""

import random

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import begin, clocks, reset, settled, within
from models import Ball
from structs import pack

#: Frames that are jumped to: the counter's limits, and those at which the ball crosses an edge of 64 taxels.
LIMITS = (1, 2047, 16383, 65535)


@cocotb.test()
async def values_are_those_of_the_page(dut):
    columns, rows, bits = (int(dut[name].value) for name in ("COLUMNS", "ROWS", "ROW_BITS"))
    ball, ramp, above = Ball(columns, rows), 150, 0
    await begin(dut, step_end=0, read_done=0)
    for frame in range(300):
        if frame == 150:
            # A reset ends the pattern, and so the count of its frames.
            await reset(dut)
            ball = Ball(columns, rows)
        if frame % 10 == 0:
            ramp = random.choice([1, 127, 128, 129, 150, within(1, 65534)])
        rolls = random.random() < 0.97
        if rolls and ball.n is not None and random.random() < 0.5:
            # Waiting for so many frames would take too long.
            ball.n = within(0, 65535, *LIMITS)
            dut.n.value = ball.n
            await FallingEdge(dut.clk)
        ball.frame(rolls)
        lines = random.sample(range(columns), min(columns, 3))
        # Of a line where the ball is, too.
        if rolls:
            lines[-1] = ball.n // 256 % ball.columns % columns
        for k, line in enumerate(lines):
            dut.read.value = pack("read_t", frame_first=int(k == 0), pattern=int(rolls), line=line, ramp=ramp)
            dut.step_end.value = 1
            await FallingEdge(dut.clk)
            dut.step_end.value, dut.read.value = 0, random.getrandbits(len(dut.read))
            await clocks(dut.clk, random.randrange(2, 5))
            dut.read_done.value = 1
            await FallingEdge(dut.clk)
            dut.read_done.value = 0
            near = ball.n // 32 % ball.rows % rows if rolls else 0
            for row in [near, *random.choices(range(rows), k=20)]:
                dut.row.value = row
                await FallingEdge(dut.clk)
                dut.row.value = random.getrandbits(bits)
                await settled()
                if rolls:
                    expected = ball.value(line, row, ramp)
                    assert int(dut.value.value) == expected, (ball.n, line, row, ramp)
                    above += expected > 0
    assert above > 300


@pytest.mark.parametrize("build", ["", "COLUMNS=5 ROWS=7", "COLUMNS=128 ROWS=128 ROW_BITS=7", "COLUMNS=1 ROWS=1"])
def test_pattern(simulate, build):
    simulate(build)
