"""Clock division: a pulse every PERIOD clocks, the first PERIOD clocks after a restart, whenever that comes."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def a_pulse_comes_every_period_after_a_restart(dut):
    period = int(dut.PERIOD.value)
    Clock(dut.clk, 10, "ns").start()
    since, pulses = 0, 0
    for clock in range(2000):
        dut.restart.value = restart = int(clock == 0 or random.random() < 0.02)
        await FallingEdge(dut.clk)
        since = 0 if restart else since + 1
        # It is seen at the edge that is so many after the restart's.
        assert int(dut.pulse.value) == int(since % period == period - 1)
        pulses += int(dut.pulse.value)
    assert pulses > 100


def test_clock_div(simulate):
    simulate("PERIOD=7")
