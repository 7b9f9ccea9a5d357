"""Commands of five bytes: the whole ones come out with number and value, all other bytes are counted as skipped.

None stands for a byte without a stop bit.
"""

import random

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge


def parsed(data):
    """Return commands, each with its last byte's place, and how many bytes belong to none, the end left out."""
    commands, held, skipped = [], [], 0
    for place, byte in enumerate(data):
        if byte is None:
            skipped += len(held) + 1
            held = []
        elif byte & 0x80:
            skipped += len(held)
            held = [byte]
        elif not held:
            skipped += 1
        else:
            held.append(byte)
        if len(held) == 5:
            value = 0
            for k in range(4):
                value = value << 8 | (held[0] >> (3 - k) & 1) << 7 | held[k + 1]
            commands.append((place, held[0] >> 4 & 7, value))
            held = []
    return commands, skipped


@cocotb.test()
async def whole_commands_come_out_and_damage_is_counted(dut):
    Clock(dut.clk, 10, "ns").start()
    dut.valid.value, dut.broken.value, dut.reset.value = 0, 0, 1
    for _ in range(3):
        await FallingEdge(dut.clk)
    dut.reset.value = 0
    data = []
    while len(data) < 3000:
        whole = [0x80 | random.randrange(128), *(random.randrange(128) for _ in range(4))]
        # Some lose bytes, some get others between.
        data += [byte for byte in whole if random.random() < 0.95]
        if random.random() < 0.2:
            data.append(random.randrange(256))
        if random.random() < 0.05:
            data.insert(len(data) - random.randrange(4), None)
    found, skipped = [], 0
    waiting = list(data)
    while waiting:
        valid = random.random() < 0.7
        byte = waiting.pop(0) if valid else random.randrange(256)
        broken = byte is None
        dut.valid.value, dut.broken.value = int(valid and not broken), int(broken)
        dut.data.value = random.randrange(256) if broken else byte
        await FallingEdge(dut.clk)
        skipped += int(dut.skipped.value)
        if int(dut.command.value):
            # It stands a clock after its last byte.
            assert valid
            found.append((len(data) - len(waiting) - 1, int(dut.number.value), int(dut.value.value)))
    assert (found, skipped) == parsed(data)
    assert len(found) > 300
    assert skipped > 100


def test_command_receiver(simulate):
    simulate()
