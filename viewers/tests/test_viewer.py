"""What a Rerun hears is what a recording holds, and what a board sends."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loopback import free_port, until
from tests.live.boards import LOOPBACK, SMALL, play, presses, touch, wait_for

import taxel
from taxel import DeviceError, ProblemError
from taxel.cli import main
from taxel.live import Live
from taxel_viewers import Viewer

#: Timeout for an event on a busy machine, s.
SOON = 60.0

#: What a recording is sent as; one that lacks is still on its way.
ENTITIES = ("/events/more", "/events/less", "/pressure", "/force", "/detections", "/notes")

rerun = pytest.mark.skipif(not importlib.util.find_spec("rerun"), reason="pip install taxel[rerun]: 500 MB")


@pytest.fixture
def port() -> int:
    return free_port(socket.SOCK_STREAM)


def answers(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection((LOOPBACK, port), 1.0):
        return True
    return False


@contextlib.contextmanager
def receiver(folder: Path, port: int) -> Iterator[None]:
    """A Rerun that keeps what it hears in a file: without a window, and on loopback."""
    import rerun_cli

    program = Path(rerun_cli.__file__).with_name("rerun")
    # A fresh home folder, so that the viewer finds no user settings.
    environment = {**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "RUST_LOG": "off"}
    words = [str(program), "--bind", LOOPBACK, "--port", str(port), "--save", str(folder / "heard.rrd")]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
    try:
        until(lambda: answers(port))
        yield
    finally:
        process.kill()
        process.wait()


def rows(folder: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Read what a Rerun kept, by its own reader: by entity the times (us) and values."""
    import warnings

    from rerun.chunk import RrdReader

    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = RrdReader(str(folder / "heard.rrd"))
        for store in reader.recordings():
            for chunk in reader.stream(store=store):
                batch = chunk.to_record_batch()
                named = batch.to_pydict()
                if "board" not in named:
                    continue
                times = np.array(batch["board"].cast("int64")) // 1000
                for n, t in enumerate(times.tolist()):
                    row = {name: column[n] for name, column in named.items() if column[n] is not None}
                    found.setdefault(chunk.entity_path, []).append((t, row))
    for entity in found.values():
        entity.sort(key=lambda row: row[0])
    return found


def image(row: dict[str, Any]) -> np.ndarray:
    (shape,) = row["DepthImage:format"]
    values = np.array(row["DepthImage:buffer"][0], np.uint8).view("<f4")
    return values.reshape(shape["height"], shape["width"])


@rerun
def test_rerun_hears_a_recording_as_it_is(tmp_path: Path, port: int) -> None:
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), record=tmp_path / "one.mcap") as live:
        wait_for(live, play(presses(8), live.address[1], pace=0.002))
        live.note("here")
    recording = taxel.open(tmp_path / "one.mcap")
    frames, events = recording.frames(), recording.events
    with receiver(tmp_path, port):
        with pytest.raises(SystemExit) as ended:
            main(["show", str(tmp_path / "one.mcap"), f"rerun:{LOOPBACK}:{port}"])
        assert ended.value.code == 0
        kept = until(lambda: found if len(found := rows(tmp_path)) == len(ENTITIES) else None)
    assert [t for t, _ in kept["/pressure"]] == frames.t.tolist()
    np.testing.assert_array_equal([image(row) for _, row in kept["/pressure"]], frames.values)
    assert [row["Scalars:scalars"][0] for _, row in kept["/force"]] == frames.total().tolist()
    heard = [
        (t, int(row["Scalars:scalars"][0]), sign) for sign in ("more", "less") for t, row in kept[f"/events/{sign}"]
    ]
    taxels = events.array.index(events.x, events.y)
    assert sorted(heard) == sorted(
        zip(events.t.tolist(), taxels.tolist(), np.where(events.p, "more", "less").tolist(), strict=True)
    )
    assert [(t, row["TextLog:text"]) for t, row in kept["/detections"]] == sorted(
        (found.t, [found.label]) for found in recording.detections
    )
    assert [row["TextLog:text"] for _, row in kept["/notes"]] == [["here"]]


@rerun
def test_rerun_hears_what_a_board_holds(tmp_path: Path, port: int) -> None:
    udp, events = free_port(), presses(3)
    words = (sys.executable, "-m", "taxel", "show", f"board:{LOOPBACK}:{udp},array=4x4", f"rerun:{LOOPBACK}:{port}")

    def shown() -> list[int]:
        """What the taxel that is pressed held last."""
        return [int(image(row)[2, 1]) for _, row in rows(tmp_path).get("/pressure", [])[-1:]]

    with receiver(tmp_path, port), subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as show:
        assert show.stderr is not None
        assert any("listening" in line for line in show.stderr)
        play(events, udp)
        until(lambda: shown() == [int(events.intensity[-1])])
        show.send_signal(signal.SIGINT)
        assert show.wait(SOON) == 0


@pytest.mark.parametrize("to", ["", "rerun:65536", "rerun:here", "rerun::1", "ros"])
def test_what_no_viewer_is_is_refused(to: str) -> None:
    with pytest.raises(ProblemError):
        Viewer(to, "one")


@rerun
def test_a_viewer_that_does_not_run_is_an_error_of_the_device(port: int) -> None:
    with pytest.raises(DeviceError):
        Viewer(f"rerun:{LOOPBACK}:{port}", "one")
