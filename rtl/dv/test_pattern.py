"""The pattern, frame by frame against the emulated board; and the button that starts it."""

import numpy as np
import pytest

import pins
from board import COLUMNS, ROWS, Pins
from ethernet import payload_of
from pair import Pair, drawing
from scenes import pressures
from taxel import Array
from taxel.simulate import Board, pattern
from taxel.wire import Command, Decoder, Registers


@pytest.mark.parametrize(("columns", "rows", "channels", "version"), [(8, 8, 16, 1), (5, 7, 64, 2)])
def test_quick_the_pattern_is_the_emulated_boards(columns, rows, channels, version):
    rng = drawing(None, columns, rows, channels)
    pair = Pair(columns, rows, channels, seed=int(rng.integers(1, 1000)), asserts=True, QUEUE=4096)
    # Floor 0 lets each change of a value be seen.
    pair.write([Command(5, columns - 1 << 16)])
    ticks = np.zeros(pair.array.shape, np.uint16)
    # On; with another ramp, that is lower than the ball; as afferents; off, and on again.
    flags = 1 << 3 | (version - 1) << 4
    writes = [
        (0, flags | 1 << 6),
        (4, 33 << 16 | 90),
        (0, flags | 1 << 6 | 2 | 983 << 16),
        (0, flags),
        (0, flags | 1 << 6),
    ]
    rolled = 0
    for number, value in writes:
        pair.frame(ticks, Command(number, value).to_bytes())
        for frame in range(90):
            ticks = pressures(rng, pair, ticks)
            pair.frame(ticks)
            rolled += pair.board.registers.pattern and frame > 3
        assert pair.answered
    pair.finish()
    assert pair.received == pair.expected
    assert sum(map(len, pair.received)) > 1000
    assert rolled > 300


def test_the_host_computes_each_value_of_a_pattern():
    pair = Pair(8, 8)
    pair.write([Command(5, 7 << 16)])
    pair.frame(np.zeros((8, 8), np.uint16), Command(0, 1 << 3 | 1 << 6).to_bytes())
    for _ in range(60):
        pair.frame(np.full((8, 8), 77, np.uint16))
    decoder, first = Decoder(array=pair.array), None
    held = np.zeros((8, 8), np.uint16)
    frame_us = pair.registers.frame_us
    frames = 0
    for datagram in pair.received:
        events = decoder.push(datagram)
        if not len(events):
            continue
        first = events.t[0] if first is None else first
        for t in np.unique(events.t):
            now = events.t == t
            held[events.y[now], events.x[now]] = events.intensity[now]
            # Stamps are of 100 us, and a frame of eight lines takes 24: some frame's picture with this stamp is there.
            n = [n for n in range(400) if abs(n * frame_us - (t - first)) <= 100 + frame_us]
            assert any(np.array_equal(held, pattern(k, array=pair.array)) for k in n), t
            frames += 1
    assert frames > 10


def test_the_table_of_pins_is_that_of_the_lpf():
    text = pins.PAGE.read_text()
    assert pins.page(text) == text


def test_a_button_that_is_held_for_long_starts_the_pattern():
    board_pins = Pins(3, PATTERN_CLOCKS=300)
    array = Array(ROWS, COLUMNS)
    board_pins.steady(True)
    rolled = []
    # How long the button is held, ns; a button bounces as it is pressed and as it is released.
    for held in (500, 2500, 3500, 500, 3500):
        for pressed, ns in ((True, 40), (False, 30), (True, held), (False, 50), (True, 60), (False, 0)):
            board_pins.button(pressed)
            board_pins.run(ns)
            assert board_pins.in_reset() or not pressed or ns < 50
        board_pins.frames()
        for _ in range(2):
            assert board_pins.run(1_000_000)
        received = []
        for _ in range(30):
            assert board_pins.run(1_000_000)
            received += board_pins.frames()
        board = Board(Registers(array=array, channels=64, pattern=held == 3500), array, queue=1 << 30)
        expected = [datagram for _ in range(28) for datagram in board.frame(np.zeros((ROWS, COLUMNS), np.uint16))]
        payloads = [payload_of(frame) for frame in received]
        assert payloads[: len(expected)] == expected
        rolled.append(len(expected))
    assert rolled[0] == rolled[1] == rolled[3] == 0
    assert rolled[2] == rolled[4] > 5
