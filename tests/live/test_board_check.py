"""The check of a board, on an emulated board that counts frames instead of a clock, and on faulty ones."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from taxel import Events
from taxel.board_check import BoardCheck, _pattern, check_board
from taxel.cli import main
from taxel.simulate import NOT_RETURNED, pattern
from taxel.wire import Registers

from .emulated import ARRAY, Emulated, emulated

#: For how long a check receives: on a busy machine, too, hundreds of frames come meanwhile.
SECONDS = 1.5


def found(check: BoardCheck, name: str) -> Any:
    (finding,) = [finding for finding in check.findings if finding.name == name]
    return finding


def checked(board: Emulated) -> BoardCheck:
    return check_board(board.place, port=board.port, host="127.0.0.1", seconds=SECONDS)


@pytest.mark.parametrize("wire_version", [1, 2])
def test_a_sound_board_passes_and_holds_its_registers_afterwards(wire_version):
    with emulated(wire_version=wire_version, noise_floor=7) as board:
        before = board.board.registers
        check = checked(board)
        assert check.good, check.findings
        assert board.board.registers == before
    assert [finding.name for finding in check.findings] == ["losses", "taxels", "pattern", "rest"]
    # Of -1, 0 and 1, each a third.
    assert np.median(check.noise) == pytest.approx((2 / 3) ** 0.5, abs=0.1)


def test_a_loose_and_a_stuck_sense_line_are_named():
    ticks = np.full(ARRAY.shape, 20, np.int64)
    ticks[5], ticks[7] = 60_000, NOT_RETURNED
    with emulated(ticks) as board:
        check = checked(board)
    assert found(check, "pattern").good
    rest = found(check, "rest")
    assert not rest.good
    for words in ("not returned", "16 taxels stay at the ramp's end", "sense line 5", "at 0 or 1 (sense line 7)"):
        assert words in rest.text


def test_lost_datagrams_are_seen():
    with emulated(spoil=lambda count, datagram: None if count % 10 == 3 else datagram) as board:
        check = checked(board)
    assert not found(check, "losses").good
    assert found(check, "pattern").good


@pytest.mark.parametrize("begin", [0, 4097, 65_500])
def test_a_bit_that_differs_is_named_with_its_taxel(begin):
    registers = Registers(array=ARRAY, wire_version=2)
    frames = np.array([pattern(begin + n, array=ARRAY, ramp=registers.ramp) for n in range(200)])
    n, y, x = (column.ravel() for column in np.indices(frames.shape))
    times = np.floor(n * registers.frame_us).astype(np.int64)

    def finding(values: Any) -> Any:
        events = Events(times, x, y, np.ones(len(x), bool), intensity=values.ravel(), array=ARRAY)
        return _pattern(events, ARRAY, registers)

    assert finding(frames).good
    frames[150, 3, 9] ^= 32
    wrong = finding(frames)
    assert not wrong.good
    for words in ("1 of", "taxel (9, 3)", f"must be {frames[150, 3, 9] ^ 32}", "one bit differs"):
        assert words in wrong.text


def test_a_board_that_sends_nothing_fails_and_the_command_says_so(monkeypatch, capsys):
    monkeypatch.setattr("taxel.board_check._PATIENCE_S", 0.2)
    with emulated(spoil=lambda *_: None) as board, pytest.raises(SystemExit) as ended:
        main(["device", "check", board.place, "--port", str(board.port), "--host", "127.0.0.1", "--json"])
    assert ended.value.code == 3
    assert json.loads(capsys.readouterr().out)["good"] is False
