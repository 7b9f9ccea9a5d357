"""The queue: each word comes out once, unchanged and in order; it is full where DEPTH words wait, and never before."""

import random
from collections import deque

import cocotb
import pytest
from cocotb.triggers import FallingEdge

from drivers import Pace, begin, reset, settled, vary

#: Clocks from a word to its place at the output, where nothing waits.
LATENCY = 5


@cocotb.test()
async def words_come_out_once_and_in_order(dut):
    depth, bits = int(dut.DEPTH.value), len(dut.entered)
    push_pace, pop_pace = Pace(), Pace()
    await begin(dut, push=0, pop=0)
    cocotb.start_soon(vary(dut.clk, 700, push_pace, pop_pace))
    queue, most, empty, since_pop, popped = deque(), 0, 0, 0, 0
    alone = None  # clocks since a word came where nothing waited
    for _ in range(9 * 700):
        if random.random() < 0.001:
            await reset(dut, push=0, pop=0)
            queue.clear()
            alone = None
        await settled()
        ready = int(dut.ready.value)
        assert int(dut.empty.value) == (not queue)
        if ready:
            assert int(dut.oldest.value) == queue[0]
        # Two more stand behind the ring.
        assert len(queue) >= depth if int(dut.full.value) else len(queue) <= depth + 1
        if alone is not None:
            alone += 1
            assert ready == (alone == LATENCY)
            alone = None if ready else alone
        since_pop = 0 if ready or not queue else since_pop + 1
        assert since_pop <= 5
        push, pop = not int(dut.full.value) and push_pace(), bool(ready) and pop_pace()
        word = random.getrandbits(bits)
        dut.push.value, dut.entered.value, dut.pop.value = int(push), word, int(pop)
        most, empty, popped = max(most, len(queue)), empty + (not queue), popped + pop
        await FallingEdge(dut.clk)
        if push and not queue:
            alone = 0
        if pop:
            queue.popleft()
        if push:
            queue.append(word)
    assert most == depth + 2
    assert empty > 100
    assert popped > 1000


@pytest.mark.parametrize("build", ["DEPTH=4 BITS=8", "DEPTH=5 BITS=12"])
def test_event_fifo(simulate, build):
    simulate(build)
