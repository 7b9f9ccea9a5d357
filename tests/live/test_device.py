"""The board on its serial line: commands, read-back, units, faults, and a cable that is pulled."""

import json
import os
import pty
import socket
import threading
from pathlib import Path

import pytest
from loopback import free_port
from shell import run

import taxel
from taxel import DeviceError
from taxel.device import Cable, Device, ports
from taxel.simulate import Board
from taxel.wire import Command, Registers


def serve(board: Board, read: int, write: int, greets: bool = True) -> threading.Thread:
    def answer() -> None:
        if greets:
            os.write(write, board.greeting.encode())
        while True:
            try:
                said = os.read(read, 5)
                if not said:
                    return
                os.write(write, board.command(said).encode())
            except OSError:
                return

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    return thread


def test_the_floor_is_0_for_a_while_and_the_lines_stay() -> None:
    board, (ours, theirs) = Board(), pty.openpty()
    serve(board, ours, ours)
    with Cable(os.ttyname(theirs), timeout=30) as cable:
        with cable.floor(0):
            assert (board.registers.noise_floor, board.registers.lines) == (0, 64)
        assert (board.registers.noise_floor, board.registers.lines) == (3, 64)
    os.close(theirs)


class Unfaithful(Board):
    """A board whose ramp cannot be set, though it says that it was."""

    def command(self, data: bytes) -> str:  # type: ignore[override]
        if data[0] >> 4 & 7 == 4:
            return f"ok REG4=0x{Command.from_bytes(data).value:08X}\n"
        return super().command(data)


def test_what_is_set_is_read_back() -> None:
    ours, theirs = pty.openpty()
    serve(Unfaithful(), ours, ours)
    with (
        Device(os.ttyname(theirs), timeout=30) as device,
        pytest.raises(DeviceError, match="REG4 is 0x00000096, not 0x0000008C"),
    ):
        device.set(ramp=140)
    os.close(theirs)


def test_a_board_of_another_size_is_refused() -> None:
    ours, theirs = pty.openpty()
    serve(Board(Registers(array=taxel.Array(16, 8)), taxel.Array(16, 8)), ours, ours)
    with pytest.raises(DeviceError, match="16 x 8 taxels"):
        Device(os.ttyname(theirs), timeout=30, array=taxel.Array(8, 8))
    with Device(os.ttyname(theirs), timeout=30) as device:
        assert device.array.shape == (16, 8)
        assert device.apply("2 kHz").lines == 8
    os.close(theirs)


def test_a_pulled_cable_is_found_again_and_the_board_set_as_it_was(tmp_path: Path) -> None:
    link = tmp_path / "board"

    def plug() -> tuple[Board, int, int]:
        board = Board()
        ours, theirs = pty.openpty()
        serve(board, ours, ours, greets=False)
        os.symlink(os.ttyname(theirs), tmp_path / "new")
        os.rename(tmp_path / "new", link)
        return board, ours, theirs

    _, ours, theirs = plug()
    with Device(str(link), timeout=30, patience=30) as device:
        device.set(noise_floor=9)
        os.close(ours)
        os.close(theirs)
        link.unlink()
        plugged: list[tuple[Board, int, int]] = []
        back = threading.Timer(0.2, lambda: plugged.append(plug()))
        back.start()
        assert device.registers.noise_floor == 9
        back.join()
        board, ours, theirs = plugged[0]
        assert board.registers.noise_floor == 9, "another board, after its reset: set again"
        assert device.reconnects == 1
        os.close(ours)
        os.close(theirs)
        link.unlink()
        device.patience = 0.1
        with pytest.raises(DeviceError, match=r"no board answered within 0\.1 s"):
            _ = device.registers


def test_the_command_does_all_of_it_on_an_emulated_board() -> None:
    ours, theirs = pty.openpty()
    serve(Board(Registers(wire_version=2)), ours, ours)
    place = os.ttyname(theirs)
    shown = json.loads(run("device", "show", place, "--json").stdout)
    assert (shown["rows"], shown["columns"], shown["wire_version"]) == (64, 64, 2)
    assert shown["registers"]["line_period"] == 3.0
    assert "line_period" in run("device", "show", place).stdout
    said = json.loads(run("device", "set", place, "noise_floor=6", "ramp=140", "--json").stdout)
    assert (said["registers"]["noise_floor"], said["registers"]["ramp"]) == (6, 140)
    assert run("device", "set", place, "noise_floor=7").stdout == "noise_floor: 6 -> 7 ticks\n"
    assert "nothing changed" in run("device", "set", place, "noise_floor=7").stdout
    assert json.loads(run("device", "apply", place, "2 kHz", "--json").stdout)["registers"]["line_period"] == 7.81
    assert json.loads(run("device", "set", place, "record=false", "--json").stdout)["registers"]["record"] == 0
    refused = run("device", "set", place, "line_read=99999")
    assert refused.returncode == 3
    assert "rule 1" in refused.stderr
    assert refused.stderr.count("\n") == 1
    os.close(theirs)
    gone = run("device", "show", f"127.0.0.1:{free_port(socket.SOCK_STREAM)}")
    assert (gone.returncode, gone.stderr.count("\n")) == (3, 1)
    assert json.loads(run("device", "ports", "--json").stdout) == [
        {"place": p.place, "kind": p.kind, "product": p.product, "maker": p.maker, "serial": p.serial, "usb": p.usb}
        for p in ports()
    ]
