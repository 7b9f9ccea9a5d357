"""Whole frames of the simulated logic in version 2 of the wire, datagram by datagram against the emulated board."""

import numpy as np
import pytest

from pair import Pair, answers, drawing
from scenes import OFTEN, SEEDS, clocks, in_version_2, last_faults, pressures, settles, write
from taxel.simulate import NOT_RETURNED
from taxel.wire import Decoder

#: Columns, rows, channels, what a value is compared with, what an event holds, for how long it may wait; bytes of
#: the link.
BUILDS = [
    (8, 8, 16, "last_sent", "value", 0, 1),
    (5, 7, 16, "last_sample", "difference", 300, 4),
    (9, 64, 16, "last_sent", "nothing", 40, 1),
    (6, 128, 64, "last_sent", "value", 0, 4),
]


def built(columns: int, rows: int, channels: int, previous: str, intensity: str, hold_us: int, link_bytes: int) -> Pair:
    """Return a pair in a session whose number is not that of a quiet first frame."""
    rng = np.random.default_rng([columns, rows])
    first = rng.integers(0, 1200, (rows, columns)).astype(np.uint16)
    first[-1, -1] = NOT_RETURNED
    options = OFTEN | {"hold_us": hold_us}
    values = {"previous": previous, "intensity": intensity}
    return Pair(columns, rows, channels, first=first, version_2=options, LINK_BYTES=link_bytes, CSEL_CLOCKS=1, **values)


def kinds(pair: Pair) -> set[int]:
    """Return the kinds of the datagrams of version 2."""
    return {datagram[1] & 15 for datagram in pair.received if datagram[0] == 0x54}


def test_quick_frames_of_version_2_are_the_emulated_boards():
    rng = np.random.default_rng(31)
    pair = built(*BUILDS[0])
    in_version_2(pair)
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(60):
        ticks = pressures(rng, pair, ticks)
        pair.frame(ticks)
    pair.finish()
    assert pair.agrees
    assert kinds(pair) == {1, 4, 6}
    # A reset begins a session of another number, in the version of the build.
    for _ in range(2):
        pair.reset(rng.integers(0, 150, pair.array.shape).astype(np.uint16))
        in_version_2(pair)
        for k in range(5):
            pair.frame(np.full(pair.array.shape, 20 * k, np.uint16))
        pair.finish()
        assert pair.agrees
        assert len(pair.received) > 5


def test_128_lines_begin_in_version_2():
    rng = np.random.default_rng(128)
    pair = Pair(128, 8, version_2=OFTEN | {"states_us": 20_000})
    assert pair.board.registers.wire_version == 2
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(12):
        ticks = pressures(rng, pair, ticks)
        pair.frame(ticks)
    pair.finish()
    assert pair.agrees
    assert kinds(pair) == {1, 6}
    assert max(datagram[17] >> 4 for datagram in pair.received) > 7


def test_a_link_that_is_behind_repeats_fewer_lines_each_in_its_turn_with_its_values():
    rng = np.random.default_rng(60)
    # A line comes due with nearly every frame of 24 us, and the link carries fewer than that.
    pair = Pair(8, 64, QUEUE=1 << 14, version_2={"states_us": 200, "heartbeat_us": 60})
    in_version_2(pair)
    pair.frame(np.full(pair.array.shape, 100, np.uint16))
    pair.logic.call("link", 60)
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(60):
        moves = rng.random(ticks.shape) < rng.choice([0.05, 0.5])
        ticks = np.where(moves, rng.integers(0, 150, ticks.shape), ticks).astype(np.uint16)
        pair.frame(ticks)
    pair.logic.call("link", 256)
    pair.finish()
    received, expected = ([d for d in all_ if d[0] == 0x54] for all_ in (pair.received, pair.expected))
    lines = [datagram[16] >> 5 for datagram in received if datagram[1] & 15 == 6]
    assert lines == [k % 8 for k in range(len(lines))]
    assert 20 < len(lines) < sum(datagram[1] & 15 == 6 for datagram in expected)
    # Nothing else differs but their numbers, and no repeated value differs from what the events before it said.
    assert pair.board.counts["dropped"] == 0
    others = [[d[8:-4] for d in all_ if d[1] & 15 not in (4, 6)] for all_ in (received, expected)]
    assert others[0] == others[1]
    decoders = [Decoder(2, array=pair.array) for _ in range(2)]
    for decoder, datagrams in zip(decoders, (received, expected), strict=True):
        for datagram in datagrams:
            decoder.push(datagram)
    assert decoders[0].counts.states > 1000
    assert decoders[0].counts.repaired == decoders[1].counts.repaired


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("columns", "rows", "channels", "previous", "intensity", "hold_us", "link_bytes"), BUILDS)
def test_random_pressures_and_writes_in_both_versions(
    columns, rows, channels, previous, intensity, hold_us, link_bytes, seed
):
    rng = drawing(seed, columns, rows, channels)
    pair = built(columns, rows, channels, previous, intensity, hold_us, link_bytes)
    if rows <= 64:
        # Time for ramps of more than 255 ticks.
        held = pair.board.registers
        pair.write(held.commands_to(held.with_preset("2 kHz")))
        in_version_2(pair)
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(250):
        ticks = pressures(rng, pair, ticks)
        command = write(rng, pair, in_version_2=0.7) if pair.answered and rng.random() < 0.7 else b""
        if command and not settles(pair, command):
            command = b""
        pair.frame(ticks, command, int(rng.integers(0, clocks(pair.board.registers))) if command else 0)
    pair.finish()
    assert not pair.logic.call("shared")
    assert pair.agrees
    assert answers(pair.serial) == pair.answers
    assert last_faults(pair.serial) == last_faults(pair.board.faults())
    # Which of the two kinds with values, and whether markers come, is drawn.
    assert kinds(pair) >= {4}
    assert kinds(pair) & ({0} if intensity == "nothing" else {6, 7})
