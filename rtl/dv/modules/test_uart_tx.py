"""The serial line's sender: each byte that it takes is a start bit, eight bits from the lowest on, and a stop bit."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def each_byte_is_ten_bits_of_the_same_length(dut):
    clocks = int(dut.CLOCKS.value)
    Clock(dut.clk, 10, "ns").start()
    dut.valid.value, dut.reset.value = 0, 1
    for _ in range(3):
        await FallingEdge(dut.clk)
    dut.reset.value = 0
    await FallingEdge(dut.clk)
    levels, expected = [], []
    for _ in range(8000):
        valid, data = random.random() < 0.05, random.randrange(256)
        dut.valid.value, dut.data.value = int(valid), data
        if valid and int(dut.ready.value):
            expected += [1] * (len(levels) - len(expected))
            for bit in (0, *(data >> k & 1 for k in range(8)), 1):
                expected += [bit] * clocks
        await FallingEdge(dut.clk)
        levels.append(int(dut.tx.value))
    expected += [1] * (len(levels) - len(expected))
    assert levels == expected[: len(levels)]
    assert 0 in levels


def test_uart_tx(simulate):
    simulate("CLOCKS=5")
