"""Commands and status lines of the simulated logic, on the pins of its serial line, against the emulated board."""

import numpy as np
import pytest

from pair import Pair
from taxel.wire import Command


def answered(pair, data, lines=1):
    """Send bytes; return the status lines that come, those of faults left out."""
    pair.logic.send(data)
    received = ""
    for _ in range(200 * lines):
        pair.logic.run(200)
        received += pair.logic.serial()
        found = [line for line in received.splitlines(keepends=True) if not line.startswith("fault")]
        if len(found) >= lines and found[-1].endswith("\n"):
            return "".join(found)
    raise AssertionError(f"{lines} lines did not come: {received!r}")


@pytest.fixture(scope="module")
def pair():
    pair = Pair(8, 8)
    pair.logic.call("link", 256)
    assert answered(pair, b"") == pair.board.greeting
    return pair


def test_quick_every_write_is_answered_as_by_the_emulated_board(pair):
    rng = np.random.default_rng(11)
    refused = set()
    for _ in range(400):
        number = int(rng.integers(0, 8))
        words = pair.board.registers.words
        drawn = [
            words[number] ^ 1 << int(rng.integers(0, 32)),
            words[number] + int(rng.integers(-3, 4)),
            int(rng.integers(0, 1 << 32)),
            [0b1100, 301, 300, 55 << 16 | 75, 150, 7 << 16 | 3 << 8, 8, 1 << 16][number],
        ]
        value = int(drawn[rng.integers(0, 4)]) & 0xFFFF_FFFF
        # What this build lacks has a test of its own.
        value &= ~0x32 if number == 0 else 0xFFFF_FFFF
        # No frame of minutes.
        value &= 0x3FF if number == 1 else 0xFFFF_FFFF
        command = Command(number, value).to_bytes()
        expected = pair.board.command(command)
        assert answered(pair, command) == expected
        if expected.startswith("bad"):
            refused.add(expected.split()[-1])
    assert refused >= {"1", "2", "3", "4", "7"}


@pytest.mark.parametrize("value", [0b10 | 8, 1 << 4 | 8])
def test_quick_what_this_build_lacks_is_refused(pair, value):
    before = pair.board.command(Command(6, 0).to_bytes())
    assert answered(pair, Command(0, value).to_bytes()) == "bad REG0 rule 4\n"
    assert answered(pair, Command(6, 0).to_bytes()) == before


def test_quick_damage_is_counted_and_the_next_command_is_found(pair):
    good = Command(6, 5).to_bytes()
    data = b"\x01\x02" + good[:3] + good + good[:1]
    expected = pair.board.command(data + good)
    assert answered(pair, data + good) == expected
    faults = pair.board.faults()
    assert "fault command 6\n" in faults
    pair.logic.run(40_000)
    for _ in range(40):
        pair.logic.run(1000)
    assert pair.logic.serial().splitlines()[-1] == "fault command 6"


def test_quick_a_command_without_room_for_its_answer_is_refused_and_counted():
    pair = Pair(8, 8)
    sent = 40
    pair.logic.send(b"".join(Command(5, 7 << 16 | k << 8).to_bytes() for k in range(sent)))
    received = ""
    for _ in range(600):
        pair.logic.run(400)
        received += pair.logic.serial()
    answers = [line for line in received.splitlines() if line.startswith("ok")]
    counted = int(next(line for line in reversed(received.splitlines()) if "command" in line).split()[-1])
    assert len(answers) + counted == sent
    assert counted > 0
    # The first answers are to the first commands: what waits is not overwritten.
    assert answers[:8] == [f"ok REG5=0x0007{k:02X}00" for k in range(8)]
    assert answered(pair, Command(6, 5).to_bytes()).strip() == answers[-1]


def test_quick_markers_beyond_four_between_two_frames_are_counted():
    pair = Pair(8, 8)
    # A frame of 8 lines of 20 us: time for several writes of 4 us each.
    assert answered(pair, Command(1, 2000).to_bytes()).startswith("ok")
    pair.logic.edge()
    pair.logic.edge()
    pair.logic.datagrams()
    pair.logic.send(b"".join(Command(7, (k % 2 == 0) << 16).to_bytes() for k in range(7)))
    pair.logic.edge()
    pair.logic.edge()
    (markers,) = pair.logic.datagrams()
    assert [word[0] & 0x7C for word in (markers[k : k + 5] for k in range(0, len(markers), 5))] == [0x48, 8, 0x48, 8]
    pair.logic.run(100_000)
    for _ in range(20):
        pair.logic.run(4000)
    assert "fault queue 3\n" in pair.logic.serial()
    # The recording runs as was written last.
    assert pair.logic.call("recording") == 1
