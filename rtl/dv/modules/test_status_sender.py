"""Status lines: the greeting, each answer in its order, and counts of faults that changed, as docs/wire.md has them."""

import random
import re

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import Pace, begin, reset, settled, vary
from structs import NUMBERS, pack

KINDS = ("GREETING", "OK", "BAD", "STATUS")
TOTALS = ("frames", "events", "dropped", "datagrams", "faults")
FAULTS = {"queue": "lost", "comparator": "faults", "command": "commands"}


@cocotb.test()
async def lines_are_those_of_the_page(dut):
    build = f"{int(dut.ROWS.value)}x{int(dut.COLUMNS.value)} {int(dut.CHANNELS.value)}ch"
    period = int(dut.FAULT_CLOCKS.value)
    answers, link = Pace(), Pace()
    counts, totals = dict.fromkeys(FAULTS, 0), dict.fromkeys(TOTALS, 0)
    version, text, expected, waiting, given = 0, "", [], None, dict.fromkeys(FAULTS, 0)
    cocotb.start_soon(vary(dut.clk, 2500, answers, link))
    await begin(dut, ready=0, taken=0, version=0, lost=0, faults=0, commands=0, totals=0)
    expected.append(f"taxel-board v1 {build}")
    clock, faults_seen = 0, dict.fromkeys(FAULTS, 0)
    stood = None
    while clock < 9 * 2500 + 8000:
        last = clock >= 9 * 2500
        if random.random() < 0.0003 and not last:
            await reset(dut, ready=0, taken=0, lost=0, faults=0, commands=0)
            version = version ^ 1
            dut.version.value = version
            text, expected, waiting, stood = "", [f"taxel-board v{version + 1} {build}"], None, None
            counts, given = dict.fromkeys(FAULTS, 0), dict.fromkeys(FAULTS, 0)
        if random.random() < 0.003 and not last:
            name = random.choice(list(FAULTS))
            counts[name] += random.choice([1, 9, 10**6, 10**12])
            dut[FAULTS[name]].value = counts[name]
        if waiting is None and random.random() < 0.002 and answers() and not last:
            kind, number, value = random.randrange(4), random.randrange(8), random.getrandbits(32)
            value = random.randrange(1, 10) if KINDS[kind] == "BAD" else value
            waiting = kind, number, value
            dut.oldest.value = pack("answer_t", kind=NUMBERS[f"ANSWER_{KINDS[kind]}"], number=number, value=value)
        if waiting is None:
            # What was counted, as a line begins.
            totals = {name: random.choice([0, 7, 10, random.getrandbits(40), 10**14]) for name in TOTALS}
            dut.totals.value = pack("totals_t", **totals)
        dut.ready.value = int(waiting is not None)
        # A byte is on its way for some clocks.
        taken = link() and random.random() < 0.5
        dut.taken.value = int(taken)
        await settled()
        if int(dut.pop.value):
            kind, number, value = waiting
            expected.append({
                "GREETING": f"taxel-board v{version + 1} {build}",
                "OK": f"ok REG{number}=0x{value:08X}",
                "BAD": f"bad REG{number} rule {value}",
                "STATUS": "status " + " ".join(f"{name}={totals[name]}" for name in TOTALS),
            }[KINDS[kind]])  # fmt: skip
            waiting = None
        byte = int(dut.data.value) if int(dut.valid.value) else None
        assert stood in (None, byte)
        stood = byte
        if byte is not None and taken:
            text += chr(byte)
            stood = None
            if byte == 10:
                line, text = text[:-1], ""
                fault = re.fullmatch(r"fault (\w+) (0|[1-9]\d*)", line)
                if fault:
                    name, count = fault[1], int(fault[2])
                    assert given[name] < count <= counts[name]
                    given[name] = count
                    faults_seen[name] += 1
                else:
                    assert line == expected.pop(0)
        await FallingEdge(dut.clk)
        clock += 1
    assert not expected
    assert not text
    assert given == counts
    # Not at once, and at most once in so many clocks.
    assert all(2 < count <= clock // period for count in faults_seen.values()), faults_seen


@pytest.mark.parametrize(
    "build",
    [
        "FAULT_CLOCKS=1000 ROWS=7 COLUMNS=128",
        "FAULT_CLOCKS=300 ROWS=64 COLUMNS=64 CHANNELS=64",
    ],
)
def test_status_sender(simulate, build):
    simulate(build)
