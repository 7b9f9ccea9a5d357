"""Trial after trial from one receiver: each begins with what the taxels hold, and nothing is lost between two."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from loopback import free_port, until
from shell import run_beside

import taxel
from taxel import Events, wire
from taxel.live import Live

from .boards import LOOPBACK, SMALL, held

#: The value that each taxel receives once, before all else.
REST = 40 + np.arange(16)
#: Interval between datagrams by the board's clock: a 6.5 s turn of its counter takes less than a second of the test.
STEP_US = 5000


def told() -> bytes:
    """Every taxel, once: what a board says when it begins."""
    taxel_of = np.arange(16)
    return wire.encode(
        Events(np.zeros(16, int), taxel_of % 4, taxel_of // 4, np.ones(16, bool), array=SMALL, intensity=REST)
    )


def step(n: int) -> bytes:
    """The n-th datagram after that: one event whose stamp and ticks name it; the last row never changes again."""
    at = n % 12
    return wire.encode(
        Events([STEP_US * (n + 1)], [at % 4], [at // 4], [True], array=SMALL, intensity=[100 + n % 50_000])
    )


@contextmanager
def board(port: int) -> Iterator[list[int]]:
    """Tell all once, then a step each half ms, until the block ends; give what was sent, one number a step."""
    sent: list[int] = []
    over = threading.Event()

    def run() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.sendto(told(), (LOOPBACK, port))
            while not over.wait(0.0005):
                link.sendto(step(len(sent)), (LOOPBACK, port))
                sent.append(len(sent))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield sent
    finally:
        over.set()
        thread.join()


def steps(recording: taxel.Recording) -> list[int]:
    return [int(ticks) - 100 for ticks in recording.events.intensity if ticks >= 100]


def begun(recording: taxel.Recording) -> np.ndarray[tuple[int], np.dtype[np.float32]]:
    """Return what the taxels held when it began."""
    assert recording.held is not None
    return recording.held.reshape(-1)


def assert_follow_each_other(trials: list[Path], source: str | None = None) -> None:
    """Each datagram is in one trial, in order; each trial knows what the taxels held, on one clock."""
    held = REST.astype(float)
    seen: list[int] = []
    for path in trials:
        recording = taxel.open(path)
        if source:
            recording = recording.sources[source]
        mine = steps(recording)
        assert mine, path
        if not seen:
            held = np.where(np.isnan(begun(recording)), held, begun(recording))
        else:
            np.testing.assert_array_equal(begun(recording), held)
            if source is None:
                np.testing.assert_array_equal(recording.events.t, STEP_US * (np.array(mine) + 1))
        for n in mine:
            held[n % 12] = 100 + n
        seen += mine
    assert seen == list(range(seen[0], seen[0] + len(seen)))


def record(port: int, *arguments: object) -> list[object]:
    return ["record", *arguments, "--host", LOOPBACK, "--port", port, "--array", "4x4"]


def test_trials_that_follow_each_other_lose_nothing_and_know_what_was_held(tmp_path: Path) -> None:
    port = free_port()
    arguments = record(port, tmp_path / "step.mcap", "--length", 0.25, "--countdown", 0, "--trials", 4, "--json")
    with ExitStack() as playing:
        done = run_beside(lambda _: playing.enter_context(board(port)), *arguments, ended=None)
    assert done.returncode == 0, done.stderr
    trials = [tmp_path / f"step{n}.mcap" for n in (1, 2, 3, 4)]
    assert sorted(tmp_path.iterdir()) == trials
    assert_follow_each_other(trials)
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert [line["path"] for line in lines] == [str(path) for path in trials]
    for line, path in zip(lines, trials, strict=True):
        counters, capture = line["counters"], line["counters"]["capture"]
        assert counters["events"] == len(taxel.open(path).events), "of this trial, not of all"
        assert capture["datagrams"] == counters["decoded"] + capture["dropped_by_queue"]
        assert counters["wire"]["bytes"] == 5 * counters["wire"]["words"]
        assert line["verdict"].startswith("nothing lost after arrival")


def test_what_came_between_two_trials_is_in_neither_and_is_known_to_the_next(tmp_path: Path) -> None:
    with (
        Live(0, host=LOOPBACK, array=SMALL, record_later=True) as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):

        def hear(data: bytes) -> None:
            before = live.counters["decoded"]
            link.sendto(data, live.address)
            until(lambda: live.counters["decoded"] > before)

        hear(told())
        live.record(tmp_path / "a.mcap")
        hear(step(0))
        assert live.end_recording().counters["decoded"] == 1
        hear(step(1))
        live.record(tmp_path / "b.mcap")
        hear(step(2))
        # An existing file stays unchanged, and the running recording continues.
        with pytest.raises(FileExistsError):
            live.record(tmp_path / "a.mcap")
        assert live.records
        hear(step(3))
        live.end_recording()
    a, b = taxel.open(tmp_path / "a.mcap"), taxel.open(tmp_path / "b.mcap")
    assert (steps(a), steps(b)) == ([0], [2, 3])
    np.testing.assert_array_equal(begun(a), REST)
    np.testing.assert_array_equal(begun(b), np.r_[100, 101, REST[2:]])


def test_ctrl_c_ends_the_trial_that_runs_well(tmp_path: Path) -> None:
    port = free_port()
    arguments = record(port, tmp_path / "step.mcap", "--length", 0.3, "--countdown", 0, "--json")

    def play(_: str) -> None:
        with board(port):
            until(lambda: held(tmp_path / "step3.mcap"))

    done = run_beside(play, *arguments)
    assert done.returncode == 0, done.stderr
    trials = sorted(tmp_path.iterdir())
    assert len(trials) >= 3
    assert_follow_each_other(trials)
    assert all(taxel.open(path).verdict.startswith("nothing lost after arrival") for path in trials)


def heard(live: Live) -> int:
    """Return how many datagrams of either board were decoded at least."""
    return min(int(live.counters["decoded"]), int(live.counters["sources"]["left"]["decoded"]))


def test_every_source_is_in_every_trial_and_each_of_its_lines_in_one(tmp_path: Path) -> None:
    paths = [tmp_path / f"{n}.mcap" for n in range(4)]
    sources = {"left": f"board:{LOOPBACK}:0,array=4x4", "force": "given,columns=n"}
    with Live(0, host=LOOPBACK, array=SMALL, record_later=True, name="right", sources=sources) as live:
        # Datagrams and samples that arrive while nothing is recorded are counted but not stored.
        live.sample("force", [-1.0])
        with board(live.address[1]), board(live.source_address("left")[1]):
            until(lambda: heard(live) > 0)
            given = 0
            for n, path in enumerate(paths):
                live.record(path)
                for _ in range(10 + n):
                    live.sample("force", [float(given)])
                    given += 1
                came = live.counters["decoded"] + live.counters["sources"]["left"]["decoded"]
                until(lambda: heard(live) > came + 10)  # noqa: B023
                live.note(f"note {n}")
            ended = live.end_recording()
        assert ended.counters["sources"]["force"]["frames"] == 13
    lines: list[float] = []
    for name in ("right", "left"):
        assert_follow_each_other(paths, name)
    for n, path in enumerate(paths):
        lines += taxel.open(path).sources["force"].frames().values.reshape(-1).tolist()
        notes = taxel.open(path).sources["right"].notes
        assert [note.text for note in notes] == [f"note {n}"]
        right = taxel.open(path).sources["right"].events.t
        # Notes have the time of the recording's own clock, whatever the pipeline's time is.
        assert right[0] <= notes[0].t <= right[-1]
    assert lines == [float(n) for n in range(given)]
