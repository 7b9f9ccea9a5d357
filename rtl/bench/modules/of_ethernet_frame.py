"""Frames of Ethernet: each payload's frame is what IEEE 802.3, RFC 791 and RFC 768 say, behind its gap."""

import random

import cocotb
from cocotb.triggers import FallingEdge
from drivers import begin, reset, settled

from ethernet import GAP, payload_of

#: The module's addresses and ports, where none are given.
ADDRESSES = {"macs": bytes([255] * 6 + [0] * 6), "ips": bytes(8), "ports": bytes(4)}


@cocotb.test()
async def payloads_become_frames(dut):
    await begin(dut, waits=0)
    waiting = [bytes(random.choices(range(256), k=n)) for n in [*range(1, 60), 255, 256, 1472] * 2]
    random.shuffle(waiting)
    expected, frame, frames, gap, gaps, shown, taken = list(waiting), bytearray(), [], -1000, [], None, None
    byte, quiet = 0, 0
    while quiet < 2000:
        if random.random() < 0.0003:
            # A reset breaks the frame that is being sent off.
            await reset(dut, waits=0)
            if shown is not None:
                waiting.insert(0, shown)
            elif frame:
                expected.remove(taken)
            shown, gap = None, -1000
            frame.clear()
        if shown is None and waiting and random.random() < random.choice([0.01, 1]):
            shown = waiting.pop(0)
        dut.waits.value = int(shown is not None)
        dut.length.value = len(shown) if shown else 0
        dut.fetched.value = byte
        await settled()
        # A byte of the payload comes a clock after it was asked for.
        at = int(dut.at.value)
        byte = shown[at] if shown and at < len(shown) else random.randrange(256)
        if int(dut.taken.value):
            taken, shown = shown, None
        if int(dut.enable.value):
            frame.append(int(dut.txd.value))
            if len(frame) == 1 and gap >= 0:
                gaps.append(gap)
            gap = 0
        else:
            gap += 1
            if frame:
                frames.append(payload_of(bytes(frame), **ADDRESSES))
                frame.clear()
        quiet = 0 if waiting or shown else quiet + 1
        await FallingEdge(dut.clk)
    assert frames == expected
    assert GAP <= min(gaps) <= GAP + 2
