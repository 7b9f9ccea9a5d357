"""Two flip-flops: a bit that changes at any time comes out as it was at the clock's edge before the last one."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer


@cocotb.test()
async def a_bit_comes_out_as_it_was_two_edges_ago(dut):
    Clock(dut.clk, 10, "ns").start(start_high=False)
    taken = []
    for _ in range(2000):
        # It may change anywhere in the half clock before an edge.
        await FallingEdge(dut.clk)
        if len(taken) >= 2:
            assert int(dut.to.value) == taken[-2]
        before = random.randrange(1, 4900)
        await Timer(before, "ps")
        dut["from"].value = bit = random.getrandbits(1)
        await Timer(1, "ps")
        if len(taken) >= 2:
            assert int(dut.to.value) == taken[-2]
        taken.append(bit)


def test_synchroniser(simulate):
    simulate()
