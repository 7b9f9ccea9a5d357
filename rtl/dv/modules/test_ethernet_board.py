"""A board between its pins: what comparators do within a ramp comes out of the PHY's pins as frames of Ethernet."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, RisingEdge, Timer, ValueChange

from drivers import clocks, same
from ethernet import payload_of
from models import NOT_RETURNED, Chain, Scan, datagrams_1, words_1

#: A tick, ps: half a clock of the converter.
TICK = 3333


@cocotb.test()
async def frames_are_those_of_the_page(dut):
    columns, rows = int(dut.COLUMNS.value), int(dut.ROWS.value)
    scan, chain = Scan(columns, rows, 64), Chain([1] * columns)
    ticks = {taxel: random.randrange(150) for taxel in scan.taxels()}
    frames = []

    async def comparators():
        """Trip in the middle of ticks, from the ramp's rise on; return as it falls."""
        while True:
            # While the line settles, those that have not returned are seen.
            await clocks(dut.clk, 12)
            line = chain.driven(columns)[0]
            of_channel = {row: ticks[line, row] for row in range(rows)}
            level, now = sum((tick == NOT_RETURNED) << row for row, tick in of_channel.items()), -0.5
            dut.comparators.value = level
            await RisingEdge(dut.ramp)
            for tick in sorted({tick for tick in of_channel.values() if tick < 150}):
                await Timer(round((tick - now) * TICK), "ps")
                now = tick
                level |= sum(1 << row for row, one in of_channel.items() if one == tick)
                dut.comparators.value = level
            if int(dut.ramp.value):
                await FallingEdge(dut.ramp)
            await Timer(TICK // 2, "ps")
            dut.comparators.value = 0

    async def shift_registers():
        while True:
            await FallingEdge(dut.clk)
            chain.follow(int(dut.csel_reg_clk_out.value), int(dut.csel_reg_din_out.value))

    async def phy():
        """The low half of a byte while the clock is high: the data have the clock's edges."""
        frame, low = bytearray(), 0
        while True:
            await ValueChange(dut.eth_tx_clk)
            await Timer(1, "ns")
            nibble = int(dut.eth_tx_data.value)
            if int(dut.eth_tx_clk.value):
                low = nibble
            elif int(dut.eth_tx_ctl.value):
                frame.append(nibble << 4 | low)
            elif frame:
                frames.append(payload_of(bytes(frame)))
                frame.clear()

    async def edge():
        await FallingEdge(dut.clk)
        while not int(dut.frame_sync_out.value):
            await FallingEdge(dut.clk)

    dut.steady.value, dut.button_n.value, dut.rx.value, dut.comparators.value = 0, 1, 1, 0
    Clock(dut.clk, 10, "ns").start()
    Clock(dut.clk_fast, 2 * TICK, "ps").start()
    Clock(dut.clk_link, 8, "ns").start()
    reset_clocks = int(dut.RESET_CLOCKS.value)
    # Clocks that are not steady for long enough hold all in reset.
    for steady in (0, 1, 0, 1):
        dut.steady.value = steady
        await clocks(dut.clk, reset_clocks - 5)
        assert not int(dut.eth_reset_n.value)
    for task in (comparators, shift_registers, phy):
        cocotb.start_soon(task())
    await clocks(dut.clk, 15)
    assert int(dut.eth_reset_n.value)
    await edge()
    expected, length = [], columns * 75
    for frame in range(60):
        await edge()
        for taxel in ticks:
            if random.random() < 0.2 and frame % 12 < 6:
                ticks[taxel] = random.choice([0, 1, 149, 150, random.randrange(150), NOT_RETURNED])
        stamp = frame * length // 10_000
        words = [words_1(x, y, more, stamp, value) for x, y, more, value in scan.frame(ticks, 150, 3)]
        expected += datagrams_1(words)
    for _ in range(20):
        await edge()
    same(frames, expected)
    # 101 seeds gave 20 to 30.
    assert len(frames) >= 10


def test_ethernet_board(simulate):
    simulate("COLUMNS=3 ROWS=5 BAUD_CLOCKS=8 RESET_CLOCKS=60 PATTERN_CLOCKS=500")
