"""The number of a session: the low 16 bits of the CRC-32C of the first frame's counts, whenever they come."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from models import crc_32c


@cocotb.test()
async def it_is_the_crc_of_all_counts_since_reset(dut):
    assert crc_32c(b"123456789") == 0xE306_9283
    Clock(dut.clk, 10, "ns").start()
    for _ in range(20):
        dut.counted.value, dut.reset.value = 0, 1
        await FallingEdge(dut.clk)
        dut.reset.value = 0
        data = b""
        for _ in range(random.randrange(200)):
            counted, count = random.random() < 0.7, random.randrange(1 << 16)
            dut.counted.value, dut.count.value = int(counted), count
            if counted:
                data += count.to_bytes(2, "little")
            await FallingEdge(dut.clk)
        dut.counted.value = 0
        for _ in range(2):
            await FallingEdge(dut.clk)
        assert int(dut.session.value) == crc_32c(data) & 0xFFFF


def test_session(simulate):
    simulate()
