"""Comparators of the simulated circuit, with ramp, settling and hysteresis, drive the logic and the emulated board."""

from itertools import pairwise

import numpy as np
import pytest

from pair import Pair
from taxel.simulate import NOT_RETURNED
from taxel.simulate.circuit import Converter
from taxel.wire import Decoder


@pytest.mark.parametrize("inverted", [False, True])
def test_quick_comparators_of_the_simulated_circuit_give_the_emulated_boards_datagrams(inverted):
    rng = np.random.default_rng(11)
    pair = Pair(8, 8)
    held = pair.board.registers
    pair.write(held.commands_to(held.replace(invert_comparator=inverted, noise_floor=0)))
    held = pair.board.registers
    # A ramp that falls back slowly: some comparators have not returned when the next begins. Some lines lie above it.
    converter = Converter(
        ramp=held.ramp,
        wait_us=held.step_period - held.step_read,
        step_us=held.step_period,
        line_us=held.line_period,
        discharge_us=0.2,
    )
    trips = converter.ticks(rng.uniform(0.5, 4.5, (30, 8, 8)))
    assert 0 < np.isnan(trips).sum() < trips.size / 4
    assert 0 < (trips == held.ramp).sum() < trips.size / 2
    # An edge within tick k counts k.
    ticks = np.where(np.isnan(trips), NOT_RETURNED, np.floor(np.nan_to_num(trips))).astype(np.uint16)
    sent = len(pair.received)
    for frame in ticks:
        pair.frame(frame)
    pair.finish()
    assert pair.received == pair.expected
    faults = [line for line in pair.serial.splitlines() if line.startswith("fault comparator")]
    assert faults[-1].split()[2] == str(np.isnan(trips).sum())
    # Each taxel sent every new count that it was read with, in order; at last, in quiet frames, 0.
    decoder = Decoder()
    parts = [decoder.push(datagram) for datagram in pair.received[sent:]]
    x, y, value = (np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "y", "intensity"))
    for row, column in np.ndindex(8, 8):
        read = [0, *(int(t) for t in ticks[:, row, column] if t != NOT_RETURNED), 0]
        new = [b for a, b in pairwise(read) if a != b]
        assert value[(x == column) & (y == row)].tolist() == new
