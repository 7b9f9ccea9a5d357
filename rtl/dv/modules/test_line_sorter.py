"""The sorter of version 2: events of a line by ascending rows, each once; all else passes behind what came before."""

import random

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import Pace, begin, clocks, offer, reset, settled, vary
from structs import NUMBERS, pack, unpack

EVENT, MARKER, FRAME = (NUMBERS[f"ENTRY_{name}"] for name in ("EVENT", "MARKER", "FRAME"))


def drawn(lines, rows):
    """Return entries as they come, and in the order in which they have to go."""
    entries, expected, at, x = [], [], 0, 0
    for _ in range(lines):
        at += random.randrange(3) * 50
        synchronous, x = random.random() < 0.8, (x + random.randrange(1, 128)) % 128
        form = {"version_2": 1, "frame_sync": synchronous, "spikes": random.getrandbits(1)}
        line = [
            {"kind": EVENT, "format": form, "at": at, "x": x, "y": y, "more": random.getrandbits(1),
             "value": random.randrange(1 << 16), "lost": random.random() < 0.1}
            for y in random.sample(range(rows), min(rows, random.choice([0, 1, 1, 2, 5, rows])))
        ]  # fmt: skip
        entries += line
        if synchronous and line:
            lost = any(event["lost"] for event in line)
            line = [event | {"lost": 0} for event in sorted(line, key=lambda event: event["y"])]
            line[0]["lost"] = lost
        expected += line
        other = {"kind": random.choice([MARKER, FRAME]), "format": form, "at": at, "more": 1}
        if random.random() < 0.3 or not line:
            entries.append(other)
            expected.append(other)
    return [pack("event_t", **entry) for entry in entries], [pack("event_t", **entry) for entry in expected]


@cocotb.test()
async def events_of_a_line_go_by_rows(dut):
    rows = int(dut.ROWS.value)
    in_pace, out_pace = Pace(), Pace()
    await begin(dut, ready=0, leaving=0, taken=0)

    def put(entry):
        dut.oldest.value = entry

    # What was gathered before a reset is forgotten.
    before = cocotb.start_soon(offer(dut.clk, dut.ready, dut.pop, put, drawn(50, rows)[0], in_pace))
    await clocks(dut.clk, random.randrange(20, 200))
    before.cancel()
    await reset(dut, ready=0)
    entries, expected = drawn(500, rows)
    cocotb.start_soon(vary(dut.clk, 2000, in_pace, out_pace))
    source = cocotb.start_soon(offer(dut.clk, dut.ready, dut.pop, put, entries, in_pace))
    came, since, quiet = [], 3, 0
    while quiet < 100:
        # An entry of the other version, when no more come: what was gathered goes.
        dut.leaving.value = int(source.done())
        await settled()
        # The packer takes an entry every third clock at most.
        take = int(dut.valid.value) and since >= 3 and out_pace()
        dut.taken.value = int(take)
        if take:
            came.append(int(dut.entry.value))
        since = 1 if take else since + 1
        assert not (int(dut.idle.value) and int(dut.valid.value))
        quiet = quiet + 1 if source.done() and not int(dut.valid.value) else 0
        await FallingEdge(dut.clk)
    differing = [(unpack("event_t", a), unpack("event_t", b)) for a, b in zip(came, expected, strict=False) if a != b]
    assert not differing, differing[0]
    assert len(came) == len(expected)
    assert int(dut.idle.value)


@pytest.mark.parametrize("build", ["ROWS=64", "ROWS=20"])
def test_line_sorter(simulate, build):
    simulate(build)
