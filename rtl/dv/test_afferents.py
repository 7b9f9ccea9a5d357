"""Taxels as FA-1 afferents in the simulated logic, datagram by datagram against the emulated board."""

import numpy as np
import pytest

from pair import Pair, answers, drawing
from scenes import OFTEN, SEEDS, clocks, last_faults, pressures, settles, write
from taxel.simulate import NOT_RETURNED
from taxel.wire import Command, Decoder

#: Columns, rows, channels, what a value is compared with, what an event holds, probability of version 2 in a write.
BUILDS = [
    (8, 8, 16, "last_sent", "value", 0.0),
    (5, 7, 16, "last_sample", "difference", 0.7),
    (3, 64, 16, "last_sent", "nothing", 0.5),
    (3, 20, 64, "last_sent", "value", 0.5),
    (6, 128, 64, "last_sent", "difference", 1.0),
]


def write_of_afferents(rng: np.random.Generator, pair: Pair, in_version_2: float) -> bytes:
    """Return a command: one that turns afferents on or off, one that moves their thresholds, or another."""
    held = pair.board.registers
    kind = rng.choice(["mode", "rest", "decay", "other"])
    if kind == "mode":
        jump = int(rng.choice([0, 3, 200, 983, 65_535]))
        flags = int(rng.integers(0, 16)) & ~2 | (rng.random() < 0.8) << 1
        return Command(0, jump << 16 | (rng.random() < in_version_2) << 4 | flags).to_bytes()
    if kind == "rest":
        return Command(4, int(rng.choice([0, 1, 33, 2000, 20_000, 65_535])) << 16 | held.ramp).to_bytes()
    if kind == "decay":
        lines = int(rng.integers(0, pair.array.columns))
        return Command(5, lines << 16 | held.noise_floor << 8 | int(rng.choice([0, 1, 51, 255]))).to_bytes()
    return write(rng, pair, in_version_2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("columns", "rows", "channels", "previous", "intensity", "in_version_2"), BUILDS)
def test_random_pressures_and_thresholds_give_the_emulated_boards_spikes(
    columns, rows, channels, previous, intensity, in_version_2, seed
):
    rng = drawing(seed, columns, rows, channels)
    options = OFTEN | {"hold_us": 0}  # as of a build of the tests of version 2
    values = {"previous": previous, "intensity": intensity}
    pair = Pair(columns, rows, channels, version_2=options, CSEL_CLOCKS=1, QUEUE=4096, **values)
    pair.write([Command(4, 33 << 16 | pair.board.registers.ramp), Command(0, 983 << 16 | 10)])
    spiking = 0
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(250):
        ticks = pressures(rng, pair, ticks)
        # Some comparators do not return for some frames.
        ticks[rng.random(ticks.shape) < 0.1] = NOT_RETURNED
        registers = pair.board.registers
        command = write_of_afferents(rng, pair, in_version_2) if pair.answered and rng.random() < 0.5 else b""
        if command and not settles(pair, command):
            command = b""
        sent = len(pair.expected)
        pair.frame(ticks, command, int(rng.integers(0, clocks(registers))) if command else 0)
        spiking += registers.mechanoreceptor and len(pair.expected) > sent
        ticks[ticks == NOT_RETURNED] = 0
    pair.finish()
    assert spiking > 0
    assert pair.agrees
    assert answers(pair.serial) == pair.answers
    assert last_faults(pair.serial) == last_faults(pair.board.faults())


def test_quick_the_first_reading_of_a_taxel_counts_as_what_had_always_been():
    pair = Pair(8, 8)
    still = np.zeros((8, 8), np.uint16)
    held = pair.board.registers
    for command in held.commands_to(held.with_preset("5.2 kHz, FA-1")):
        pair.frame(still, command.to_bytes())
        while not pair.answered:
            pair.frame(still + 100 if command.register == 0 else still)
    assert pair.board.registers.mechanoreceptor
    # The mode begins anew with 100 ticks, while the comparators of one column do not return.
    pair.frame(still + 100, Command(0, 983 << 16 | 8).to_bytes())
    pair.frame(still + 100)
    pair.frame(still + 100, Command(0, 983 << 16 | 10).to_bytes())
    pair.received.clear()
    pair.expected.clear()
    missing = still + 100
    missing[:, 3] = NOT_RETURNED
    for ticks in (missing, missing, still + 70, still + 71, still + 70):
        pair.frame(ticks)
    pair.finish()
    assert pair.received == pair.expected
    decoder = Decoder()
    fell, rose = (decoder.push(datagram) for datagram in pair.received[:2])
    # With 70 ticks all fire but those that read it as their first, which fire with 71.
    places = sorted(zip(fell.x.tolist(), fell.y.tolist(), strict=True))
    assert places == [(x, y) for x in range(8) if x != 3 for y in range(8)]
    assert not fell.p.any()
    assert 3 in rose.x
    assert rose.p.all()
