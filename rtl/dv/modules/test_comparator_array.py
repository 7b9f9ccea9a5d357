"""The converter: one ramp a read, of its length, and what each comparator did, whatever the phase of its two clocks."""

import random
from collections import deque

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer

from drivers import begin, settled, within
from models import NOT_RETURNED, Comparators


@cocotb.test()
async def each_read_has_a_ramp_and_is_reported(dut):
    channels = int(dut.CHANNELS.value)
    reads, reported, ramps = deque(), deque(), []
    # Not quite three to two: the phase goes through all there are.
    Clock(dut.clk_fast, 6666, "ps").start()
    await begin(dut, read_start=0, step_end=0, comparators=0)

    async def comparators():
        model, high = Comparators(int(dut.DELAY.value)), 0
        while True:
            await FallingEdge(dut.clk_fast)
            ramp = int(dut.ramp.value)
            if ramp & 1 and not high:
                model.rise(*reads.popleft())
                ramps.append(0)
            if ramp:
                ramps[-1] += 1 + (ramp >> 1)
            high = ramp
            dut.comparators.value = model.pairs()

    cocotb.start_soon(comparators())
    await Timer(random.randrange(1, 20_000), "ps")
    await FallingEdge(dut.clk)
    lengths, done, expected = [], 0, []

    async def clocks(count):
        nonlocal done
        for _ in range(count):
            await FallingEdge(dut.clk)
            dut.read_start.value = dut.step_end.value = 0
            # They are a read's at its start only.
            dut.length.value, dut.inverted.value = random.randrange(1, 1 << 16), random.getrandbits(1)
            await settled()
            if not int(dut.read_done.value):
                continue
            done += 1
            flags = [int(dut[name].value) for name in ("tripped", "first", "at")]
            ticks, length = reported.popleft()
            for c, tick in enumerate(ticks):
                tripped, first, at = flags[0] >> c & 1, flags[1] >> c & 1, flags[2] >> 15 * c & 0x7FFF
                # It is first seen by the sample after its tick; one that had not returned by sample 0. A ramp's end is
                # in the pair that is its last: later samples of that pair are the change detector's to limit.
                sample = 0 if tick == NOT_RETURNED else tick + 1
                if sample <= length:
                    assert (tripped, 2 * at + 1 - first) == (1, sample), (c, tick, length, tripped, at, first, done)
                else:
                    assert not tripped or 2 * at + 1 - first == sample == length + 1, (c, tick, length)

    for _ in range(300):
        period = within(27, 60)
        read = within(4, period)
        # A next read may begin with its step: the ramp has to fall before it.
        most = 3 * read - 5
        length = within(1, most)
        ticks = [
            random.choice([NOT_RETURNED, *(within(0, length + 9, length) for _ in range(4))]) for _ in range(channels)
        ]
        inverted = random.random() < 0.3
        reads.append((ticks, inverted))
        expected.append((ticks, length))
        lengths.append(length)
        # As the scan does: a read begins a clock after its settling, and ends with its step.
        await clocks(period - read + 1)
        dut.length.value, dut.inverted.value, dut.read_start.value = length, int(inverted), 1
        await clocks(read - 1)
        # What begins the next read's settling: the one before has been reported.
        assert len(reported) == 0
        dut.step_end.value = 1
        reported.append((ticks, length))
    await clocks(60)
    assert done == len(lengths)
    assert ramps == lengths


@pytest.mark.parametrize("build", ["CHANNELS=8", "CHANNELS=16 DELAY=5"])
def test_comparator_array(simulate, build):
    simulate(build)
