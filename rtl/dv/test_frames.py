"""Whole frames of the simulated logic, datagram by datagram against the emulated board."""

import numpy as np
import pytest

from pair import Pair, answers, drawing
from scenes import SEEDS, clocks, last_faults, pressures, settles, write
from taxel.wire import Command, Decoder

#: Columns, rows, channels, what a value is compared with, clocks of half a pulse of the shift registers: lines settle
#: in random order only where these are short.
BUILDS = [
    (8, 8, 16, "last_sent", 1),
    (5, 7, 16, "last_sample", 8),
    (9, 64, 16, "last_sent", 1),
    (3, 20, 64, "last_sent", 8),
]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("columns", "rows", "channels", "previous", "csel_clocks"), BUILDS)
def test_random_pressures_and_writes_give_the_emulated_boards_datagrams(
    columns, rows, channels, previous, csel_clocks, seed
):
    rng = drawing(seed, columns, rows, channels)
    seed = int(rng.integers(1, 1000))
    # One build looks at what the modules assert.
    asserts = csel_clocks == 8
    options = {"previous": previous, "asserts": asserts, "CSEL_CLOCKS": csel_clocks, "QUEUE": 4096}
    pair = Pair(columns, rows, channels, seed=seed, **options)
    ticks = np.zeros(pair.array.shape, np.uint16)
    for _ in range(200):
        ticks = pressures(rng, pair, ticks)
        registers = pair.board.registers
        command = write(rng, pair) if pair.answered and rng.random() < 0.7 else b""
        if command and not settles(pair, command):
            command = b""
        pair.frame(ticks, command, int(rng.integers(0, clocks(registers))) if command else 0)
    pair.finish()
    # Not every seed draws a write that is refused.
    pair.write([Command(7, 1)])
    assert not pair.logic.call("shared")
    assert pair.received == pair.expected
    assert sum(map(len, pair.received)) > 200
    assert answers(pair.serial) == pair.answers
    assert pair.answers.count("bad") > 0
    assert pair.answers.count("ok") > 3
    assert last_faults(pair.serial) == last_faults(pair.board.faults())
    assert last_faults(pair.serial)["comparator"] > 0


@pytest.mark.parametrize("intensity", ["difference", "nothing"])
def test_the_intensity_word_is_as_chosen(intensity):
    rng = np.random.default_rng(5)
    pair = Pair(8, 8, intensity=intensity)
    ticks = np.zeros((8, 8), np.uint16)
    for _ in range(60):
        ticks = pressures(rng, pair, ticks)
        pair.frame(ticks)
    pair.finish()
    assert pair.received == pair.expected
    assert len(pair.received) > 20


def test_a_slow_link_changes_no_byte():
    rng = np.random.default_rng(6)
    pair = Pair(8, 8, QUEUE=4096)
    pair.logic.call("link", 30)
    ticks = np.zeros((8, 8), np.uint16)
    for _ in range(100):
        ticks = pressures(rng, pair, ticks)
        pair.frame(ticks)
    pair.logic.call("link", 256)
    pair.finish()
    assert pair.received == pair.expected
    assert "fault queue" not in pair.serial


@pytest.mark.parametrize(("version", "link_bytes"), [(1, 1), (2, 1), (2, 4)])
def test_a_full_frame_of_64_by_64_goes_without_a_loss(version, link_bytes):
    pair = Pair(64, 64, LINK_BYTES=link_bytes)
    still = np.zeros((64, 64), np.uint16)
    pair.frame(still, Command(0, 8 | (version - 1) << 4).to_bytes())
    pair.frame(still)
    pair.expected.clear()
    pair.received.clear()
    pair.frame(still + 100)
    for _ in range(4):
        pair.frame(still + 100)
    assert pair.agrees
    decoder = Decoder(version)
    events = [decoder.push(datagram) for datagram in pair.received]
    assert sum(map(len, events)) == 4096
    assert "fault queue" not in pair.serial


#: Bytes of the link, version of the wire, the ramp (wide values above 255 ticks), whether events carry their frame's
#: time; then the clocks that a taxel takes at most where all of a frame change.
PACES = [
    (1, 1, 150, True, 10.0),
    (1, 2, 150, True, 3.06),
    (1, 2, 510, True, 4.12),
    (1, 2, 150, False, 3.14),
    (1, 2, 510, False, 4.6),
    (4, 1, 150, True, 10.0),
    (4, 2, 150, True, 3.06),
    (4, 2, 510, True, 3.06),
    (4, 2, 150, False, 3.14),
    (4, 2, 510, False, 3.26),
]


@pytest.mark.parametrize(("link_bytes", "version", "ramp", "frame_sync", "most"), PACES)
def test_a_taxel_takes_so_many_clocks(link_bytes, version, ramp, frame_sync, most):
    assert 0.98 * most < pace(link_bytes, version, ramp, frame_sync) <= most


def pace(link_bytes: int, version: int, ramp: int, frame_sync: bool) -> float:
    """Return clocks a taxel of a frame in which all change: the queue holds them, and the link is always ready."""
    pair = Pair(64, 64, LINK_BYTES=link_bytes)
    held = pair.board.registers
    preset = held.with_preset("2 kHz").replace(ramp=ramp, wire_version=version, frame_sync=frame_sync)
    pair.write(held.commands_to(preset))
    logic = pair.logic
    logic.datagrams()
    logic.call("link", 0)
    logic.ticks(np.full((64, 64), ramp - 1, np.uint16))
    logic.edge()
    logic.edge()
    logic.call("link", 256)
    decoder, ends, events = Decoder(version), [], []
    while sum(events) < 4096:
        logic.run(4)
        for datagram in logic.datagrams():
            ends.append(logic.call("clock"))
            events.append(len(decoder.push(datagram)))
    # Two datagrams of version 2 stood in the buffer, and the last one is short.
    return (ends[-2] - ends[2]) / sum(events[3:-1])


def test_what_finds_no_room_is_dropped_counted_and_sent_later():
    pair = Pair(8, 8, QUEUE=16)
    pair.logic.call("link", 0)
    still = np.full((8, 8), 50, np.uint16)
    pair.logic.ticks(still)
    pair.logic.edge()
    pair.logic.run(1000)
    pair.logic.call("link", 256)
    pair.logic.run(1000)
    pair.logic.ticks(still)
    pair.logic.edge()
    pair.logic.edge()
    pair.logic.run(6000)
    decoder = Decoder()
    events = [decoder.push(datagram) for datagram in pair.logic.datagrams()]
    places = [place for part in events for place in zip(part.x.tolist(), part.y.tolist(), strict=True)]
    assert len(places) == len(set(places)) == 64
    # The queue, its two registers behind the ring and the packer's own are full before the rest of the frame is lost.
    kept = 16 + 2 + 1
    order = [(x, 4 * channel + step) for x in range(8) for step in range(4) for channel in range(2)]
    assert places[:kept] == order[:kept]
    assert last_faults(pair.logic.serial())["queue"] >= 64 - kept
