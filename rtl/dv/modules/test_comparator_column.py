"""A channel: the first sample of a read at which its comparator had tripped, whatever came before or comes after."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def the_first_sample_that_had_tripped_counts(dut):
    Clock(dut.clk_fast, 10, "ns").start()
    dut.begins.value, dut.closes.value = 0, 0
    tripped = 0
    for _ in range(400):
        pairs = random.randrange(1, 20)
        samples = [random.choice([0, 0, 0, 1, 2, 3]) if random.random() < 0.3 else 0 for _ in range(pairs)]
        drawn = [random.randrange(4), *samples, *(random.randrange(4) for _ in range(random.choice([0, 3])))]
        for k, sample in enumerate(drawn):
            dut.begins.value, dut.closes.value = int(k == 0), int(k == pairs)
            # The count of pairs begins anew at any time behind the read.
            dut.pair.value, dut.sample.value = k - 1 if 0 < k <= pairs else random.randrange(1 << 15), sample
            await FallingEdge(dut.clk_fast)
        seen = next(((k, sample) for k, sample in enumerate(samples) if sample), None)
        assert int(dut.tripped.value) == (seen is not None)
        if seen is not None:
            assert (int(dut.at.value), int(dut.first.value)) == (seen[0], seen[1] & 1)
            tripped += 1
    assert 50 < tripped < 350


def test_comparator_column(simulate):
    simulate()
