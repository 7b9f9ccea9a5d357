"""Taxels that compare by themselves: against straight lines cut by hand, and beside the scanned board."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel.simulate import Board, FrameSequence, Scene, Silence, Version2, play, truth
from taxel.simulate.circuit import Circuit, VirtualGround
from taxel.wire import Registers


def heard(board: Board, frames: np.ndarray) -> taxel.Events:
    """What a host decodes of frames."""
    sent = [datagram for frame in frames for datagram in board.frame(frame)]
    decoder = taxel.wire.Decoder(2, array=board.array)
    pieces = [decoder.push(datagram) for datagram in sent]
    assert (decoder.counts.intact, decoder.counts.missing) == (len(sent), 0)
    return sum(pieces[1:], pieces[0])


def cut(frames: np.ndarray, registers: Registers, columns: int) -> list[tuple[float, int, int, bool, int]]:
    """(us, x, y, p, value) of each step that straight lines between frames reach, by rational arithmetic."""
    step, found = registers.noise_floor + 1, []
    line = Fraction(round(100 * registers.line_period), 100)  # us; the board counts in 10 ns
    for index, readings in enumerate(frames.T.tolist()):
        x, y, sent = index % columns, index // columns, 0
        if readings[0] > registers.noise_floor:
            sent = readings[0]
            found.append((0.0, x, y, True, sent))
        for k, (before, now) in enumerate(pairwise(readings)):
            while abs(now - sent) >= step:
                rises = now > sent
                sent += step if rises else -step
                at = (k + Fraction(abs(sent - before), abs(now - before))) * columns * line + x * line
                found.append((float(at), x, y, rises, sent))
    return found


@pytest.mark.parametrize("seed", range(8))
def test_each_step_is_told_when_a_straight_line_reaches_it(seed):
    random, array = np.random.default_rng(seed), taxel.Array(4, 6)
    registers = Registers(array=array, wire_version=2, noise_floor=int(random.integers(0, 6)))
    # A random walk with rests and jumps, constant at the end so that all events are sent.
    steps = random.integers(-25, 26, (60, 24)) * (random.random((60, 24)) < 0.4)
    walk = np.clip(60 + np.cumsum(steps, axis=0), 0, registers.ramp).astype(np.uint16)
    walk = np.concatenate([walk, np.repeat(walk[-1:], 2, axis=0)])
    quiet = Version2(states_us=0)
    events = heard(Board(registers, array, version_2=quiet, asynchronous=True), walk)
    wanted = cut(walk, registers, 6)
    assert (np.diff(events.t) >= 0).all()
    got = sorted(zip(events.y.tolist(), events.x.tolist(), events.t.tolist(), range(len(events)), strict=True))
    assert len(got) == len(wanted) > 100
    for (y, x, t, k), (at, *rest) in zip(got, wanted, strict=True):
        assert [x, y, bool(events.p[k]), int(events.intensity[k])] == rest
        assert at - 1.02 <= t <= at + 0.02, "whole microseconds"


def test_what_a_host_holds_is_within_the_floor_and_steps_are_no_larger():
    random, array = np.random.default_rng(1), taxel.Array(3, 3)
    registers = Registers(array=array, wire_version=2, noise_floor=4)
    board, decoder = Board(registers, array, asynchronous=True), taxel.wire.Decoder(2, array=array)
    walk = random.integers(0, 151, (200, 9)).astype(np.uint16)
    for frame in [*walk, walk[-1], walk[-1]]:
        for datagram in board.frame(frame):
            decoder.push(datagram)
    assert (np.abs(decoder.held.ravel() - walk[-1].astype(int)) <= 4).all()


def test_a_slow_press_is_told_between_the_frames_of_a_scan():
    """Taxels that rise by a tick each 2 ms: whole frames when scanned, their own times when not."""
    slope_us, frames = 2000.0, 1000
    values = np.broadcast_to(np.arange(frames)[:, None, None] * 192.0 / slope_us / 150.0, (frames, 64, 64))
    acts = [Silence(1.0), FrameSequence(values.astype(np.float32), 192.0)]
    quiet = {"noise_ticks": 0.0, "gain_spread": 0.0, "offset_mv": 0.0}
    scanned, alone = (
        play(acts, seed=1, tare_ms=0.0, sensor=quiet, wire=2, asynchronous=which).events for which in (False, True)
    )
    assert len(alone) == pytest.approx(len(scanned), rel=0.02)
    assert (scanned.t % 192 == 0).all()
    assert len(np.unique(alone.t % 192)) > 30


def test_an_array_by_itself_hears_the_same_touch_as_a_scanned_one():
    acts = [Silence(60.0), Scene.draw(seed=3)]
    contact = truth(acts)[0][0].start_us
    scanned, alone = (play(acts, seed=3, wire=2, asynchronous=which) for which in (False, True))
    assert [p for _, p in alone.events.markers] == [p for _, p in scanned.events.markers] == [True, False]
    for played in (scanned, alone):
        touched = played.events.t[(played.events.t > contact) & played.events.p]
        # Half a frame, the fabric's 50 us and the first contact of the foam.
        assert 0 < touched[0] - contact < 2000
        assert played.words == 0 < played.bytes
    assert abs(np.percentile(alone.events.t, 50) - np.percentile(scanned.events.t, 50)) < 30_000


def test_a_board_alone_and_in_a_play_read_through_the_circuit():
    """An ideal circuit changes nothing; a shared switch takes something from a pressed column."""
    pressed = np.full((64, 64), 49, np.uint16)
    pressed[:, 5] = 140
    lines = VirtualGround(gain=None, switch_ohm=50.0)
    plain = taxel.simulate.circuit.Converter(hysteresis_v=0.0, settle_us=0.0, discharge_us=0.0)
    ideal = Circuit(readout=VirtualGround().ideal(), converter=plain)
    values = {}
    for name, circuit in (("none", None), ("ideal", ideal), ("shared", Circuit(readout=lines, converter=plain))):
        decoder, board = taxel.wire.Decoder(2), Board(Registers(wire_version=2), circuit=circuit)
        for datagram in [d for _ in range(2) for d in board.frame(pressed)]:
            decoder.push(datagram)
        values[name] = decoder.held
    assert (values["ideal"] == values["none"]).all()
    assert (values["shared"][:, 5] < 136).all()
    assert (np.delete(values["shared"], 5, axis=1) == 49).all()
    with refused():
        Board(circuit=Circuit()).frame(np.zeros(7, np.uint16))

    press = {"pressed": {"peak_n": 3.0, "speed_mm_s": 60.0, "hold_ms": 10.0}}
    ball = {"shape": {"sphere": {"radius_mm": 8.0}}, "x_mm": 20.0, "y_mm": 22.0, "mass_g": 30.0, "motion": press}
    acts, array = [Silence(60.0), Scene({"bodies": [ball]})], taxel.Array(16, 16, pitch_mm=2.67)
    plays = [play(acts, seed=2, array=array, circuit=circuit) for circuit in (None, ideal, Circuit())]
    assert len(plays[0].events) > 100
    assert plays[0].events == plays[1].events
    assert plays[0].events != plays[2].events
    with refused(argument="circuit"):
        play(acts, seed=2, circuit=Circuit(readout=VirtualGround(v_trans=0.5)))
