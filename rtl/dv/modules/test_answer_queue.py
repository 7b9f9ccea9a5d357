"""Answers that wait: each comes out once and in order, and there is room until as many wait as the queue holds."""

import random
from collections import deque

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


@cocotb.test()
async def answers_come_out_once_and_in_order(dut):
    Clock(dut.clk, 10, "ns").start()
    depth, bits = int(dut.DEPTH.value), len(dut.answered)
    waiting, full = deque(), 0
    for clock in range(4000):
        reset = clock == 0 or random.random() < 0.005
        often = 0.8 if clock // 100 % 2 else 0.2
        answer = not reset and len(waiting) < depth and random.random() < often
        pop = not reset and bool(waiting) and random.random() < 1 - often
        value = random.getrandbits(bits)
        dut.reset.value, dut.answer.value, dut.answered.value, dut.pop.value = int(reset), int(answer), value, int(pop)
        await FallingEdge(dut.clk)
        if pop:
            waiting.popleft()
        if answer:
            waiting.append(value)
        if reset:
            waiting.clear()
        assert int(dut.ready.value) == bool(waiting)
        assert int(dut.room.value) == (len(waiting) < depth)
        if waiting:
            assert int(dut.oldest.value) == waiting[0]
        full += len(waiting) == depth
    assert full > 100


def test_answer_queue(simulate):
    simulate()
