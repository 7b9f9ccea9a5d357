"""Places of lines: closed at once where their reading ends or is refused, and kept open where it goes on."""

from __future__ import annotations

import contextlib
import os
import pty
import socket
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from loopback import free_port, until
from panel.protocol import Client

import taxel
from taxel import _core
from taxel.detect import PlainRule
from taxel.live import Live
from taxel.live.lines import first_lines
from taxel.panel import Panel

from .boards import LOOPBACK

#: What a sensor of four taxels prints.
LINE = b"5,6,7,8\n"


@contextlib.contextmanager
def port() -> Iterator[tuple[str, int]]:
    """Yield a serial port, and the descriptor that a sensor prints to."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    try:
        yield os.ttyname(theirs), ours
    finally:
        os.close(ours)
        os.close(theirs)


@contextlib.contextmanager
def printing(*writes: object) -> Iterator[None]:
    """Call functions that print a line, each a hundred times a second."""
    over = threading.Event()

    def send() -> None:
        while not over.wait(0.01):
            for write in writes:
                with contextlib.suppress(BlockingIOError):
                    write(LINE)  # type: ignore[operator]

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(10)


@contextlib.contextmanager
def sensor() -> Iterator[str]:
    """Yield a serial port of a sensor that prints."""
    with port() as (place, ours), printing(lambda line: os.write(ours, line)):
        yield place


def is_free(place: str) -> bool:
    """Whether another program can open a port."""
    with contextlib.suppress(OSError):
        _core.SerialLine(place, 115_200, 1.0)
        return True
    return False


def has_values(panel: Panel) -> bool:
    """Whether the live source shows values."""
    return panel.live is not None and bool(np.isfinite(panel.live.frame).all())


def test_a_source_that_ended_is_closed_though_its_object_is_there() -> None:
    with sensor() as place:
        live = Live(sources=f"serial:{place},array=2x2")
        assert not is_free(place)
        summary = live.stop()
        assert is_free(place)
        assert (live.stop(), live.is_over) == (summary, True)
    where = f"lines+udp:{LOOPBACK}:{free_port()}"
    for _ in range(2):
        ended = Live(sources=f"{where},array=2x2,rate=100")
        ended.stop()


@pytest.mark.parametrize(
    ("keys", "argument"),
    [("array=5x5", "array=5x5: lines have 4 values"), ("array=2x2,rate=2e9", "rate is 2e+09 Hz")],
    ids=["a shape", "a rate"],
)
def test_a_refused_source_leaves_its_place_free(tmp_path: Path, keys: str, argument: str) -> None:
    with sensor() as place:
        with pytest.raises(taxel.ProblemError, match=argument.replace("+", r"\+")) as held:
            Live(sources=f"serial:{place},{keys}")
        assert is_free(place), held
        (tmp_path / "a.mcap").touch()
        with pytest.raises(FileExistsError) as held_too:
            Live(sources=f"serial:{place},array=2x2", record=tmp_path / "a.mcap")
        assert is_free(place), held_too
        lines = first_lines(f"serial:{place}", 5.0)
        assert all(line.count(",") == lines[0].count(",") for line in lines)
        assert is_free(place), lines


def test_the_page_changes_readouts_and_sensors_and_the_command_goes_on(tmp_path: Path) -> None:
    PlainRule("load", 1e6, noise_floor=3.0).save(tmp_path / "rule.json")
    with (
        sensor() as place,
        Live(sources=f"serial:{place},array=2x2") as live,
        Panel(live, folder=tmp_path) as panel,
        Client(panel) as page,
    ):
        for kind, asked in (
            ("read_out", {"readout": "rule.json"}),
            ("connect", {"source": f"serial:{place},array=1x4"}),
            ("read_out", {"readout": "rule.json"}),
        ):
            until(lambda: has_values(panel))
            before = panel.live
            assert (answer := page.ask(kind, **asked))["type"] == "done", answer
            assert before is not None
            assert before.is_over
            # The one before does not end what the next one reads.
            before.stop()
            frames = panel.live.counters["frames"]
            until(lambda: panel.live.counters["frames"] > frames)  # noqa: B023
            assert panel.live is not before
        until(lambda: has_values(panel))
        answer = page.ask("connect", source=f"serial:{place},array=5x5")
        assert answer["type"] == "refused"
        assert answer["field"] == "source"
        assert panel.live.array.shape == (1, 4), "the sensor stays in sight"
        until(lambda: panel.live.counters["frames"] > 0)
        assert page.ask("disconnect")["type"] == "done"
        assert is_free(place)
        assert not panel.live.is_over


def test_a_sensor_that_is_gone_leaves_the_page_where_another_is_refused(tmp_path: Path) -> None:
    link = tmp_path / "sensor"
    with sensor() as other, sensor() as first:
        link.symlink_to(first)
        with (
            Live(sources=f"serial:{link},array=2x2") as live,
            Panel(live, folder=tmp_path) as panel,
            Client(panel) as page,
        ):
            link.unlink()
            assert page.ask("connect", source=f"serial:{other},array=5x5")["type"] == "refused"
            assert not panel.live.is_over
            assert page.ask("connect", source=f"serial:{other},array=2x2")["type"] == "done"
            until(lambda: panel.live.counters["frames"] > 0)


def test_a_readout_is_changed_without_closing_the_port(tmp_path: Path) -> None:
    """A server sees one connection, and each line that it sent is read once, whole."""
    PlainRule("load", 1e6, noise_floor=3.0).save(tmp_path / "rule.json")
    with socket.create_server((LOOPBACK, 0)) as server:
        place = f"{LOOPBACK}:{server.getsockname()[1]}"
        connections: list[socket.socket] = []

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    connections.append(server.accept()[0])

        threading.Thread(target=serve, daemon=True).start()
        with (
            Live(sources=f"serial:{place},array=2x2,rate=100") as live,
            Panel(live, folder=tmp_path) as panel,
            Client(panel) as page,
        ):
            until(lambda: len(connections) == 1)
            read = 0
            for k in range(4):
                # The line that has begun when the readout is changed ends after it.
                connections[0].sendall(LINE * 20 + b"5,")
                before = panel.live
                until(lambda: before.counters["frames"] >= 20 and has_values(panel))  # noqa: B023
                assert (answer := page.ask("read_out", readout="rule.json"))["type"] == "done", answer
                connections[0].sendall(b"6,7,8\n")
                until(lambda: panel.live.counters["frames"] == 1)
                counts = before.counters["lines"]
                assert (counts["strange"], counts["bytes_of_unfinished_lines"], counts["unread"]) == (0, 0, {})
                read += before.counters["frames"]
                assert read == 21 * (k + 1) - 1
            assert len(connections) == 1
        for connection in connections:
            connection.close()
