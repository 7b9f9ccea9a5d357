"""The converter's timer: a ramp is high for as many halves of a clock as it is long, and its pairs are counted."""

import random

import cocotb
import pytest
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def a_ramp_has_its_length_and_its_pairs(dut):
    delay = int(dut.DELAY.value)
    Clock(dut.clk_fast, 10, "ns").start()
    dut.start.value, dut.length.value, dut.reset.value = 0, 1, 1
    for _ in range(4):
        await FallingEdge(dut.clk_fast)
    dut.reset.value = 0
    for length in [*range(1, 12), *(random.randrange(1, 300) for _ in range(40)), random.randrange(1 << 15, 1 << 16)]:
        dut.start.value, dut.length.value = 1, length
        halves, seen = [], {"nears": [], "begins": [], "begun": [], "open": [], "closing": []}
        for clock in range(length // 2 + delay + 6):
            await FallingEdge(dut.clk_fast)
            dut.start.value = 0
            ramp = int(dut.ramp.value)
            halves += [ramp & 1, ramp >> 1]
            for name, clocks in seen.items():
                if int(getattr(dut, name).value):
                    clocks.append(clock)
        # It rises with the clock after the start's edge; pair 0 is sampled `delay` clocks later.
        assert halves == [1] * length + [0] * (len(halves) - length)
        last = delay + length // 2
        assert (seen["nears"], seen["begins"], seen["begun"]) == ([delay - 2], [delay - 1], [delay])
        assert seen["open"] == list(range(delay, last + 1))
        assert seen["closing"] == [last - 1]


@cocotb.test()
async def a_ramp_may_start_before_the_samples_of_the_one_before(dut):
    delay = int(dut.DELAY.value)
    Clock(dut.clk_fast, 10, "ns").start()
    dut.start.value, dut.length.value, dut.reset.value = 0, 1, 1
    for _ in range(4):
        await FallingEdge(dut.clk_fast)
    dut.reset.value = 0
    starts, clock = {}, 0
    for _ in range(60):
        clock += random.choice([5, 5, 6, 9])
        # Ramps of at most seven ticks, which fall for a clock before the next one.
        starts[clock] = random.randrange(1, 8)
    for now in range(clock + delay + 9):
        dut.start.value, dut.length.value = int(now in starts), starts.get(now, random.randrange(1, 300))
        await FallingEdge(dut.clk_fast)
        since = {now - start: length for start, length in starts.items() if 0 <= now - start < delay + 9}
        high = [any(2 * ago + half < length for ago, length in since.items()) for half in range(2)]
        assert int(dut.ramp.value) == high[0] + 2 * high[1]
        for name, at in (("nears", delay - 2), ("begins", delay - 1), ("begun", delay)):
            assert int(getattr(dut, name).value) == (at in since), name
        assert int(dut.open.value) == any(delay <= ago <= delay + length // 2 for ago, length in since.items())
        assert int(dut.closing.value) == any(ago == delay - 1 + length // 2 for ago, length in since.items())


@pytest.mark.parametrize("build", ["", "DELAY=6", "DELAY=9"])
def test_ramp_counter(simulate, build):
    simulate(build)
