"""A board's serial line, as a port (a pseudo-terminal) and over TCP: what it answers, and what can go wrong."""

from __future__ import annotations

import os
import pty
import signal
import socket
import threading
import time
import tty
from collections.abc import Callable, Iterator

import pytest

from taxel import DeviceError
from taxel.device import Cable, Greeting
from taxel.simulate import Board
from taxel.wire import Command


class End:
    """The end of a line at which the board is."""

    def __init__(self, kind: str) -> None:
        self._server = self._theirs = None
        if kind == "port":
            self._ours, self._theirs = pty.openpty()
            tty.setraw(self._theirs)
            self.place = os.ttyname(self._theirs)
        else:
            self._server = socket.create_server(("127.0.0.1", 0))
            self.place = f"127.0.0.1:{self._server.getsockname()[1]}"

    def accept(self) -> None:
        if self._server is not None:
            self._ours = self._server.accept()[0].detach()

    def receive(self) -> bytes:
        return os.read(self._ours, 4096)

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._ours, data) :]

    def hang_up(self) -> None:
        for file in (self._ours, self._theirs):
            if file is not None:
                os.close(file)
        if self._server is not None:
            self._server.close()
        self._theirs = self._server = None


@pytest.fixture(params=["port", "server"])
def end(request: pytest.FixtureRequest) -> Iterator[End]:
    end = End(request.param)
    yield end
    if end._theirs is not None or end._server is not None:
        end.hang_up()


def open_on(end: End, timeout: float = 30.0) -> Cable:
    cable = Cable(end.place, timeout=timeout)
    end.accept()
    return cable


def meanwhile(work: Callable[[], object]) -> threading.Thread:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def test_a_board_takes_commands_and_answers(end: End) -> None:
    board, cable = Board(), open_on(end)

    def serve() -> None:
        for _ in range(4):
            end.send(board.command(end.receive()).encode())

    served = meanwhile(serve)
    assert cable.command(Command(4, 140)) == cable.read(4) == 140
    with pytest.raises(DeviceError, match=r": the board refuses REG2 = 0x0000012D \(REG2 rule 1 of its registers\)$"):
        cable.command(Command(2, 301))
    assert (cable.greeting(), cable.resets) == (Greeting(1, 64, 64, 16), 0)
    served.join()
    answers = ["ok REG4=0x0000008C", "ok REG4=0x0000008C", "bad REG2 rule 1", "taxel-board v1 64x64 16ch"]
    assert cable.take_lines() == answers
    assert board.registers.ramp == 140
    cable.close()
    with pytest.raises(DeviceError, match="the line is closed"):
        cable.listen()


def test_lines_that_nobody_asked_for_count_faults_and_resets(end: End) -> None:
    cable = open_on(end)
    end.send(b"taxel-board v1 64x64 16ch\r\nfault queue 3\n\nok REG4=0x0000008C\nfault comp")
    end.send(b"arator 12\n\xc3\nfault queue 5\n")
    lines: list[str] = []
    begun = time.monotonic()
    while len(lines) < 6 and time.monotonic() < begun + 30:
        lines += cable.take_lines()
    assert lines[:4] == ["taxel-board v1 64x64 16ch", "fault queue 3", "ok REG4=0x0000008C", "fault comparator 12"]
    assert (cable.faults, cable.resets) == ({"queue": 5, "comparator": 12}, 1)


def test_an_answer_that_came_before_its_command_is_none(end: End) -> None:
    cable = open_on(end, 1.0)

    def answer() -> None:
        end.receive()
        end.send(b"ok REG5=0x00000000\nok REG4=0x00000001\n")

    answered = meanwhile(answer)
    assert cable.command(Command(5, 0)) == 0
    answered.join()
    with pytest.raises(DeviceError, match=r": no answer within 1 s: is this the board's serial line\?$"):
        cable.command(Command(4, 1))


def test_bytes_of_another_baud_rate_are_no_answer(end: End) -> None:
    cable = open_on(end, 1.0)
    meanwhile(lambda: [end.receive(), end.send(b"\xfe\x80\x00\x1c" * 500)])
    why = "bytes arrived that are not text: is the board's baud rate 115200" if "/" in end.place else "is this the"
    with pytest.raises(DeviceError, match=why):
        cable.greeting()


def test_a_line_that_never_pauses_ends_no_call(end: End) -> None:
    cable, over = open_on(end, 0.3), threading.Event()

    def flood() -> None:
        while not over.is_set():
            os.set_blocking(end._ours, False)
            try:
                os.write(end._ours, b"x" * 1000)
            except BlockingIOError:
                time.sleep(0.001)

    flooding = meanwhile(flood)
    cable.listen()
    with pytest.raises(DeviceError):
        cable.greeting()
    held = sum(map(len, cable.take_lines()))
    over.set()
    flooding.join()
    assert held <= 256 * 1024


def test_a_line_that_hangs_up_while_it_is_read_says_so(end: End) -> None:
    cable = open_on(end)
    meanwhile(lambda: [end.receive(), end.hang_up()])
    with pytest.raises(OSError, match=": the line was disconnected"):
        cable.greeting()
    with pytest.raises(DeviceError, match=r": no board answered within 0\.1 s \("):
        cable.reopen(0.1)


@pytest.mark.parametrize("call", [Cable.greeting, lambda cable: cable.reopen(30)])
def test_a_call_that_waits_is_interrupted(end: End, call: Callable[[Cable], object]) -> None:
    cable = open_on(end)
    threading.Timer(0.2, lambda: signal.raise_signal(signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        call(cable)
