"""`taxel.device` on the pins of the simulated logic's serial line."""

import contextlib
import os
import threading
import tty

import pytest

from pair import Pair
from taxel import DeviceError
from taxel.device import Device
from taxel.wire import Command


@pytest.fixture
def line():
    """A pseudo-terminal with the logic at its other end, which runs until the test is over."""
    logic = Pair(8, 8).logic
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    over = threading.Event()

    def run():
        while not over.is_set():
            with contextlib.suppress(BlockingIOError):
                logic.send(os.read(ours, 1024))
            logic.run(1000)
            os.write(ours, logic.serial().encode())

    thread = threading.Thread(target=run)
    thread.start()
    yield os.ttyname(theirs)
    over.set()
    thread.join()
    os.close(ours)
    os.close(theirs)


def test_quick_a_device_sets_reads_back_and_records(line):
    with Device(line, timeout=30) as device:
        assert (device.greeting.rows, device.greeting.columns, device.greeting.channels) == (8, 8, 16)
        assert device.registers.lines == 8
        slow = device.apply("2 kHz")
        assert (slow.step_period, slow.ramp, slow.lines) == (1.95, 510, 8)
        assert device.registers == slow
        assert device.apply("5.2 kHz").ramp == 150
        assert device.set(noise_floor=17).noise_floor == 17
        assert device.record(True).record
        with pytest.raises(DeviceError, match="REG4 rule 3"):
            device.cable.command(Command(4, 65_000))
        assert device.registers.ramp == 150
