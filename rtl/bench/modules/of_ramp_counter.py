"""The converter's timer: a ramp is high for as many halves of a clock as it is long, and its pairs are counted."""

import random

import cocotb
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
    for length in [*range(1, 12), *(random.randrange(1, 300) for _ in range(40))]:
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
