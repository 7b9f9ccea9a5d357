"""Frames of Ethernet: each payload's frame is what IEEE 802.3, RFC 791 and RFC 768 say, behind its gap."""

import random

import cocotb
from cocotb.triggers import FallingEdge

from drivers import begin, reset, settled
from ethernet import GAP, payload_of

#: Clocks from a payload to the first byte of its frame.
LATENCY = 5
#: The module's addresses and ports, where none are given.
ADDRESSES = {"macs": bytes([255] * 6 + [0] * 6), "ips": bytes(8), "ports": bytes(4)}


@cocotb.test()
async def payloads_become_frames(dut):
    await begin(dut, waits=0)
    waiting = [bytes(random.choices(range(256), k=n)) for n in [*range(1, 60), 255, 256, 1472] * 2]
    random.shuffle(waiting)
    expected, frame, frames, gap, gaps, shown, leaving = list(waiting), bytearray(), [], -1000, [], None, False
    byte, quiet = 0, 0
    pause, waited = 0, None  # clocks to the next payload, and since it waits where the gap is over
    while quiet < 2000:
        if random.random() < 0.0003:
            # A reset breaks the frame that is being sent off: its payload may be taken, and the next one wait already.
            await reset(dut, waits=0)
            if shown is not None:
                waiting.insert(0, shown)
            if leaving:
                del expected[len(frames)]
            shown, leaving, gap, waited = None, False, -1000, None
            frame.clear()
        pause, waited = pause - 1, None if waited is None else waited + 1
        if shown is None and waiting and pause < 0:
            shown = waiting.pop(0)
            waited = 0 if not frame and not -1000 <= gap <= GAP else None
        dut.waits.value = int(shown is not None)
        dut.length.value = len(shown) if shown else 0
        dut.fetched.value = byte
        await settled()
        # A byte of the payload comes a clock after it was asked for.
        at = int(dut.at.value)
        byte = shown[at] if shown and at < len(shown) else random.randrange(256)
        if int(dut.taken.value):
            leaving, shown, pause = True, None, random.choice([0, 1, random.randrange(60)])
        if int(dut.enable.value):
            frame.append(int(dut.txd.value))
            assert len(frame) > 1 or waited in (None, LATENCY)
            if len(frame) == 1 and gap >= 0:
                gaps.append(gap)
            gap = 0
        else:
            gap += 1
            if frame:
                frames.append(payload_of(bytes(frame), **ADDRESSES))
                frame.clear()
                leaving = False
        quiet = 0 if waiting or shown else quiet + 1
        await FallingEdge(dut.clk)
    assert frames == expected
    assert GAP <= min(gaps) <= GAP + 2


def test_ethernet_frame(simulate):
    simulate()
