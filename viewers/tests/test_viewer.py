"""What goes to Foxglove and to Rerun is what came; and whatever they do, capture goes on."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import signal
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.live.boards import (
    LOOPBACK,
    SMALL,
    above_rest,
    command,
    force,
    play,
    presses,
    spikes_of,
    touch,
    wait_for,
)

import taxel
from taxel import Detection, Note, ProblemError
from taxel.cli import main
from taxel.encode import ChangeEvents
from taxel.live import Live, Panel
from taxel.live.client import Frame, Subject
from taxel_viewers import Viewer
from taxel_viewers.viewer import MOST_FRAMES, MOST_OTHERS, BoundedQueue

client = pytest.importorskip("websockets.sync.client", reason="the test extra brings websockets")

#: Timeout for an event on a busy machine, s.
SOON = 60.0

#: Fraction of changes that must be shown: the datagrams are sent five times slower than their stamps, as by a board
#: that stalls, and some changes coincide.
SEEN = 0.98

foxglove = pytest.mark.skipif(not importlib.util.find_spec("foxglove"), reason="pip install taxel[foxglove]")
rerun = pytest.mark.skipif(not importlib.util.find_spec("rerun"), reason="pip install taxel[rerun]: 500 MB")


def eventually(what: Any) -> Any:
    until = time.monotonic() + SOON
    while not (found := what()):
        assert time.monotonic() < until
        time.sleep(0.01)
    return found


class Foxglove:
    """Somebody else's client: Foxglove's public protocol, and protobuf by the schema that the server tells."""

    def __init__(self, place: str) -> None:
        self.door = client.connect(
            place.rsplit(maxsplit=1)[-1], subprotocols=["foxglove.sdk.v1"], max_size=None, close_timeout=1
        )
        self.socket = self.door.__enter__()
        self.channels: dict[int, dict[str, Any]] = {}
        self.heard: dict[str, list[tuple[int, Any]]] = {}

    def __enter__(self) -> Foxglove:
        return self

    def __exit__(self, *raised: Any) -> None:
        self.door.__exit__(*raised)

    def meet(self) -> None:
        """Ask for everything."""
        while len(self.channels) < 7:
            said = json.loads(self.socket.recv(SOON))
            if said["op"] == "advertise":
                self.channels |= {channel["id"]: channel for channel in said["channels"]}
        wanted = [{"id": number, "channelId": number} for number in self.channels]
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def listen(self, until: Any, *, quiet: bool) -> None:
        """Hear until a condition holds and, if `quiet`, nothing comes any more."""
        end = time.monotonic() + SOON
        while time.monotonic() < end:
            if not quiet and until():
                return
            try:
                message = self.socket.recv(0.3)
            except TimeoutError:
                if until():
                    return
                continue
            if isinstance(message, bytes) and message[0] == 1:
                number, t_ns = struct.unpack_from("<IQ", message, 1)
                channel = self.channels[number]
                said = message[13:]
                value = json.loads(said) if channel["encoding"] == "json" else unpacked(channel, said)
                self.heard.setdefault(channel["topic"], []).append((t_ns, value))
        raise AssertionError({topic: len(heard) for topic, heard in self.heard.items()})


def unpacked(channel: dict[str, Any], said: bytes) -> Any:
    """Read protobuf by the channel's own description."""
    import base64

    protobuf = pytest.importorskip("google.protobuf.descriptor_pb2", reason="pip install protobuf")
    from google.protobuf import descriptor_pool, message_factory

    pool = descriptor_pool.DescriptorPool()
    for file in protobuf.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
    return kind.FromString(said)


@contextlib.contextmanager
def receiver(folder: Path, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A Rerun that keeps what it hears in a file: without a window, and on loopback."""
    import rerun_cli

    program = Path(rerun_cli.__file__).with_name("rerun")
    kept = folder / f"heard{len(list(folder.iterdir()))}.rrd"
    # A fresh home folder, so that the viewer finds no user settings.
    environment = {**os.environ, "HOME": str(folder), "XDG_CONFIG_HOME": str(folder), "RUST_LOG": "off"}
    words = [str(program), "--bind", LOOPBACK, "--port", str(port), "--save", str(kept)]
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def port() -> int:
    import socket

    with socket.socket() as door:
        door.bind((LOOPBACK, 0))
        return int(door.getsockname()[1])


def rows(folder: Path) -> dict[str, list[tuple[int, dict[str, Any]]]]:
    """Read what a Rerun kept, by its own reader: by entity the times (us, None where it holds always) and values."""
    import warnings

    from rerun.chunk import RrdReader

    found: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in sorted(folder.glob("*.rrd")):
            reader = RrdReader(str(path))
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


def recorded(path: Path, touches: int = 20) -> tuple[taxel.Recording, list[Detection]]:
    """Record what a board says, with what a readout says."""
    events, said = presses(touches), []
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), record=path, say=said.append) as live:
        wait_for(live, play(events, live.address[1], pace=0.002))
        live.note("here")
    return taxel.open(path), said


@foxglove
def test_foxglove_hears_a_recording_as_it_is(tmp_path: Path) -> None:
    # All messages fit into the 512 that Foxglove's server keeps for a client, which on a busy machine reads late.
    recording, said = recorded(tmp_path / "one.mcap", touches=8)
    viewer = Viewer(tmp_path / "one.mcap", "foxglove:0", encoder=ChangeEvents(), speed=5.0)
    with viewer, Foxglove(viewer.place) as page:
        page.meet()
        page.listen(lambda: viewer.state.over, quiet=True)
        state = viewer.stop()
    heard = page.heard
    assert state.lost == {}
    assert state.sent == {
        "frames": len(heard["/pressure"]),
        "curves": len(heard["/contact"]),
        "spikes": len(spikes_of(recording.events)),
        "detections": len(said),
        "notes": 1,
    }
    # The last frame is that of the file's end, in colours and in ticks, whose brightest is pressed most.
    t_ns, last = heard["/pressure/ticks"][-1]
    assert (t_ns, last.width, last.height, last.encoding) == (1000 * recording.events.t[-1], 4, 4, "16UC1")
    ticks = np.frombuffer(last.data, "<u2").reshape(4, 4)
    np.testing.assert_array_equal(ticks, above_rest(recording.events))
    colours = np.frombuffer(heard["/pressure"][-1][1].data, np.uint8).reshape(4, 4, 3)
    assert len({tuple(colours[y, x]) for y in range(4) for x in range(4) if (x, y) != (1, 2)}) == 1
    # Spikes, detections, notes: all, at their times.
    heard_spikes = [
        (row["t_us"], n, v) for _, row in heard["/spikes"] for n, v in zip(row["train"], row["value"], strict=True)
    ]
    assert sorted(heard_spikes) == spikes_of(recording.events)
    assert all(t_ns == 1000 * row["t_us"] for rows in (heard["/spikes"], heard["/contact"]) for t_ns, row in rows)
    assert sorted((t_ns, row["label"], row["known_us"]) for t_ns, row in heard["/detections"]) == sorted(
        (1000 * s.t, s.label, s.known) for s in said
    )
    assert [note.message for _, note in heard["/notes"]] == ["here"]
    times = np.array([row["t_us"] for _, row in heard["/contact"]])
    assert np.all(np.diff(times) == 4000)
    assert [row["force_ticks"] for _, row in heard["/contact"]] == force(recording.events, times)


@foxglove
def test_foxglove_hears_a_board_with_what_is_detected() -> None:
    said: list[Detection] = []
    with (
        Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=said.append) as live,
        Panel(live) as panel,
        Viewer(panel.url, "foxglove:0") as viewer,
        Foxglove(viewer.place) as page,
    ):
        page.meet()
        eventually(lambda: viewer.state.there)
        wait_for(live, play(presses(8), live.address[1], pace=0.002))
        page.listen(lambda: len(page.heard.get("/detections", [])) == live.counters["detections"] > 0, quiet=False)
    rows = [row for _, row in page.heard["/detections"]]
    assert [(row["label"], row["t_us"], row["known_us"], row["reported_us"]) for row in rows] == [
        (s.label, s.t, s.known, s.reported) for s in said
    ]
    assert [row["latency_us"] for row in rows] == [s.reported - s.known for s in said]
    assert [row["slope"] for row in rows] == pytest.approx([s.slope for s in said], rel=1e-6)


@rerun
def test_rerun_hears_a_recording_as_it_is(tmp_path: Path, port: int) -> None:
    recording, said = recorded(tmp_path / "one.mcap")
    with receiver(tmp_path, port):
        viewer = Viewer(tmp_path / "one.mcap", f"rerun:{LOOPBACK}:{port}", encoder=ChangeEvents(), speed=5.0)
        with viewer:
            assert viewer.wait(SOON)
            state = viewer.stop()
        kept = eventually(lambda: found if len((found := rows(tmp_path)).get("/detections", [])) == len(said) else None)
    assert state.lost == {}
    assert state.sent["frames"] == len(kept["/pressure"]) == len(kept["/change"])
    t, last = kept["/pressure"][-1]
    assert t == recording.events.t[-1]
    (shape,) = last["DepthImage:format"]
    ticks = np.array(last["DepthImage:buffer"][0], np.uint8).view("<u2").reshape(shape["height"], shape["width"])
    np.testing.assert_array_equal(ticks, above_rest(recording.events))
    heard_spikes = [
        (t, int(row["Scalars:scalars"][0]), sign)
        for name, sign in (("more", 1.0), ("less", -1.0))
        for t, row in kept[f"/spikes/{name}"]
    ]
    assert sorted(heard_spikes) == spikes_of(recording.events)
    assert [t for t, _ in kept["/detections"]] == sorted(s.t for s in said)
    assert [row["TextLog:text"] for _, row in kept["/notes"]] == [["here"]]
    times = np.array([t for t, _ in kept["/contact/force_ticks"]])
    assert [row["Scalars:scalars"][0] for _, row in kept["/contact/force_ticks"]] == force(recording.events, times)


def memory_mb(process: int) -> float:
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def listens(process: int) -> set[str]:
    """Tell on which addresses a process takes connections (proc(5))."""
    own = set()
    for link in Path(f"/proc/{process}/fd").iterdir():
        with contextlib.suppress(OSError):
            own.add(os.readlink(link))
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/{process}/net/{table}").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == "0A" and f"socket:[{columns[9]}]" in own:
                found.add(columns[1].partition(":")[0])
    return found


class Show:
    """The command ``taxel show``, which ends by Ctrl-C."""

    def __init__(self, folder: Path, panel: Panel, to: str, *more: str) -> None:
        words = command("show", panel.url, to, "--json", *more)
        self.errors = folder / "errors.txt"
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=errors, text=True)
        assert self.process.stdout is not None
        self.place = json.loads(self.process.stdout.readline())["place"]

    def __enter__(self) -> Show:
        return self

    def __exit__(self, *raised: Any) -> None:
        self.process.kill()
        self.process.communicate()

    def end(self) -> dict[str, Any]:
        """Return the last state."""
        self.process.send_signal(signal.SIGINT)
        said, _ = self.process.communicate(timeout=SOON)
        assert self.process.returncode == 0
        return dict(json.loads(said))


@foxglove
@pytest.mark.slow
def test_foxglove_is_served_on_loopback_alone_and_one_that_never_reads_holds_nobody_up(tmp_path: Path) -> None:
    path = tmp_path / "all.mcap"
    events = presses(150)
    with (
        Live(0, host=LOOPBACK, array=SMALL, record=path) as live,
        Panel(live) as panel,
        Show(tmp_path, panel, "foxglove:0", "--encoder", "change_events") as show,
        Foxglove(show.place) as page,
    ):
        page.meet()
        eventually(lambda: ": connected" in show.errors.read_text())
        before = memory_mb(show.process.pid)
        # The client reads nothing from here on.
        wait_for(live, play(events, live.address[1], pace=0.001))
        assert listens(show.process.pid) == {"0100007F"}
        assert memory_mb(show.process.pid) < before + 100
        state = show.end()
        # All spikes of the encoder were sent, or are counted as lost.
        assert state["sent"]["spikes"] + state["lost"].get("spikes", 0) >= SEEN * len(events)
    assert live.stop().lost == 0
    assert taxel.open(path).events == events


@rerun
@pytest.mark.slow
@pytest.mark.parametrize("fate", ["stopped", "killed", "missing"])
def test_whatever_becomes_of_rerun_nothing_recorded_is_lost(fate: str, tmp_path: Path, port: int) -> None:
    path, events = tmp_path / "all.mcap", presses(150)
    with (
        receiver(tmp_path, port) if fate != "missing" else contextlib.nullcontext() as process,
        Live(0, host=LOOPBACK, array=SMALL, record=path) as live,
        Panel(live) as panel,
        Show(tmp_path, panel, f"rerun:{LOOPBACK}:{port}", "--encoder", "change_events") as show,
    ):
        before = 0
        if process is not None:
            eventually(lambda: ": connected" in show.errors.read_text())
            before = show.errors.stat().st_size
            process.send_signal(signal.SIGSTOP if fate == "stopped" else signal.SIGKILL)
        wait_for(live, play(events, live.address[1], pace=0.001))
        assert listens(show.process.pid) == set()
        if fate != "stopped":
            eventually(lambda: "no viewer at" in show.errors.read_text()[before:])
        assert memory_mb(show.process.pid) < 600
        state = show.end()
        # All spikes of the encoder were sent, or are counted as lost.
        total = state["sent"].get("spikes", 0) + state["lost"].get("spikes", 0)
        assert SEEN * len(events) <= total <= len(events)
    assert live.stop().lost == 0
    assert taxel.open(path).events == events


@rerun
@pytest.mark.slow
def test_a_rerun_that_comes_back_is_shown_what_comes_then(tmp_path: Path, port: int) -> None:
    with (
        Live(0, host=LOOPBACK, array=SMALL) as live,
        Panel(live) as panel,
        Viewer(panel.url, f"rerun:{LOOPBACK}:{port}") as viewer,
    ):
        for n in range(2):
            with receiver(tmp_path, port):
                before = viewer.state.sent.get("frames", 0)
                play(presses(2), live.address[1])
                eventually(lambda before=before: viewer.state.there and viewer.state.sent.get("frames", 0) > before)
            eventually(lambda: not viewer.state.there)
            assert n or viewer.state.sent["frames"]
    assert len(list(tmp_path.glob("*.rrd"))) == 2


def test_what_waits_is_bounded_and_what_goes_is_counted() -> None:
    queue, one = BoundedQueue(), Subject("board", 1, 1)
    zero = np.zeros((1, 1), np.uint16)
    for t in range(3000):
        queue.put(one, Frame(t, zero, zero == 0, zero.astype(np.int8), 1, 1))
        queue.put(one, Note("here", t))
    assert queue.waiting() == {"frames": MOST_FRAMES, "notes": MOST_OTHERS}
    assert queue.lost == {"frames": 3000 - MOST_FRAMES, "notes": 3000 - MOST_OTHERS}
    items = queue.take_all(0.0)
    assert [item.t for _, item in items if isinstance(item, Frame)] == list(range(3000 - MOST_FRAMES, 3000))
    assert [item.t for _, item in items if isinstance(item, Note)] == list(range(3000 - MOST_OTHERS, 3000))
    assert queue.waiting().total() == len(items)
    queue.done()
    assert (queue.waiting(), queue.take_all(0.0)) == ({}, [])


@pytest.mark.parametrize("to", ["", "foxglove:", "foxglove:65536", "foxglove:8o", "rerun:here", "rerun::1", "ros", 3])
def test_what_no_viewer_is_is_refused(to: Any) -> None:
    with pytest.raises(ProblemError, match=r"^to is "):
        Viewer("none.mcap", to)


@foxglove
def test_nonsense_is_refused_by_name(tmp_path: Path) -> None:
    taxel.convert(presses(1), tmp_path / "one.mcap")
    for name, value, said in (
        ("speed", 0.0, "must be from 0.001 to 100"),
        ("rate_hz", 61.0, "must be from 1 to 60"),
        ("encoder", "fa1", "encoder is 'fa1'"),
    ):
        with pytest.raises(ProblemError, match=said):
            Viewer(tmp_path / "one.mcap", "foxglove:0", **{name: value})
    with Panel(tmp_path / "one.mcap") as panel, pytest.raises(ProblemError, match="refuses the connection"):
        Viewer(panel.url.replace("token=", "token=0"), "foxglove:0")
    with pytest.raises(FileNotFoundError):
        Viewer(tmp_path / "none.mcap", "foxglove:0")
    with Panel(tmp_path / "one.mcap") as panel, Viewer(panel.url, "foxglove:0") as first:
        taken = first.place.rpartition(":")[2]
        with pytest.raises(OSError, match=f"127.0.0.1:{taken}: Foxglove's server cannot listen there"):
            Viewer(panel.url, f"foxglove:{taken}")


@pytest.mark.parametrize("what", ["rerun", "foxglove"])
def test_an_extra_that_is_not_installed_is_named(
    what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == what else find(name, *rest))
    with pytest.raises(SystemExit) as ended:
        main(["show", "walk.mcap", what])
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"taxel: {what} is not installed: pip install 'taxel[{what}]'"
