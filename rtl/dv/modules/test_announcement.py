"""A pulse on another clock: each comes once, three or four of that clock's edges later, whatever its phase."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time

from drivers import clocks


@cocotb.test()
async def each_pulse_comes_once(dut):
    came = []

    async def watch():
        while True:
            await RisingEdge(dut.clk_to)
            # As it stands before the edge.
            if int(dut.came.value):
                came.append(get_sim_time("ps"))

    for to_ps in (6666, 10_000, 14_998):
        dut.announce.value, dut.reset_from.value, dut.reset_to.value = 0, 1, 1
        of_from, of_to = Clock(dut.clk_from, 10, "ns"), Clock(dut.clk_to, to_ps, "ps")
        of_from.start()
        await Timer(random.randrange(1, 10_000), "ps")
        of_to.start()
        watching = cocotb.start_soon(watch())
        await clocks(dut.clk_from, 6)
        dut.reset_from.value = 0
        await clocks(dut.clk_from, 6)
        dut.reset_to.value = 0
        came.clear()
        number = 0
        for k in range(150):
            dut.announce.value = 1
            await RisingEdge(dut.clk_from)
            sent = get_sim_time("ps")
            await FallingEdge(dut.clk_from)
            dut.announce.value, number = 0, number ^ 1
            assert int(dut.number.value) == number
            await clocks(dut.clk_from, 8 + random.randrange(4))
            # Seen at the edge behind that at which it came.
            assert len(came) == k + 1
            assert 3 * to_ps < came[-1] - sent <= 4 * to_ps, (came[-1] - sent) / to_ps
        # A reset of both sides in between is no pulse.
        dut.reset_from.value = dut.reset_to.value = 1
        await clocks(dut.clk_from, 6)
        dut.reset_from.value = 0
        await clocks(dut.clk_from, 6)
        dut.reset_to.value = 0
        await clocks(dut.clk_from, 8)
        assert len(came) == 150
        watching.cancel()
        of_from.stop()
        of_to.stop()


def test_announcement(simulate):
    simulate()
