"""The power law of afferents: each tick of the table, and larger ones, a clock after they were given."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from models import compressed


@cocotb.test()
async def ticks_are_compressed(dut):
    Clock(dut.clk, 10, "ns").start()
    for ticks in [*range(2100), *(random.randrange(1 << 16) for _ in range(200)), 65535]:
        dut.ticks.value = ticks
        await FallingEdge(dut.clk)
        assert int(dut.pressure.value) == compressed(ticks), ticks


def test_power_law(simulate):
    simulate()
