"""The sender of UDP: payloads become frames on another clock, whatever the pauses; a longer one is cut."""

import itertools
import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge, Timer
from cocotbext.axi import AxiStreamBus, AxiStreamSource

from drivers import Pace, begin, clocks, reset, vary
from ethernet import GAP, payload_of


@cocotb.test()
async def payloads_become_frames(dut):
    most = int(dut.MOST.value)
    frames, gaps = [], []

    async def watch():
        frame, gap = bytearray(), GAP
        while True:
            await FallingEdge(dut.clk_link)
            if int(dut.tx_enable.value):
                if not frame:
                    gaps.append(gap)
                frame.append(int(dut.txd.value))
                gap = 0
            else:
                if frame:
                    frames.append(bytes(frame))
                    frame.clear()
                gap += 1

    source, pace = AxiStreamSource(AxiStreamBus.from_entity(dut), dut.clk, dut.reset), Pace()
    source.set_pause_generator(not pace() for _ in itertools.count())
    for link_ps in (8000, 7990, 8012, 2000, 40_000):
        link = Clock(dut.clk_link, link_ps, "ps")
        link.start()
        pace.often = 1.0
        if link_ps == 8000:
            await begin(dut, tvalid=0)
        await Timer(random.randrange(40_000), "ps")
        await FallingEdge(dut.clk)
        await reset(dut, tvalid=0)
        await clocks(dut.clk, 60)
        watching = cocotb.start_soon(watch())
        if random.random() < 0.5:
            # What was not sent at a reset is forgotten; the frame that is being sent ends where it is.
            source.send_nowait(bytes(20))
            source.send_nowait(bytes(1000))
            await clocks(dut.clk, 52)
            dut.reset.value = 1
            source.clear()
            await clocks(dut.clk, 40)
            dut.reset.value = 0
            await clocks(dut.clk, 60)
            frames.clear()
            gaps.clear()
        lengths = [
            random.choice([1, 2, 17, 18, 19, random.randrange(1, most + 1), most, most + 1, most + 9])
            for _ in range(25)
        ]
        payloads = [bytes(random.choices(range(256), k=length)) for length in lengths]
        varying = cocotb.start_soon(vary(dut.clk, 800, pace))
        for payload in payloads:
            source.send_nowait(payload)
        await source.wait()
        await clocks(dut.clk_link, 6 * (most + 100))
        for task in (watching, varying):
            task.cancel()
        link.stop()
        assert [payload_of(frame) for frame in frames] == [payload[:most] for payload in payloads], link_ps
        assert min(gaps) >= GAP
        frames.clear()
        gaps.clear()


def test_udp_sender(simulate):
    simulate("MOST=90")
