"""Taxels that compare by themselves: against straight lines cut by hand, and beside the scanned board."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

import taxel
from taxel.simulate import Board, FrameSequence, Silence, Version2, play
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
