"""A memory between two clocks: each place reads, a clock later, as it was written last."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer


@cocotb.test()
async def a_place_reads_as_it_was_written(dut):
    places, bits = 1 << int(dut.PLACES.value), len(dut.word_written)
    Clock(dut.clk_write, 10, "ns").start()
    await Timer(random.randrange(1, 10_000), "ps")
    Clock(dut.clk_read, 7, "ns").start()
    words = {}
    for _ in range(200):
        await FallingEdge(dut.clk_write)
        for _ in range(random.randrange(1, 5)):
            write, place, word = random.random() < 0.7, random.randrange(places), random.getrandbits(bits)
            dut.write.value, dut.at_write.value, dut.word_written.value = int(write), place, word
            await FallingEdge(dut.clk_write)
            if write:
                words[place] = word
        dut.write.value = 0
        for place in random.sample(list(words), min(len(words), 3)):
            await FallingEdge(dut.clk_read)
            dut.at_read.value = place
            await FallingEdge(dut.clk_read)
            assert int(dut.word_read.value) == words[place]
    assert len(words) == places


def test_two_clock_memory(simulate):
    simulate("BITS=5 PLACES=3")
