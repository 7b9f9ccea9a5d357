"""What comes over the network is recorded and read out, and nothing is lost uncounted."""

import os
import signal
import socket
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import Array, Detection, Events, Neuron, ProblemError, Readout, Tare
from taxel.detect import PlainRule
from taxel.encode import ContactArea
from taxel.live import Live

from .boards import (
    LOOPBACK,
    SMALL,
    datagrams,
    play,
    presses,
    touch,
    wait_for,
)


@pytest.mark.parametrize("tared", [False, True])
@pytest.mark.parametrize("stretch", [1.5, 1.0])
def test_a_board_that_lags_its_own_clock_gives_the_detections_of_its_recording(
    tmp_path: Path, stretch: float, tared: bool
) -> None:
    pressed = presses(15)
    t = np.r_[np.arange(0, 60_000, 10_000), pressed.t + 60_000]
    ticks = np.r_[np.full(6, 60), pressed.intensity]
    events = Events(t, np.full(len(t), 1), np.full(len(t), 2), np.ones(len(t), bool), array=SMALL, intensity=ticks)
    readout, tare = (PlainRule("local_load", 2), 0.05) if tared else (touch(), None)
    options = {"array": SMALL, "readout": readout, "tare": tare, "record": tmp_path / "lagging.mcap"}
    with Live(0, host=LOOPBACK, **options) as live, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        begun, stamps = time.monotonic(), np.unique(events.t)
        for t, one in zip(stamps, datagrams(events), strict=True):
            time.sleep(max(0.0, begun + stretch * t * 1e-6 - time.monotonic()))
            link.sendto(one, live.address)
        wait_for(live, len(stamps))
        time.sleep(0.2)
        taken = live.tare
    counters = live.stop().counters
    recorded = taxel.open(tmp_path / "lagging.mcap")
    if tared:
        np.testing.assert_array_equal(taken.rest, Tare.take(recorded.events, start_us=0, stop_us=50_000).rest)
    again = taxel.detect.run(readout, recorded, **({"tare": taken} if tared else {}))
    found = {(one.label, one.t, one.known) for one in taxel.Detections.from_list(recorded.detections)}
    assert len(again) >= 10
    assert {(one.label, one.t, one.known) for one in again} <= found
    assert counters["late"] == 0
    assert counters["detections"] == len(again) + counters["wrong"]


def test_what_the_callers_function_raises_is_raised() -> None:
    def refuse(said: Detection) -> None:
        raise LookupError(f"nothing to do with {said.label}")

    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=refuse) as live:
        play(presses(2), live.address[1])
        with pytest.raises(LookupError, match="nothing to do with touch"):
            list(live)
        assert list(live) == [], "it has ended"


def test_a_readout_that_needs_a_tare_and_has_none_is_refused() -> None:
    readout = Readout(ContactArea(), {"contact": (Neuron(), np.ones(10))})
    with pytest.raises(ProblemError, match="tare"):
        Live(0, host=LOOPBACK, readout=readout)


@pytest.mark.parametrize(("rows", "columns"), [(1, 65_535), (256, 256), (65_535, 1)])
def test_the_largest_arrays_that_a_board_can_name_are_heard(rows: int, columns: int) -> None:
    with Live(0, host=LOOPBACK, array=Array(rows, columns)) as live:
        pass
    assert live.stop().lost == 0


def test_ctrl_c_ends_a_wait_for_detections() -> None:
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch()) as live:
        threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            live.next(60)
