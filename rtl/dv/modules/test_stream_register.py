"""A register in a stream: all comes out once and in order, one a clock, and no input passes through within a clock."""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer


@cocotb.test()
async def everything_comes_out_once_and_in_order(dut):
    Clock(dut.clk, 10, "ns").start()
    dut.valid_in.value, dut.ready_out.value, dut.reset.value = 0, 0, 1
    await FallingEdge(dut.clk)
    dut.reset.value = 0
    sent, came, valid, data = [], [], False, 0
    for _ in range(100):
        often_valid, often_ready = random.choice([0.1, 0.5, 1]), random.choice([0.1, 0.5, 1])
        before = len(came)
        for _ in range(50):
            # What is offered stands until it is taken.
            if not valid:
                valid, data = random.random() < often_valid, random.getrandbits(12)
            ready = random.random() < often_ready
            outputs = dut.ready_in.value, dut.valid_out.value, dut.data_out.value
            dut.valid_in.value, dut.data_in.value, dut.ready_out.value = int(valid), data, int(ready)
            await Timer(1, "ns")
            assert outputs == (dut.ready_in.value, dut.valid_out.value, dut.data_out.value)
            if ready and int(dut.valid_out.value):
                came.append(int(dut.data_out.value))
            if valid and int(dut.ready_in.value):
                sent.append(data)
                valid = False
            await FallingEdge(dut.clk)
        if often_valid == often_ready == 1:
            assert len(came) - before >= 49
    assert came == sent[: len(came)]
    assert len(sent) - len(came) <= 2
    assert len(came) > 1000


def test_stream_register(simulate):
    simulate("BITS=12")
