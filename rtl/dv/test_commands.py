"""Commands and status lines of the simulated logic, on the pins of its serial line, against the emulated board."""

import numpy as np
import pytest

from pair import Pair
from taxel.wire import Command


class Host:
    """The other end of the serial line: sends bytes, and sorts whole lines into answers and faults."""

    def __init__(self):
        self.pair = Pair(8, 8)
        self.part, self.faults = "", []
        assert self.answers(1) == self.pair.board.greeting

    def receive(self, clocks):
        """Return the answers that come within so many clocks."""
        logic = self.pair.logic
        until = logic.call("clock") + clocks
        while logic.call("clock") < until:
            logic.run(until - logic.call("clock"))
        *whole, self.part = (self.part + logic.serial()).split("\n")
        self.faults += [line for line in whole if line.startswith("fault")]
        return [line + "\n" for line in whole if not line.startswith("fault")]

    def answers(self, count):
        """Return the next answers."""
        found = []
        for _ in range(200 * count):
            found += self.receive(400)
            if len(found) >= count:
                return "".join(found)
        raise AssertionError(f"{count} answers did not come: {found}")

    def answered(self, data):
        """Send one command; return its answer."""
        self.pair.logic.send(data)
        return self.answers(1)


@pytest.fixture(scope="module")
def host():
    return Host()


def test_quick_every_write_is_answered_as_by_the_emulated_board(host):
    board = host.pair.board
    rng = np.random.default_rng(11)
    refused = set()
    for _ in range(400):
        number = int(rng.integers(0, 8))
        words = board.registers.words
        drawn = [
            words[number] ^ 1 << int(rng.integers(0, 32)),
            words[number] + int(rng.integers(-3, 4)),
            int(rng.integers(0, 1 << 32)),
            [0b1100, 301, 300, 55 << 16 | 75, 150, 7 << 16 | 3 << 8, 8, 1 << 16][number],
        ]
        value = int(drawn[rng.integers(0, 4)]) & 0xFFFF_FFFF
        # No frame of minutes.
        value &= 0x3FF if number == 1 else 0xFFFF_FFFF
        command = Command(number, value).to_bytes()
        expected = board.command(command)
        assert host.answered(command) == expected
        if expected.startswith("bad"):
            refused.add(expected.split()[-1])
    for number, value in [(0, 8), (5, 7 << 16), (1, 300), (2, 300), (4, 2), (3, 4 << 16 | 26), (3, 4 << 16 | 25)]:
        command = Command(number, value).to_bytes()
        expected = board.command(command)
        assert host.answered(command) == expected
    assert expected == "bad REG3 rule 7\n"
    assert refused >= {"1", "2", "3", "4"}


def test_quick_damage_is_counted_and_the_next_command_is_found(host):
    good = Command(6, 5).to_bytes()
    data = b"\x01\x02" + good[:3] + good + good[:1] + good
    host.pair.logic.send(data)
    assert host.answers(2) == host.pair.board.command(data)
    assert "fault command 6\n" in host.pair.board.faults()
    host.receive(60_000)
    assert [line for line in host.faults if "command" in line][-1] == "fault command 6"


def test_quick_a_byte_without_a_stop_bit_counts_with_what_came_of_its_command():
    host = Host()
    logic, good = host.pair.logic, Command(6, 5).to_bytes()
    logic.send(good[:2])
    logic.send_broken(good[2])
    logic.send(good[3:])
    # Three at once, and each of the two that follow.
    host.receive(60_000)
    assert [line for line in host.faults if "command" in line][-1] == "fault command 5"
    assert host.answered(good).startswith("ok")


def test_quick_a_command_without_room_for_its_answer_is_refused_and_counted():
    host, sent = Host(), 40
    host.pair.logic.send(b"".join(Command(5, 7 << 16 | k << 8).to_bytes() for k in range(sent)))
    answers = host.receive(200_000)
    counted = int(next(line for line in reversed(host.faults) if "command" in line).split()[-1])
    assert len(answers) + counted == sent
    assert counted > 0
    # The first answers are to the first commands: what waits is not overwritten.
    assert answers[:8] == [f"ok REG5=0x0007{k:02X}00\n" for k in range(8)]
    assert host.answered(Command(6, 5).to_bytes()) == answers[-1]


def test_quick_markers_beyond_four_between_two_frames_are_counted():
    host = Host()
    logic = host.pair.logic
    # A frame of 8 lines of 20 us: time for several writes of 4 us each.
    assert host.answered(Command(1, 2000).to_bytes()).startswith("ok")
    logic.edge()
    logic.edge()
    logic.datagrams()
    logic.send(b"".join(Command(7, (k % 2 == 0) << 16).to_bytes() for k in range(7)))
    logic.edge()
    logic.edge()
    (markers,) = logic.datagrams()
    assert [markers[k] & 0x7C for k in range(0, len(markers), 5)] == [0x48, 8, 0x48, 8]
    host.receive(60_000)
    assert [line for line in host.faults if "queue" in line][-1] == "fault queue 3"
    # The recording runs as was written last.
    assert logic.call("recording") == 1
