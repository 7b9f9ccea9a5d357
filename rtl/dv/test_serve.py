"""The simulated logic as a board, from the first command to the ball: `taxel device check` on it."""

import socket
import threading

import pytest

import serve
from taxel.board_check import check_board

COLUMNS, ROWS = 4, 16


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        return int(link.getsockname()[1])


@pytest.mark.parametrize("loose", [[], [3]])
def test_a_check_of_the_simulated_board_finds_what_is_wrong_and_nothing_else(tmp_path, loose):
    port, over = free_port(), threading.Event()
    board = serve.Board(COLUMNS, ROWS, 16, loose=loose)
    with serve.terminal(tmp_path / "board") as (line, name):
        thread = threading.Thread(target=serve.serve, args=(board, line, ("127.0.0.1", port), over.is_set))
        thread.start()
        try:
            check = check_board(name, port=port, host="127.0.0.1", seconds=2.0)
        finally:
            over.set()
            thread.join()
    faults = [finding.name for finding in check.findings if finding.good is False]
    assert faults == (["rest"] if loose else []), check.findings
    rest = check.findings[-1].text
    assert (f"{COLUMNS} taxels stay at the ramp's end" in rest) == bool(loose)
