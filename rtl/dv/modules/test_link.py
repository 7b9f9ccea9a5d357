"""The link: datagrams of bytes and of pairs of bytes come out as beats, full but for a datagram's last, one a clock."""

import random

import cocotb
import pytest
from cocotb.utils import get_sim_steps, get_sim_time

from drivers import Pace, Sink, begin, clocks, offer, reset, vary


@cocotb.test()
async def datagrams_come_out_as_beats(dut):
    size = int(dut.BYTES.value)
    in_pace, link_pace = Pace(), Pace()
    await begin(dut, valid=0, tready=0)
    sink = Sink(dut, link_pace)

    def put(part):
        # What a single byte has beside it says nothing.
        data, last = part
        dut.paired.value, dut.last.value = len(data) - 1, last
        dut.data.value = int.from_bytes(data + random.randbytes(2 - len(data)), "little")

    def drawn(count):
        """Return datagrams, and the parts in which they are given."""
        sent, parts = [], []
        for _ in range(count):
            each = random.choice([1, 2])
            sent.append(random.randbytes(each * random.choice([1, 2, 3, 4, 5, 9, 40])))
            parts += [(sent[-1][k : k + each], int(k + each == len(sent[-1]))) for k in range(0, len(sent[-1]), each)]
        return sent, parts

    # What was begun before a reset is forgotten.
    for each in (1, 2):
        await offer(dut.clk, dut.valid, dut.ready, put, [(bytes(each), 0)], in_pace)
        await reset(dut, valid=0)
        sink.clear()
    cocotb.start_soon(vary(dut.clk, 700, in_pace, link_pace))
    sent, parts = drawn(500)
    await offer(dut.clk, dut.valid, dut.ready, put, parts, in_pace)
    await clocks(dut.clk, 200)
    link_pace.often = in_pace.often = 1.0
    await clocks(dut.clk, 10)
    assert sink.datagrams() == sent
    # Where neither side waits, a byte goes in each clock; where a beat has four, what is given is taken in each.
    sent, parts = drawn(50)
    start = get_sim_time("step")
    await offer(dut.clk, dut.valid, dut.ready, put, parts, in_pace)
    taken = (get_sim_time("step") - start) / get_sim_steps(10, "ns")
    assert taken <= (sum(map(len, sent)) if size == 1 else len(parts)) + 2
    await clocks(dut.clk, 10)
    assert sink.datagrams() == sent


@pytest.mark.parametrize("build", ["BYTES=1", "BYTES=4"])
def test_link(simulate, build):
    simulate(build)
