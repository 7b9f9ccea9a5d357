"""When lines and totals are repeated: all lines once in EVERY clocks, however many, each said at a frame's start."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def all_lines_come_due_once_in_so_many_clocks(dut):
    every = int(dut.EVERY.value)
    Clock(dut.clk, 10, "ns").start()
    dut.zero.value, dut.frame_start.value = 0, 0
    for _ in range(random.randrange(1, 3000)):
        await FallingEdge(dut.clk)
    lines = totals = due = quiet = 0  # clocks times lines, and clocks, since time 0
    came = [False, False]
    for clock in range(20_000):
        if clock == 0 or random.random() < 0.01:
            number = random.choice([1, 2, 17, 64, 128])
            dut.zero.value, dut.frame_start.value, dut.lines.value = int(clock == 0), 1, number - 1
            if clock:
                assert [int(dut.line_due.value), int(dut.totals_due.value)] == came
                due, quiet = due + came[0], quiet + (not came[0])
            came = [False, False]
        else:
            dut.zero.value, dut.frame_start.value = 0, 0
        lines, totals = lines + number, totals + 1
        came = [came[0] or lines >= every, came[1] or totals >= every]
        lines, totals = lines % every, totals % every
        await FallingEdge(dut.clk)
    assert due > 50
    assert quiet > 10


def test_refresh(simulate):
    simulate("EVERY=1000")
