"""The check of a board, on an emulated board that counts frames instead of a clock, and on faulty ones."""

from __future__ import annotations

import contextlib
import os
import socket
import threading
import tty
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from loopback import free_port

from taxel import Array, ProblemError
from taxel.board_check import BoardCheck, check_board
from taxel.cli import main
from taxel.simulate import NOT_RETURNED, Board
from taxel.wire import Registers

ARRAY = Array(16, 16)
#: For how long a check receives: on a busy machine, too, hundreds of frames come meanwhile.
SECONDS = 3.0


class Emulated:
    """A board on a pseudo-terminal and UDP, far slower than its clock; `spoil` may change what it sends."""

    def __init__(
        self, port: int, registers: Registers, ticks: Any, spoil: Callable[[int, bytes], bytes | None]
    ) -> None:
        self.board, self.ticks, self.spoil, self.port = Board(registers, ARRAY), ticks, spoil, port
        self.ours, theirs = os.openpty()
        tty.setraw(theirs)
        self.theirs, self.place = theirs, os.ttyname(theirs)
        os.set_blocking(self.ours, False)
        self.over = threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self) -> None:
        random, count, frames = np.random.default_rng(1), 0, 0
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            while not self.over.wait(0.001):
                with contextlib.suppress(BlockingIOError):
                    os.write(self.ours, self.board.command(os.read(self.ours, 5)).encode())
                noisy = self.ticks + random.integers(-1, 2, self.ticks.shape)
                values = np.where(self.ticks == NOT_RETURNED, NOT_RETURNED, noisy.clip(0)).astype(np.uint16)
                for datagram in self.board.frame(values):
                    count += 1
                    spoiled = self.spoil(count, datagram)
                    if spoiled is not None:
                        link.sendto(spoiled, ("127.0.0.1", self.port))
                frames += 1
                # A board sends its faults now and then; a line that is not read fills up.
                if frames % 10 == 0:
                    with contextlib.suppress(BlockingIOError):
                        os.write(self.ours, self.board.faults().encode())

    def close(self) -> None:
        self.over.set()
        self.thread.join()
        os.close(self.ours)
        os.close(self.theirs)


@contextlib.contextmanager
def emulated(
    ticks: Any = None, spoil: Callable[[int, bytes], bytes | None] = lambda _, datagram: datagram, **fields: float
) -> Iterator[Emulated]:
    board = Emulated(
        free_port(),
        Registers(array=ARRAY, **fields),
        np.full(ARRAY.shape, 20, np.int64) if ticks is None else ticks,
        spoil,
    )
    try:
        yield board
    finally:
        board.close()


def found(check: BoardCheck, name: str) -> Any:
    (finding,) = [finding for finding in check.findings if finding.name == name]
    return finding


@pytest.mark.parametrize("wire_version", [1, 2])
def test_a_sound_board_passes_and_holds_its_registers_afterwards(wire_version):
    with emulated(wire_version=wire_version, noise_floor=7) as board:
        before = board.board.registers
        check = check_board(board.place, port=board.port, host="127.0.0.1", seconds=SECONDS)
        assert check.good, check.findings
        assert board.board.registers == before
    assert check.pattern.version == wire_version
    assert check.pattern.events > 100
    assert check.pattern.speed < 0.5
    assert "as with a simulated board" in found(check, "frames").text
    assert np.nanmedian(check.rest.values) == pytest.approx(20, abs=0.3)
    # Of -1, 0 and 1, each a third.
    assert np.nanmedian(check.rest.noise) == pytest.approx((2 / 3) ** 0.5, abs=0.1)


def test_a_loose_and_a_stuck_sense_line_are_named():
    ticks = np.full(ARRAY.shape, 20, np.int64)
    ticks[5], ticks[7] = 60_000, NOT_RETURNED
    with emulated(ticks) as board:
        check = check_board(board.place, port=board.port, host="127.0.0.1", seconds=SECONDS)
    assert not check.good
    assert found(check, "values").good
    assert check.rest.faults > 0
    assert "sense line 7" in found(check, "comparators").text
    assert "sense line 5" in found(check, "ramp end").text
    assert check.rest.full.sum() == 16
    assert check.rest.silent.sum() == 16


def flipped(count: int, datagram: bytes) -> bytes:
    """Flip a bit of a value, of an event of version 1."""
    return datagram[:7] + bytes([datagram[7] ^ 32]) + datagram[8:] if count % 40 == 39 else datagram


def test_a_bit_that_differs_is_named_with_its_taxel():
    with emulated(spoil=flipped) as board:
        check = check_board(board.place, port=board.port, host="127.0.0.1", seconds=SECONDS)
    assert not found(check, "values").good
    assert check.pattern.wrong > 0
    first = check.pattern.first
    assert first.value ^ first.expected == 32
    assert "one bit differs" in first.meaning
    assert f"taxel ({first.x}, {first.y})" in found(check, "values").text


@pytest.mark.parametrize(("wire_version", "name"), [(1, "values"), (2, "losses")])
def test_datagrams_that_are_lost_are_seen_in_either_version(wire_version, name):
    with emulated(
        spoil=lambda count, datagram: None if count % 10 == 3 else datagram, wire_version=wire_version
    ) as board:
        check = check_board(board.place, port=board.port, host="127.0.0.1", seconds=SECONDS)
    assert not found(check, name).good
    assert not check.good
    # Most datagrams of version 2 are heartbeats, whose loss moves no value.
    assert check.pattern.behind > 0 if wire_version == 1 else check.pattern.counts.missing > 0


def test_without_a_serial_line_a_board_that_makes_the_pattern_is_recognised(capsys):
    with emulated(pattern=True) as board:
        check = check_board(port=board.port, host="127.0.0.1", array=ARRAY, seconds=SECONDS)
        assert check.good, check.findings
        assert check.rest is None
        with pytest.raises(SystemExit) as ended:
            main(["device", "check", "--port", str(board.port), "--array", "16x16", "--seconds", str(SECONDS)])
    assert ended.value.code == 0
    assert "ok    values: all" in capsys.readouterr().out


def test_a_board_without_the_pattern_fails(capsys):
    with emulated(noise_floor=0) as board, pytest.raises(SystemExit) as ended:
        main(["device", "check", "--port", str(board.port), "--array", "16x16", "--seconds", str(SECONDS), "--json"])
    assert ended.value.code == 3
    assert '"good": false' in capsys.readouterr().out


def test_where_nothing_arrives_the_address_that_is_missing_is_named(monkeypatch):
    monkeypatch.setattr("taxel.board_check.check._PATIENCE_S", 0.2)
    check = check_board(port=free_port(), host="127.0.0.1", seconds=0.1)
    (datagrams, _) = check.findings
    assert not datagrams.good
    assert "192.168.52.1" in datagrams.text
    assert "127.0.0.1" in datagrams.text


def test_nonsense_is_refused():
    with pytest.raises(ProblemError, match="seconds is 0"):
        check_board(seconds=0)
    with pytest.raises(ProblemError, match="preset is 'fast'"):
        check_board(preset="fast")
    with pytest.raises(ProblemError, match="must be left out with a serial line"):
        check_board("127.0.0.1:1", preset="5.2 kHz")
