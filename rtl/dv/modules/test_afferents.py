"""Afferents: the spikes of FA-1 as docs/registers.md has them, with changes of mode and comparators not returned."""

import itertools
import random
from collections import defaultdict

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from models import Afferent
from structs import pack


@cocotb.test()
async def spikes_are_those_of_the_page(dut):
    Clock(dut.clk, 10, "ns").start()
    columns, steps, bits = int(dut.COLUMNS.value), int(dut.STEPS.value), int(dut.ADDRESS_BITS.value)
    channels = (1 << bits - max(columns - 1, 1).bit_length()) // steps
    dut.begins.value, dut.sampled.value = 0, 0
    taxels = defaultdict(Afferent)
    ticks_of = defaultdict(lambda: random.randrange(200))
    spikes = quiet = 0
    # The last six clocks' taxels: address, ticks, whether the comparator had returned, what has to come of it.
    line_up = [None] * 6

    async def clock(taxel=None, begins=0):
        nonlocal spikes, quiet
        line_up[:] = [taxel, *line_up[:5]]
        dut.begins.value = begins
        dut.address.value = taxel[0] if taxel else random.getrandbits(bits)
        dut.ticks.value = line_up[1][1] if line_up[1] else random.getrandbits(16)
        leaving = line_up[5]
        dut.sampled.value = int(bool(leaving and leaving[3]))
        dut.returned.value, dut.stored_at.value = (int(leaving[2]), leaving[0]) if leaving else (1, 0)
        if leaving and leaving[3] and leaving[2]:
            expected = leaving[4]
            assert int(dut.fires.value) == (expected is not None)
            if expected:
                assert (int(dut.more.value), int(dut.intensity.value)) == expected
            spikes, quiet = spikes + (expected is not None), quiet + (expected is None)
        await FallingEdge(dut.clk)

    # Thresholds, and how far a value moves: each two of them come twice or more, as many give few spikes or none.
    thresholds = [(33, 983, 51), (400, 100, 255), (0, 9, 9), (65535, 65535, 1), (3, 65535, 255)]
    settings = list(itertools.product(thresholds, [2, 30, 2000])) * 2
    settings += random.sample(settings, 10)
    random.shuffle(settings)
    mode = False
    for frame in range(400):
        if frame % 40 in (0, 37):
            mode = frame % 40 == 0
            taxels.clear()
        if frame % 10 == 0:
            (rest, jump, decay), far = settings[frame // 10]
            dut.threshold.value = pack("threshold_t", rest=rest, jump=jump, decay=decay)
            for _ in range(6):
                await clock()
        # Lines come in any order, their steps one after the other.
        for line in random.sample(range(columns), columns):
            for step in range(steps):
                dut.read.value = pack("read_t", line=line, step=step, format={"spikes": mode})
                await clock(begins=1)
                dut.read.value = random.getrandbits(len(dut.read))
                await clock()
                for channel in range(channels):
                    address = line * channels * steps + channel * steps + step
                    if random.random() < 0.5:
                        moved = ticks_of[address] + random.randrange(-far, far + 1)
                        ticks_of[address] = min(max(moved, 0), 65535)
                    ticks, returned = ticks_of[address], random.random() < 0.9
                    told = taxels[address].frame(ticks, rest, jump, decay) if mode and returned else None
                    await clock((address, ticks, returned, mode, told))
                for _ in range(random.choice([0, 0, 3])):
                    await clock()
        for _ in range(6):
            await clock()
    assert spikes > 100
    assert quiet > 100


@pytest.mark.parametrize("build", ["COLUMNS=3 STEPS=2 ADDRESS_BITS=5", "COLUMNS=1 STEPS=1 ADDRESS_BITS=5"])
def test_afferents(simulate, build):
    simulate(build)
