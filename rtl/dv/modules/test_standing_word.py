"""A word for another clock: it is the last one that was taken, and stands from then on."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def the_word_that_was_taken_last_stands(dut):
    Clock(dut.clk, 10, "ns").start()
    stands = None
    for clock in range(500):
        take, word = clock == 0 or random.random() < 0.3, random.getrandbits(len(dut.word))
        dut.take.value, dut.word.value = int(take), word
        await FallingEdge(dut.clk)
        stands = word if take else stands
        assert int(dut.stands.value) == stands


def test_standing_word(simulate):
    simulate("BITS=11")
