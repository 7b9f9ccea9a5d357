"""All of the logic: trip times and commands in; datagrams of both versions, and status lines, as the documents say."""

import random
import re

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from drivers import Pace, Sink, begin, clocks, same
from models import NOT_RETURNED, Chain, Comparators, Scan, Version2, crc_32c, datagrams_1, words_1
from verilated import QUIET, SOURCES, run


def command(number, value):
    """Return a write of a register as five bytes (docs/wire.md)."""
    tops = sum((value >> 31 - 8 * k & 1) << 3 - k for k in range(4))
    return bytes([0x80 | number << 4 | tops, *(value >> 24 - 8 * k & 0x7F for k in range(4))])


#: Of FA-1: rest, jump, decay.
THETA = 33, 983, 51
FRAMES = 54
#: What is written in which frame, to hold from the next one on: register, value, the answer where it is no plain one.
WRITES = {
    3: (5, 2 << 16 | 20 << 8, None),
    5: (7, 1 << 16, None),
    6: (7, 0, None),
    8: (5, 2 << 16 | 2 << 8 | THETA[2], None),
    10: (0, 1 << 4 | 1 << 3, None),
    15: (7, 1 << 16, None),
    18: (4, 150 | THETA[0] << 16, None),
    20: (0, THETA[1] << 16 | 1 << 4 | 1 << 3 | 1 << 1, None),
    28: (0, THETA[1] << 16 | 1 << 3 | 1 << 1, None),
    32: (0, 1 << 3, None),
    34: (4, 160, None),
    36: (4, 300, "bad REG4 rule 3"),
    38: (6, 4, "ok REG4=0x000000A0"),
    # Totals come as the last line.
    FRAMES - 12: (6, 9, ""),
}


@cocotb.test()
async def datagrams_and_lines_are_those_of_the_page(dut):
    columns, rows, channels = (int(dut[name].value) for name in ("COLUMNS", "ROWS", "CHANNELS"))
    bit = int(dut.BAUD_CLOCKS.value)
    scan = Scan(columns, rows, channels)
    board = Version2(max(rows - 1, 0).bit_length())
    link, serial, to_send = Pace(), bytearray(), bytearray()
    ticks = {taxel: random.randrange(160) for taxel in scan.taxels()}
    chain = Chain([1] * columns)

    async def comparators():
        model, high, selected, held = Comparators(int(dut.DELAY.value)), 0, None, {}
        while True:
            await FallingEdge(dut.clk_fast)
            # They follow the pins at all times: those of a ramp are as it rose, whatever is selected.
            before, selected = selected, (tuple(chain.driven(columns)), int(dut.rsel.value))
            ramp = int(dut.ramp.value)
            rises = ramp & 1 and not high
            high = ramp
            if rises:
                assert len(selected[0]) == 1
                held = dict(ticks)
            if rises or (held and selected != before):
                lines, step = selected
                shown = [held.get((lines[0] if lines else 0, scan.steps * c + step), 0) for c in range(channels)]
                if rises:
                    model.rise(shown, False)
                else:
                    model.follow(shown)
            dut.comparators.value = model.pairs()

    async def shift_registers():
        while True:
            await FallingEdge(dut.clk)
            chain.follow(int(dut.csel_reg_clk_out.value), int(dut.csel_reg_din_out.value))

    async def line_in():
        while True:
            byte = to_send.pop(0) if to_send else None
            levels = [0, *(byte >> k & 1 for k in range(8)), 1] if byte is not None else [1]
            for level in levels:
                dut.rx.value = level
                await clocks(dut.clk, bit)

    async def line_out():
        while True:
            await FallingEdge(dut.clk)
            if int(dut.tx.value):
                continue
            levels = []
            for k in range(9):
                await clocks(dut.clk, bit + (k == 0) * (bit // 2))
                levels.append(int(dut.tx.value))
            assert levels[8]
            serial.append(sum(level << k for k, level in enumerate(levels[:8])))

    Clock(dut.clk_fast, 6666, "ps").start()
    await begin(dut, pattern=0, rx=1, tready=0, comparators=0)

    sink = Sink(dut, link)
    for task in (comparators, line_in, line_out, shift_registers):
        cocotb.start_soon(task())

    async def edge():
        """Run to the next frame's edge."""
        await FallingEdge(dut.clk)
        while not int(dut.frame_sync_out.value):
            await FallingEdge(dut.clk)

    # The frame before time 0 is not sent: its counts name the session.
    await edge()
    counts = [min(ticks[taxel], 150) for taxel in scan.taxels()]
    session = crc_32c(b"".join(count.to_bytes(2, "little") for count in counts)) & 0xFFFF
    expected, answers = [], [f"taxel-board v1 {rows}x{columns} {channels}ch"]
    wire, floor, ramp, threshold, events, faults = 1, 3, 150, None, 0, 0
    length = columns * scan.steps * 75
    for frame in range(FRAMES):
        await edge()
        marker = None
        form = {"kind": 2 if threshold else 1, "frame_sync": 1, "differences": 0}
        at, stamp = frame * length // 100, frame * length // 10_000
        # What was written in the frame before acts.
        if frame - 1 in WRITES:
            number, value, answer = WRITES[frame - 1]
            answers += [f"ok REG{number}=0x{value:08X}" if answer is None else answer] if answer != "" else []
            if number == 7:
                marker = value >> 16
            if answer is None:
                wire, threshold = (
                    ((value >> 4 & 1) + 1, THETA if value >> 1 & 1 else None) if number == 0 else (wire, threshold)
                )
                floor = value >> 8 & 255 if number == 5 else floor
                ramp = value & 0xFFFF if number == 4 else ramp
        # It goes before its frame's events.
        if marker is not None and wire == 2:
            board.marker(at, marker, **form)
        words = [words_1(0, 0, marker, stamp, marker=True)] if marker is not None and wire == 1 else []
        form["kind"] = 2 if threshold else 1
        for taxel, tick in ticks.items():
            if random.random() < 0.3 and frame < FRAMES - 14:
                ticks[taxel] = random.choice([0, ramp, random.randrange(ramp + 9), NOT_RETURNED])
            elif tick == NOT_RETURNED:
                ticks[taxel] = 0
        found = scan.frame(ticks, ramp, floor, threshold)
        events += len(found)
        faults += sum(tick == NOT_RETURNED for tick in ticks.values())
        if wire == 1:
            words += [words_1(x, y, more, stamp, value) for x, y, more, value in found]
            expected += datagrams_1(words)
        else:
            sent = len(board.sent)
            for x, y, more, value in sorted(found):
                board.event(x, y, at, more, value, **form)
            end = (frame + 1) * length // 100
            board.frame_end(end, length // 100, False, **form)
            expected += [
                datagram.encoded(board.stride, 0, session) for datagram in board.sent[sent - (marker is not None) :]
            ]
        link.often = random.choice([0.6, 1.0])
        to_send.extend(command(*WRITES[frame][:2]) if frame in WRITES else b"")
    lines = serial.decode().splitlines()
    same(sink.datagrams(), expected)
    assert lines[:-1] == answers
    totals = re.fullmatch(r"status frames=(\d+) (.*)", lines[-1])
    assert FRAMES - 16 < int(totals[1]) < FRAMES
    assert totals[2] == f"events={events} dropped=0 datagrams={len(expected)} faults={faults}"
    assert len(board.sent) > 10


@pytest.mark.parametrize(
    "build",
    [
        f"COLUMNS=3 ROWS=20 QUEUE=1024 STATES_US=0 BAUD_CLOCKS=8 FAULT_CLOCKS=1000000000 LINK_BYTES={link_bytes}"
        for link_bytes in (1, 4)
    ],
)
def test_top(simulate, build):
    simulate(build)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"ROWS": 80}, "COLUMNS, ROWS: at most 128, and steps that are a power of two"),
        ({"CHANNELS": 32}, "CHANNELS: the converter has 16 or 64"),
        ({"LINK_BYTES": 2}, "LINK_BYTES: the link has 1 or 4"),
        ({"ANSWERS": 6}, "ANSWERS: a power of two, at least 2"),
        ({"ANSWERS": 1}, "ANSWERS: a power of two, at least 2"),
        ({"STATES_US": 1}, "STATES_US: 0, or 2 to 20000000"),
        ({"BAUD_CLOCKS": 3}, "CLOCKS: at least 4"),
    ],
)
def test_a_build_that_is_not_supported_is_refused(parameters, message):
    options = [f"-G{name}={value}" for name, value in parameters.items()]
    with pytest.raises(RuntimeError, match=message):
        run("verilator", "--lint-only", *QUIET, "--top-module", "taxel_top", *options, "-F", SOURCES / "taxel.f")
