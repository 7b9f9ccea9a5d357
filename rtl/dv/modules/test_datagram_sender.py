"""The sender of version 2: header, body, promise and CRC-32C, unit by unit, while the next body is written."""

import random

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import Pace, Sink, begin, clocks, reset, settled, vary, within
from models import Datagram
from structs import pack

#: Clocks from `send` to the first byte.
LATENCY = 5


@cocotb.test()
async def bytes_are_those_of_the_page(dut):
    stride, board = max(int(dut.ROWS.value) - 1, 0).bit_length(), int(dut.BOARD.value)
    session = random.randrange(1 << 16)
    write_pace, link_pace = Pace(), Pace()
    await begin(dut, session=session, write=0, send=0, tready=0)
    cocotb.start_soon(vary(dut.clk, 500, write_pace, link_pace))
    sink, expected, bank = Sink(dut, link_pace), [], 0
    for k in range(60):
        if k in (20, 40):
            # What is on its way at a reset is not sent.
            await reset(dut, write=0, send=0)
            came = sink.datagrams()
            assert came == expected[: len(came)]
            assert len(expected) - len(came) <= 1
            expected.clear()
            session = random.randrange(1 << 16)
            dut.session.value = session
        units = random.choice([0, 0, 1, 2, 7, 40, within(0, 688) if k % 20 == 5 else 3])
        body = [random.randrange(1 << 16) for _ in range(units)]
        for place in range(units):
            while not write_pace():
                await FallingEdge(dut.clk)
            dut.write.value, dut.bank.value, dut.place.value, dut.unit.value = 1, bank, place, body[place]
            await FallingEdge(dut.clk)
            dut.write.value = 0
        while int(dut.sending.value):
            await FallingEdge(dut.clk)
        datagram = Datagram(
            kind=random.randrange(16), base=random.getrandbits(48), frame_sync=random.getrandbits(1),
            differences=random.getrandbits(1), dropped=random.getrandbits(1), line=random.randrange(128),
            span=random.randrange(1 << 16), sequence=random.getrandbits(32),
            body=b"".join(unit.to_bytes(2, "little") for unit in body),
        )  # fmt: skip
        dut.datagram.value = pack(
            "datagram_t", kind=datagram.kind, frame_sync=datagram.frame_sync, differences=datagram.differences,
            dropped=datagram.dropped, sequence_number=datagram.sequence, base=datagram.base, line=datagram.line,
            span=datagram.span, units=units, bank=bank,
        )  # fmt: skip
        dut.send.value = 1
        await FallingEdge(dut.clk)
        dut.send.value, dut.datagram.value = 0, random.getrandbits(len(dut.datagram))
        await settled()
        assert int(dut.sending.value)
        # The first byte stands so many clocks after the datagram.
        for _ in range(LATENCY - 1):
            assert not int(dut.tvalid.value)
            await FallingEdge(dut.clk)
            await settled()
        assert int(dut.tvalid.value)
        expected.append(datagram.encoded(stride, board, session))
        bank ^= 1
    link_pace.often = 1.0
    while int(dut.sending.value):
        await FallingEdge(dut.clk)
    await clocks(dut.clk, 20)
    assert sink.datagrams() == expected


@pytest.mark.parametrize("build", ["ROWS=5 BOARD=4711", "ROWS=128", "ROWS=1"])
def test_datagram_sender(simulate, build):
    simulate(build)
