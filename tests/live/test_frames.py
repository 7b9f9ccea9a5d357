"""Frames of numbers live: a readout detects the same as in the recording that is made beside it."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from draws import mixed
from loopback import until
from mcap.reader import make_reader
from numpy.typing import NDArray

import taxel
from live.boards import LOOPBACK
from taxel import Array, Frames, Tare
from taxel.detect import PlainRule, Readout, run
from taxel.detect.readout import USES, run_watched
from taxel.detections import Detection
from taxel.encode import LevelCrossing
from taxel.live import Live
from taxel.neuron import Neuron

PERIOD_US = 10_000


@contextlib.contextmanager
def served(text: str, *, at_once: bool = True) -> Iterator[str]:
    """Yield the address of a server that sends a text to whoever connects, in pieces, and then waits."""
    over = threading.Event()
    with socket.create_server((LOOPBACK, 0)) as server:

        def serve() -> None:
            with contextlib.suppress(OSError):
                connection, _ = server.accept()
                with connection:
                    data, size = text.encode(), 1_000_000 if at_once else 97
                    for begin in range(0, len(data), size):
                        connection.sendall(data[begin : begin + size])
                    over.wait(30)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            yield f"{LOOPBACK}:{server.getsockname()[1]}"
        finally:
            over.set()
            thread.join(10)


def touches(rng: np.random.Generator, rows: int, columns: int, count: int, unit: str) -> NDArray[np.float64]:
    """Return frames with noise and touches, as a maker's sensor prints them: whole counts, else decimals."""
    values = rng.normal(0.0, 0.4, (count, rows, columns))
    for begin in range(20, count - 20, 40):
        y, x = rng.integers(rows), rng.integers(columns)
        values[begin : begin + 15, max(0, y - 1) : y + 2, max(0, x - 1) : x + 2] += 60.0
    return np.rint(np.abs(values) * 4) if unit == "counts" else np.round(values - 0.1, 3)


def lines_of(
    values: NDArray[np.float64], t_us: NDArray[np.int64] | None = None, a_frame: int = 1, end: str = ""
) -> str:
    """Return a line for each frame, or several, with the time first if it is given."""
    text = []
    for k, frame in enumerate(values):
        for row in frame.reshape(a_frame, -1):
            stamp = [] if t_us is None else [str(t_us[k])]
            text.append(",".join([*stamp, *(f"{value:g}" for value in row)]))
        text.extend([end] * bool(end))
    return "\n".join(text).replace("BLANK", "") + "\n"


def readout_of(rows: int, columns: int, unit: str) -> Readout:
    """Return a readout that fires when any taxel rises."""
    taxels, level = rows * columns, 100.0 if unit == "counts" else 25.0
    weights = np.tile([1.0, 0.0], taxels)
    encoder = LevelCrossing([level])
    return Readout(encoder, {"contact": (Neuron(tau=2.0), weights, 0.5)}, array=Array(rows, columns), unit=unit)


@pytest.mark.parametrize(
    ("shape", "kind"),
    mixed(
        [(1, 1, "counts"), (1, 6, "kPa"), (3, 5, "kPa"), (16, 16, "N"), (64, 64, "counts")],
        ["readout", "rule"],
    ),
)
def test_a_readout_detects_the_same_live_and_in_the_recording_beside_it(
    tmp_path: Path, shape: tuple[int, int, str], kind: str
) -> None:
    rows, columns, unit = shape
    rng = np.random.default_rng(rows * columns)
    values = touches(rng, rows, columns, 300, unit)
    t = np.cumsum(rng.integers(PERIOD_US - 900, PERIOD_US + 900, len(values))) + 5_000_000_000
    detector: Readout | PlainRule = readout_of(rows, columns, unit)
    if kind == "rule":
        tare = Tare.take(Frames(np.zeros((2, rows, columns)), [0, 1], unit=unit))
        detector = PlainRule("area", 1.0, 1.0, noise_floor=20.0, unit=unit, tare=tare)
    path = tmp_path / "mat.mcap"
    found: list[Detection] = []
    with served(lines_of(values, t)) as address:
        source = f"mat=lines+tcp:{address},array={rows}x{columns},time=1:us,unit={unit}"
        with Live(readout=detector, sources=source, record=path, say=found.append) as live:
            assert (live.array.shape, live.unit, live.name) == ((rows, columns), unit, "mat")
            until(lambda: live.counters["frames"] == len(values))
            assert live.frame.shape == (rows, columns)
            summary = live.stop()
    recording = taxel.open(path)
    frames = recording.frames()
    assert np.array_equal(frames.t, t)
    assert np.array_equal(frames.values, values.astype(np.float32))
    assert (frames.unit, recording.frame_us) == (unit, live.frame_us)
    assert summary.verdict == recording.verdict
    # Stamps of 3 s arrive at once, but on a busy machine in seconds: then their clock is doubted.
    assert not summary.verdict.lost
    assert {*summary.verdict.damaged} <= {"drifts_from_arrival"}
    expected = run(detector, recording)
    assert len(expected) >= 5
    assert [(d.label, d.t, d.known) for d in found] == [(d.label, d.t, d.known) for d in expected]
    assert [(d.label, d.t, d.known) for d in recording.detections] == [(d.label, d.t, d.known) for d in expected]


@pytest.mark.parametrize("use", USES)
def test_what_was_asked_detects_live(use: str) -> None:
    values = touches(np.random.default_rng(4), 4, 4, 300, "N")
    t = PERIOD_US * np.arange(len(values))
    rule = PlainRule("area", 1.0, 1.0, noise_floor=20.0, unit="N", labels=("contact", None))
    trained = readout_of(4, 4, "N")._with_rules({"contact": rule}, ["contact"])
    tare, frames = Tare.take(Frames(np.zeros((2, 4, 4)), [0, 1], unit="N")), Frames(values, t, unit="N")
    by = {way: run(trained.using(way), frames, tare=tare) for way in USES}
    assert by["better"].t.tolist() == by["rule"].t.tolist() != by["neuron"].t.tolist()
    found: list[Detection] = []
    with served(lines_of(values, t)) as address:
        source = f"lines+tcp:{address},array=4x4,time=1:us,unit=N"
        with Live(readout=trained, use=use, tare=tare, sources=source, say=found.append) as live:
            until(lambda: live.counters["frames"] == len(values))
            live.stop()
    assert [d.t for d in found] == by[use].t.tolist()
    with pytest.raises(taxel.ProblemError, match=r"^use is 'both'"):
        Live(readout=trained, use="both", sources="given,array=4x4,rate=10")
    with pytest.raises(taxel.ProblemError, match=r"^use is 'neuron'"):
        Live(readout=rule, use="neuron", sources="given,array=4x4,rate=10")


def test_lines_that_are_no_frame_are_counted_and_the_next_frame_is_whole(tmp_path: Path) -> None:
    text = "Hello from the mat\n1,2\n3,4\n\n5,6\n7\n9,9\n\nnan,2\n3,4\n\n-1,-2.5\n1e3,4\n\n"
    with served(text) as address:
        source = f"lines+tcp:{address},array=2x2,columns=a:b,frame_end=blank,rate=10"
        with Live(sources=source, record=tmp_path / "a.mcap") as live:
            until(lambda: live.counters["frames"] == 3)
            summary = live.stop()
    frames = taxel.open(tmp_path / "a.mcap").frames()
    expected = [[[1, 2], [3, 4]], [[np.nan, 2], [3, 4]], [[-1, -2.5], [1e3, 4]]]
    assert np.array_equal(frames.values, np.array(expected, np.float32), equal_nan=True)
    assert np.all(np.diff(frames.t) > 0)
    counts = summary.counters["lines"]
    assert (counts["lines"], counts["strange"]) == (10, 3)
    assert summary.verdict.damaged == {"lines_that_could_not_be_read": 3}
    kinds = {kind: (found["lines"], found["first"]) for kind, found in counts["unread"].items()}
    assert kinds == {"text": (1, "Hello from the mat"), "other_length": (1, "7"), "unfinished_frames": (2, "")}
    assert taxel.open(tmp_path / "a.mcap").verdict.damaged == summary.verdict.damaged
    with (tmp_path / "a.mcap").open("rb") as file:
        kept = [json.loads(message.data)["line"] for _, _, message in make_reader(file).iter_messages("/lines")]
    assert sorted(kept) == ["5,6", "7", "9,9", "Hello from the mat"]


IN_TURN = {
    "before numbers": ("left: {},2,3\nright: {},800,7\n", ",rate=50"),
    "by key": ('{{"left": [{}, 2]}}\n{{"right": [{}, 800, 7]}}\n', ",rate=50"),
    "behind the time": ("{t},left:{},2\n{u},right:{},800\n", ""),
    "by a column": ("{t},left,{},2\n{u},right,{},800\n", ",by=2"),
    "a column each line": ("{t},left,{}\n{u},right,{}\n", ",by=2,time=1:ms,unit=N"),
}


@pytest.mark.parametrize("how", IN_TURN)
def test_two_sensors_that_print_in_turn_are_two_sources(how: str, tmp_path: Path) -> None:
    line, keys = IN_TURN[how]
    text = "Ready\n" + "".join(line.format(k % 9, 900 - k, t=20 * k, u=20 * k + 5) for k in range(100))
    with served(text) as address:
        with Live(sources=f"lines+tcp:{address}{keys}", record=tmp_path / "a.mcap") as live:
            assert live.name == "left"
            until(lambda: live.counters["frames"] == 100 == live.counters["sources"]["right"]["frames"])
            counters = live.stop().counters
        assert counters["sources"]["right"]["lines"]["strange"] == 0
    left, right = taxel.open(tmp_path / "a.mcap").sources.values()
    assert left.frames().values[:, 0, 0].tolist() == [k % 9 for k in range(100)]
    assert right.frames().values[:, 0, 0].tolist() == [900 - k for k in range(100)]
    if "time" in how or "column" in how:
        assert left.frames().t.tolist() == [20_000 * k for k in range(100)]
        assert right.frames().t.tolist() == [20_000 * k + 5000 for k in range(100)]


def test_of_sensors_that_print_in_turn_each_ends_its_frames_and_lines_of_none_are_counted(tmp_path: Path) -> None:
    frame = "left: {0} 2\nleft: 3 4\n\nright: 5 {0}\nright: 7 8\n\n"
    text = "".join(frame.format(k) for k in range(50)) + "middle: 1 2\nleft: 1\n\n"
    source = "mat=lines+tcp:{},rate=50,array=2x2,frame_end=blank"
    with served(text) as address, Live(sources=source.format(address), record=tmp_path / "a.mcap") as live:
        until(lambda: live.counters["sources"]["mat_right"]["frames"] == 50)
        until(lambda: live.counters["lines"]["strange"] == 1)
        assert live.stop().counters["lines"]["bytes_in_no_line"] == len("middle: 1 2")
    sources = taxel.open(tmp_path / "a.mcap").sources
    assert [*sources] == ["mat_left", "mat_right"]
    assert sources["mat_left"].frames().values.tolist() == [[[k, 2], [3, 4]] for k in range(50)]
    assert sources["mat_right"].frames().values.tolist() == [[[5, k], [7, 8]] for k in range(50)]


def test_frames_begin_at_a_line_of_text_with_their_time(tmp_path: Path) -> None:
    text = "3 4\n" + "".join(f"FRAME {k} ({20 * k} ms)\n{k} 2\n3 4\n" for k in range(40)) + "FRAME 40 (800 ms)\n1 2\n"
    begin = text.replace("FRAME 7 (140 ms)\n7 2\n", "FRAME 7 (140 ms)\n")
    with served(begin) as address:
        source = f"lines+tcp:{address},array=2x2,frame_begin=FRAME,frame_time=ms"
        with Live(sources=source, record=tmp_path / "a.mcap") as live:
            until(lambda: live.counters["frames"] == 39)
            summary = live.stop()
    frames = taxel.open(tmp_path / "a.mcap").frames()
    assert frames.t.tolist() == [20_000 * k for k in range(40) if k != 7]
    assert frames.values[:, 0, 0].tolist() == [k for k in range(40) if k != 7]
    assert summary.verdict.damaged == {"lines_that_could_not_be_read": 1}


def test_a_layout_file_names_a_source(tmp_path: Path) -> None:
    layout = tmp_path / "mat.layout.toml"
    with served("t,x,a,b\n0,hi,1000,1023\n20,hi,900,1023\n") as address:
        layout.write_text(
            'rows = 1\ncolumns = 2\npitch_mm = 5\nunit = "kPa"\nfalls = 1023\nrate_hz = 50\n\n[source]\n'
            f'place = "lines+tcp:{address}"\ntime = "t:ms"\nleave_out = ["x"]\n'
        )
        with Live(sources=f"mat={layout}", record=tmp_path / "a.mcap") as live:
            assert (live.name, live.unit, live.frame_us, live.array.shape) == ("mat", "kPa", 20_000.0, (1, 2))
            until(lambda: live.counters["frames"] == 2)
    frames = taxel.open(tmp_path / "a.mcap").frames()
    assert (frames.t.tolist(), frames.values[:, 0].tolist()) == ([0, 20_000], [[23, 0], [123, 0]])
    assert frames.array.pitch_mm == 5
    layout.write_text("rows = 1\ncolumns = 2\n")
    with pytest.raises(taxel.FormatError, match=r"\[source\] place is missing"):
        Live(sources=str(layout))


def test_a_readout_of_another_unit_or_shape_is_refused(tmp_path: Path) -> None:
    for options, why in [
        ("array=2x2,unit=kPa", "live values are in kPa, but the readout was trained on N: .*add unit=N in --source"),
        ("array=2x3,unit=N", "trained on 2 x 2"),
        ("array=2x2,columns=a:b:c", "lines have 3 values: must be 4 per frame"),
        ("array=2x2,frame_lines=3", "lines have 1 value, 3 lines per frame: must be 4 per frame"),
    ]:
        with pytest.raises(taxel.ProblemError, match=why):
            Live(readout=readout_of(2, 2, "N"), sources=f"given,{options},rate=10", record=tmp_path / "a.mcap")
        assert not (tmp_path / "a.mcap").exists()


def test_a_source_that_states_no_unit_is_taken_in_that_of_the_readout(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for unit in ("N", "as sent"):
        with Live(
            readout=readout_of(2, 2, unit), sources="given,array=2x2,rate=10", record=path, overwrite=True
        ) as live:
            assert live.unit == unit
            live.sample("frames", [1, 2, 3, 4])
        assert taxel.open(path).frames().unit == unit
        both = ["left=given,array=2x2,rate=10", "right=given,array=2x2,rate=10"]
        with Live(readout=readout_of(2, 2, unit), sources=both, record=path, overwrite=True) as live:
            live.sample("left", [1, 2, 3, 4])
            live.sample("right", [1, 2, 3, 4])
        assert {source.frames().unit for source in taxel.open(path).sources.values()} == {unit}
    with Live(sources="given,array=2x2,rate=10") as live:
        assert live.unit == "counts"


@pytest.mark.parametrize(("unit", "steps_ms", "right"), [("s", 20.0, "ms"), ("ms", 20_000.0, "us")])
def test_stamps_in_another_unit_than_is_stated_are_told(unit: str, steps_ms: float, right: str) -> None:
    """Frames come 50 times a second, but last 20 s by their stamps."""
    over = threading.Event()
    with socket.create_server((LOOPBACK, 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            with connection, contextlib.suppress(OSError):
                for k in range(1000):
                    connection.sendall(f"{k * steps_ms:.0f},1,2,3,{k % 7}\n".encode())
                    if over.wait(0.02):
                        return

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        source = f"lines+tcp:{LOOPBACK}:{server.getsockname()[1]},array=2x2,time=1:{unit}"
        try:
            with pytest.raises(taxel.ProblemError, match=rf"a frame lasts 20 s: is the unit {right}\?"):
                Live(sources=source)
        finally:
            over.set()
            thread.join(10)


@pytest.mark.parametrize("absorb_s", [60.0, 0.0])
def test_a_rest_that_leaves_its_floor_is_counted_live_as_in_the_recording(tmp_path: Path, absorb_s: float) -> None:
    values = 100.0 + np.random.default_rng(1).normal(0.0, 0.4, (1500, 4, 4)) + np.arange(1500)[:, None, None] / 100.0
    values[700:800, 1:3, 1:3] += 60.0
    t = np.arange(1500) * PERIOD_US
    tare = Tare.take(Frames(values[:50], t[:50], unit="counts", array=Array(4, 4)))
    rule = PlainRule("load", 50.0, 0.5, noise_floor=4.0, unit="counts", tare=tare)
    found: list[Detection] = []
    with served(lines_of(values, t)) as address:
        source = f"mat=lines+tcp:{address},array=4x4,time=1:us,unit=counts"
        options = {"readout": rule, "sources": source, "record": tmp_path / "mat.mcap", "say": found.append}
        with Live(**options, absorb_s=absorb_s) as live:
            until(lambda: live.counters["frames"] == len(values))
            counters = live.stop().counters
    found_again, left = run_watched(rule.absorbing(absorb_s), taxel.open(tmp_path / "mat.mcap"))
    assert left is not None
    assert counters["left_floor"] == {"since_us": left[0], "taxels": left[1]}
    assert [(d.label, d.t) for d in found] == [(d.label, d.t) for d in found_again]
    assert (len(found) == 2) == (absorb_s > 0.0)
