"""The panel's board: its ports, registers, presets and resets."""

from __future__ import annotations

import contextlib
import time

import numpy as np
import pytest
from loopback import until
from panel.pages import live as by_tcp
from panel.protocol import (
    ADDRESS,
    Client,
    door,
    head,
    page_of_a_board,
    say,
    section,
)
from shell import run_beside

import taxel
import taxel.device
from taxel.detect.board import summary
from taxel.live import Live
from taxel.panel import Panel
from taxel.simulate import Board, Version2
from taxel.wire import Command, Registers

__all__ = ["by_tcp"]


def test_the_ports_of_the_machine_are_told(panel):
    with Client(panel) as page:
        assert page.ask("ports")["type"] == "done"
        told = page.since_asked("ports")
        assert [port["place"] for port in told["ports"]] == [port.place for port in taxel.device.ports()]


def test_the_command_stays_while_a_page_begins_its_board_anew(tmp_path):
    def look(said):
        with Client(door(said)) as page:
            for _ in range(4):
                # The command checks for changes every tenth of a second, so each request may coincide with a check.
                assert page.ask("disconnect")["type"] == "done"

    listens = ("--port", 0, "--host", "127.0.0.1", "--folder", tmp_path)
    # No datagram arrived; the exit code reports only that.
    assert run_beside(look, "live", "--panel", *listens, says=ADDRESS).returncode == 3


@pytest.mark.parametrize("version", [1, 2])
def test_registers_are_read_again_when_the_board_was_reset(tmp_path, version):
    # Version 2 shows a reset by a new session, version 1 only by the greeting on the board's serial line.
    with page_of_a_board(tmp_path, wire_version=version) as (board, _, page):
        page.send(type="credit", n=1)
        page.until("registers", known=True)
        assert page.ask("set", values={"noise_floor": 9})["type"] == "done"
        told = [said for said in page.said if said["type"] == "registers" and said["known"]]
        assert 9 in [said["values"]["noise_floor"] for said in told]
        board.reset()
        while page.until("registers", known=True)["values"]["noise_floor"] != 3:
            pass


@pytest.mark.parametrize("version", [1, 2])
def test_a_preset_by_name_leaves_the_version_of_the_wire(tmp_path, version):
    with page_of_a_board(tmp_path, wire_version=version) as (_, _, page):
        page.send(type="credit", n=1)
        page.until("registers", known=True)
        for name, floor in (("2 kHz", 10), ("5.2 kHz", 3)):
            assert page.ask("preset_apply", name=name)["type"] == "done"
            said = page.since_asked("registers", known=True, preset=name)
            assert (said["values"]["noise_floor"], said["values"]["wire_version"]) == (floor, version)


def test_a_board_that_was_reset_is_shown_anew(live, panel):
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=0))

    def said(columns, ticks):
        frames = np.zeros((8, 64, 64), np.uint16)
        frames[1:, 5, :columns] = ticks + 4 * np.arange(7)[:, None]
        return [datagram for frame in frames for datagram in board.frame(frame.ravel())]

    with Client(panel) as page:
        page.send(type="credit", n=1)
        say(live, *said(40, 60))
        while np.sum(section(page.until("frame"), 0, "<u2") != 65_535) != 40:
            pass
        while head(page.until("frame"))[0]["flags"] & 4:
            pass
        here = len(page.frames)
        board.reset()
        say(live, *said(5, 80))
        while np.sum(section(page.until("frame"), 0, "<u2") != 65_535) != 5:
            pass
        assert any(head(frame)[0]["flags"] & 4 for frame in page.frames[here:])


def test_a_raised_noise_floor_reaches_the_readout_and_is_told_once(tmp_path):
    rule = taxel.detect.PlainRule("area", 2, noise_floor=3.0)
    training = {"noise_floor": 3.0, "error_ms": {}, "board": summary(Registers())}
    rule._with(training=training).save(tmp_path / "rule.json")
    with page_of_a_board(tmp_path, wire_version=2) as (_, panel, page):
        page.until("registers", known=True)
        while page.ask("read_out", readout="rule.json")["type"] != "done":
            time.sleep(0.1)  # no value of a taxel has arrived yet; a client that is refused too often is cut off
        for noise_floor in (7, 7, 2):
            assert page.ask("set", values={"noise_floor": noise_floor})["type"] == "done"
            assert panel.live._options.readout.noise_floor == 7
        told = [message["text"] for message in page.said if message["type"] == "warning"]
        # Where its registers were read while it measured its own rest, they had a floor of 0.
        assert [("7 ticks" in text, "2 ticks" in text) for text in told[-2:]] == [(True, False), (False, True)]
        assert len(told) <= 3


def noticed(page, register, value):
    """Wait until the page is told of a register's value, and that frames are counted on."""
    while page.until("registers", known=True)["values"][register] != value:
        pass
    page.until("counters")


def test_registers_that_another_program_writes_are_noticed(tmp_path):
    with page_of_a_board(tmp_path, wire_version=2) as (board, _, page):
        page.until("registers", known=True)
        with board.one_at_a_time:
            board.board.command(Command(5, 9 << 8).to_bytes())
        noticed(page, "noise_floor", 9)


def test_a_line_that_another_program_takes_is_opened_again(by_tcp):
    with Client(door(by_tcp.url)) as page:
        page.until("registers", known=True)

        def is_set():
            # While a busy machine takes seconds for this, the page takes the line back, and so on.
            place = by_tcp.control
            with contextlib.suppress(OSError, taxel.DeviceError), taxel.device.Device(place, patience=30) as device:
                return device.set(threshold_rest=17).threshold_rest == 17

        until(is_set)
        noticed(page, "threshold_rest", 17)


def test_a_tare_of_one_board_is_not_kept_for_another():
    """A readout ends with its tare when another source is received; one that tares afresh goes on."""
    array = taxel.Array(2, 2)
    tare = taxel.Tare.take(taxel.Frames(np.full((2, 2, 2), 50.0), [0, 1000], unit="ticks", array=array))
    rule = taxel.detect.PlainRule("area", 2)
    for given, goes_on in ((tare, False), (0.5, True)):
        with (
            Live(sources="given,array=2x2,rate=1,unit=ticks", readout=rule, tare=given) as live,
            Panel(live) as panel,
            Client(panel) as page,
        ):
            assert page.until("hello")["readout"]
            assert page.ask("disconnect")["type"] == "done"
            hello = [message for message in page.said if message["type"] == "hello"][-1]
            assert bool(hello["readout"]) == goes_on


@pytest.mark.parametrize("noise", [0.6, 4.9])
def test_a_sensor_with_noise_has_no_area_at_rest(noise):
    random = np.random.default_rng(1)
    rule = taxel.detect.PlainRule("area", 2, noise_floor=6 * noise, unit="counts")
    source = "given,array=12x10,rate=200,unit=counts,time=1:ms"
    with Live(sources=source, readout=rule, tare=0.5) as live, Panel(live) as panel, Client(panel) as page:
        for k in range(300):
            live.sample(live.name, [5.0 * k, *np.rint(500 + random.normal(0, noise, 120))])
        page.until("counters", taring=False)
        for k in range(300, 310):
            live.sample(live.name, [5.0 * k, *np.rint(500 + random.normal(0, noise, 120))])
            page.send(type="credit", n=1)
            page.ask("ports")
        areas = [int(values[1]) for frame in page.frames if len(values := section(frame, 6, "<u4"))]
        assert set(areas[-5:]) == {0}
