"""Commands reach the board over its serial line, and what it answers is heard."""

import os
import pty
import socket
import threading
from collections.abc import Iterator

import pytest

from taxel import DeviceError, ProblemError
from taxel.cable import Cable
from taxel.device import Board
from taxel.wire import Command


def serve(board: Board, read: int, write: int) -> threading.Thread:
    def answer() -> None:
        os.write(write, board.greeting.encode())
        while True:
            try:
                said = os.read(read, 5)
            except OSError:
                return
            if not said:
                return
            os.write(write, board.command(said).encode())

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    return thread


@pytest.fixture(params=["serial", "server"])
def line(request: pytest.FixtureRequest) -> Iterator[tuple[str, Board]]:
    board = Board()
    if request.param == "serial":
        ours, theirs = pty.openpty()
        serve(board, ours, ours)
        yield os.ttyname(theirs), board
        os.close(theirs)
    else:
        with socket.create_server(("127.0.0.1", 0)) as server:
            threading.Thread(target=lambda: serve(board, *(server.accept()[0].detach(),) * 2), daemon=True).start()
            yield f"127.0.0.1:{server.getsockname()[1]}", board


def test_a_register_is_written_and_read_back(line: tuple[str, Board]) -> None:
    place, board = line
    with Cable(place, timeout=30) as cable:
        assert cable.command(Command(4, 140)) == 140
        assert cable.read(4) == 140
    assert board.registers.ramp == 140


def test_the_floor_is_0_for_a_while_and_the_lines_stay(line: tuple[str, Board]) -> None:
    place, board = line
    with Cable(place, timeout=30) as cable:
        with cable.floor(0):
            assert (board.registers.noise_floor, board.registers.lines) == (0, 64)
        assert (board.registers.noise_floor, board.registers.lines) == (3, 64)


def test_a_refusal_names_the_rule(line: tuple[str, Board]) -> None:
    place, _ = line
    with (
        Cable(place, timeout=30) as cable,
        pytest.raises(DeviceError, match=r"refuses REG2 = 0x0000012D \(REG2 rule 1"),
    ):
        cable.command(Command(2, 301))


def test_a_line_without_a_board_is_said() -> None:
    ours, theirs = pty.openpty()
    with Cable(os.ttyname(theirs), timeout=0.05) as cable, pytest.raises(DeviceError, match="no answer within"):
        cable.read(5)
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"place": "ttyUSB0"}, "place is 'ttyUSB0'"),
        ({"place": 3}, "place is 3"),
        ({"place": "host:99999"}, "place is 'host:99999'"),
        ({"place": "/dev/null", "baud": 5}, "baud is 5: must be one of 9600"),
        ({"place": "/dev/null", "timeout": 0}, "timeout is 0"),
    ],
)
def test_nonsense_is_refused_by_name(arguments: dict[str, object], said: str) -> None:
    with pytest.raises(ProblemError) as refused:
        Cable(**arguments)  # type: ignore[arg-type]
    assert said in str(refused.value)


def test_a_file_that_is_no_serial_device_is_refused() -> None:
    with pytest.raises(DeviceError, match="/dev/null: no serial device"):
        Cable("/dev/null")
    with pytest.raises(FileNotFoundError):
        Cable("/dev/no-such-device")
