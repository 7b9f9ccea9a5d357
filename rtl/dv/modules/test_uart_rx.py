"""The serial line's receiver: bytes of any phase, bits up to 2.7 % off; none without a start bit and a stop bit."""

import random

import cocotb
import pytest
from cocotb.triggers import FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time

from drivers import begin, settled


async def send(dut, bits, length):
    """Put bits on the line, of so many ps each."""
    for bit in bits:
        dut.rx.value = bit
        await Timer(length, "ps")


@cocotb.test()
async def a_byte_stands_behind_the_middle_of_its_stop_bit(dut):
    clocks_a_bit = int(dut.CLOCKS.value)
    await begin(dut, rx=1)
    for _ in range(200):
        await Timer(random.randrange(20_000 * clocks_a_bit, 30_000 * clocks_a_bit), "ps")
        middle = get_sim_time("ps") + 10_000 * (9 * clocks_a_bit + clocks_a_bit // 2)
        byte = random.getrandbits(8)
        cocotb.start_soon(send(dut, [0, *(byte >> k & 1 for k in range(8)), 1], 10_000 * clocks_a_bit))
        await RisingEdge(dut.valid)
        assert 10_000 <= get_sim_time("ps") - middle <= 20_000
        assert int(dut.data.value) == byte


@cocotb.test()
async def each_byte_comes_once(dut):
    bit_ps = 10_000 * int(dut.CLOCKS.value)
    middle = 10_000 * (int(dut.CLOCKS.value) // 2 - 1)  # of a start bit, from the clock's edge behind its own
    came, broken = [], []

    async def watch():
        while True:
            await settled()
            if int(dut.valid.value):
                came.append(int(dut.data.value))
            if int(dut.broken.value):
                broken.append(get_sim_time("ps"))
            await FallingEdge(dut.clk)

    await begin(dut, rx=1)
    cocotb.start_soon(watch())
    for round_ in range(8):
        sent = []
        for _ in range(40):
            # A pulse that ends before the middle of a start bit is none, nor does it take the byte behind it.
            pulses = random.choice([0, 0, 1, 2])
            for _ in range(pulses):
                await send(dut, [0], random.choice([10_000, random.randrange(1, middle)]))
                await send(dut, [1], random.randrange(bit_ps // 2 + 10_000, 2 * bit_ps))
            byte = random.choice([0, 255, random.randrange(256)])
            length = round(bit_ps * random.choice([0.973, 1.027, random.uniform(0.973, 1.027)]))
            await send(dut, [0, *(byte >> k & 1 for k in range(8)), 1], length)
            # The next byte may begin at once, at any phase of the clock.
            dut.rx.value = 1
            await Timer(random.choice([1, random.randrange(1, 3 * bit_ps)]), "ps")
            sent.append(byte)
        await Timer(2 * bit_ps, "ps")
        assert (came, broken) == (sent, [])
        # Held low it is no byte, told once; what comes after a long silence is.
        came.clear()
        await send(dut, [0] * (20 + round_), bit_ps)
        assert (came, len(broken)) == ([], 1)
        await send(dut, [1] * 12, bit_ps)
        assert (came, len(broken)) == ([], 1)
        broken.clear()
        # A reset forgets the byte that had begun.
        await send(dut, [0, 1, 0], bit_ps)
        dut.reset.value, dut.rx.value = 1, 1
        await Timer(4 * 10_000, "ps")
        dut.reset.value = 0
        await Timer(12 * bit_ps, "ps")
        assert (came, broken) == ([], [])


@pytest.mark.parametrize("build", ["CLOCKS=8", "CLOCKS=17"])
def test_uart_rx(simulate, build):
    simulate(build)
