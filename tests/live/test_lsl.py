"""The lab streaming layer, whose library listens on all addresses: only where TAXEL_LSL=1."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.live import Live

from .boards import LOOPBACK, SMALL, play, presses, touch, wait_for

pytestmark = [
    pytest.mark.skipif(os.environ.get("TAXEL_LSL") != "1", reason="listens on all addresses: give TAXEL_LSL=1"),
    pytest.mark.filterwarnings("ignore:the lab streaming layer listens"),
]


def test_a_stream_is_recorded_with_its_own_stamps(tmp_path: Path) -> None:
    lsl = pytest.importorskip("pylsl")
    about = lsl.StreamInfo("taxel test emg", "EMG", 2, 100.0, lsl.cf_double64, "taxel test emg")
    about.set_channel_labels(["left", "right"])
    outlet = lsl.StreamOutlet(about)
    path = tmp_path / "emg.mcap"
    with Live(0, host=LOOPBACK, array=SMALL, record=path, sources={"emg": "lsl:taxel test emg"}) as live:
        until = time.monotonic() + 30
        while not outlet.have_consumers():
            assert time.monotonic() < until
            time.sleep(0.01)
        sent = [(1000.0 + k / 100, [k, -k]) for k in range(50)]
        for stamp, values in sent:
            outlet.push_sample(values, stamp)
        while live.counters["sources"]["emg"]["frames"] < len(sent):
            assert time.monotonic() < until
            time.sleep(0.01)
    emg = taxel.open(path).sources["emg"]
    assert emg.columns == ["left", "right"]
    np.testing.assert_array_equal(emg.frames().t, [round(stamp * 1e6) for stamp, _ in sent])
    np.testing.assert_array_equal(emg.frames().values[:, 0], [values for _, values in sent])


def test_detections_are_a_stream_of_markers() -> None:
    lsl = pytest.importorskip("pylsl")
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), guard_frames=1e6, send="lsl:taxel test says") as live:
        (found,) = lsl.resolve_byprop("name", "taxel test says", 1, 30.0)
        inlet = lsl.StreamInlet(found)
        inlet.open_stream(30.0)
        wait_for(live, play(presses(3), live.address[1]))
        heard = [inlet.pull_sample(30.0) for _ in range(3)]
    assert [values for values, _ in heard] == [["touch"]] * 3
    stamps = [stamp for _, stamp in heard]
    assert stamps == sorted(stamps)
    assert all(abs(lsl.local_clock() - stamp) < 120 for stamp in stamps)


def test_a_stream_that_is_not_there_is_one_error(tmp_path: Path) -> None:
    pytest.importorskip("pylsl")
    with pytest.raises(taxel.ProblemError, match="lsl:nobody at all: no stream of that name was found within 3 s"):
        Live(0, host=LOOPBACK, record=tmp_path / "no.mcap", sources={"emg": "lsl:nobody at all"})
    assert not list(tmp_path.iterdir())
