"""A drifting taxel is zeroed when a person asks for it: heard live, kept, and heard the same from the recording."""

import socket
import time
from pathlib import Path

import numpy as np
import pytest
from loopback import until

import taxel
from taxel import Array, Events, Neuron, ProblemError, Readout, Tare, Zeroing, wire
from taxel.encode import ContactArea
from taxel.live import Live

LOOPBACK = "127.0.0.1"
FOUR = Array(4, 4, pitch_mm=2.0, name="four")
REST = 50


class Board:
    """Says what two taxels beside each other read, by a clock that began with it."""

    def __init__(self, live: Live) -> None:
        self.live, self.begun, self.said = live, time.monotonic(), 0

    def say(self, ticks: int) -> None:
        t = int((time.monotonic() - self.begun) * 1e4) * 100
        events = Events([t, t], [1, 2], [2, 2], [True, True], array=FOUR, intensity=[ticks, ticks])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.sendto(wire.encode(events), self.live.address)
        self.said += 2
        until(lambda: self.live.counters["read_out"] == self.said)
        time.sleep(0.02)


def readout() -> Readout:
    """Speaks where two taxels are loaded and were not."""
    return Readout(ContactArea(levels=[2]), {"contact": (Neuron(tau=0.5, refractory=5.0), [3.0, 0.0])}, array=FOUR)


def heard(live: Live) -> None:
    until(lambda: live.counters["events"] > 0)


@pytest.fixture
def tare() -> Tare:
    ticks = np.full(16, REST)
    rest = Events(np.arange(16) * 100, np.arange(16) % 4, np.arange(16) // 4, [True] * 16, array=FOUR, intensity=ticks)
    return Tare.take(rest, stop_us=10_000)


def test_what_is_zeroed_is_heard_anew_live_and_from_the_recording(tmp_path: Path, tare: Tare) -> None:
    place = tmp_path / "drift.mcap"
    with Live(0, host=LOOPBACK, readout=readout(), tare=tare, record=place) as live:
        board = Board(live)
        board.say(REST)
        board.say(REST + 10)
        until(lambda: live.counters["detections"] == 1)
        done = live.zero([1, 2], [2, 2])
        assert [(z.x, z.y, z.rest, z.before) for z in done] == [(1, 2, 60.0, 50.0), (2, 2, 60.0, 50.0)]
        board.say(REST + 12)
        board.say(REST + 30)
        until(lambda: live.counters["detections"] == 2)
        again = live.zero(1, 2)
        assert (again[0].rest, again[0].before) == (80.0, 60.0)
        assert live.zeroed == (again[0], done[1])
        live.note("a note")
    kept = taxel.open(place)
    assert kept.zeroings == (*done, *again)
    assert [note.text for note in kept.notes] == ["a note"], "what was zeroed is no label"
    assert "3 zeroed taxels" in repr(kept)
    said = taxel.detect.run(readout(), kept, tare=tare)
    assert len(said) == 2
    np.testing.assert_array_equal(said.t, kept.detections.t)
    np.testing.assert_array_equal(said.known, kept.detections.known)
    # The events alone do not contain the zeroing: the area stays at 2 from the drift on.
    assert len(taxel.detect.run(readout(), kept.events, tare=tare)) == 1
    assert taxel.convert(kept, tmp_path / "b.mcap") == []
    assert taxel.open(tmp_path / "b.mcap").zeroings == kept.zeroings
    for ending in (".npz", ".csv"):
        [lost] = taxel.convert(kept, tmp_path / f"b{ending}")
        assert "zeroed taxels" in lost
    later = kept.between(int(kept.events.t[-1]), np.inf)
    assert later.zeroings == kept.zeroings, "they still hold"
    (part,) = taxel.cut(kept, columns=slice(2, 4))
    assert part.zeroings == (Zeroing(done[1].t, 0, 2, 60.0, 50.0),)


def test_without_a_readout_it_is_kept_and_what_it_rested_at_before_is_unknown(tmp_path: Path) -> None:
    with Live(0, host=LOOPBACK, array=FOUR, record=tmp_path / "a.mcap") as live:
        with pytest.raises(ProblemError, match="nothing has arrived yet"):
            live.zero(1, 2)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            link.sendto(wire.encode(Events([0], [1], [2], [True], array=FOUR, intensity=[70])), live.address)
        heard(live)
        (done,) = live.zero(1, 2)
        for wrong, said in [
            ((0, 0), "taxel at row 0, column 0: its value is unknown, because it has sent no event"),
            ((4, 0), "taxel at row 0, column 4: does not exist in this array of 4 x 4 taxels"),
            (([1, 1], [2]), "x has 2 columns, but y has 1 row: must be as many"),
            ((-1, 0), "x is -1: must be a whole number that fits"),
            (([1, 0], [2, 0]), "has sent no event so far"),
        ]:
            with pytest.raises(ProblemError, match=said):
                live.zero(*wrong)
    assert (done.x, done.y, done.rest, done.before) == (1, 2, 70.0, None)
    assert taxel.open(tmp_path / "a.mcap").zeroings == (done,), "all or none"
