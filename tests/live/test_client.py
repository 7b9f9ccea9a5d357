"""`PanelClient` yields what a board sends and what a recording holds; its errors name what would be right."""

from __future__ import annotations

import socket
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from loopback import until

import taxel
from taxel import Detection, Note, ProblemError
from taxel.encode import ChangeEvents
from taxel.live import Live, Panel, PanelClient
from taxel.live.client import Curves, Frame, Spikes

from .boards import LOOPBACK, SMALL, above_rest, force, play, presses, spikes_of, touch, wait_for

pytest.importorskip("websockets", reason="the test extra brings websockets")

#: Timeout for an event on a busy machine, s.
SOON = 60.0


def test_a_recording_is_yielded_to_its_end(tmp_path: Path) -> None:
    events = presses(20)
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), record=tmp_path / "one.mcap") as live:
        wait_for(live, play(events, live.address[1], pace=0.002))
        live.note("here")
    detections = live.stop().counters["detections"]
    recorded = taxel.open(tmp_path / "one.mcap").events
    with (
        Panel(tmp_path / "one.mcap") as panel,
        PanelClient(panel.url, encoder=ChangeEvents(), rate_hz=60.0) as client,
    ):
        client.play(5.0)
        items = list(client)
        assert client.warning is None
    assert {(subject.name, subject.rows, subject.columns) for subject, _ in items} == {("one.mcap", *SMALL.shape)}
    found = {kind: [item for _, item in items if isinstance(item, kind)] for kind in (Frame, Curves, Spikes)}
    last = found[Frame][-1]
    assert last.t == recorded.t[-1]
    np.testing.assert_array_equal(last.above, above_rest(recorded))
    times = np.concatenate([curves.t for curves in found[Curves]])
    assert np.all(np.diff(times) == 4000)
    assert np.concatenate([curves.force for curves in found[Curves]]).tolist() == force(recorded, times)
    spikes = [(t, n, v) for s in found[Spikes] for t, n, v in zip(s.t, s.train, s.value, strict=True)]
    assert sorted(spikes) == spikes_of(recorded)
    assert len([item for _, item in items if isinstance(item, Detection)]) == detections > 0
    assert [item.text for _, item in items if isinstance(item, Note)] == ["here"]


def test_a_client_that_connects_later_gets_the_detections_before_it() -> None:
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch()) as live, Panel(live) as panel:
        wait_for(live, play(presses(5), live.address[1]))
        until(lambda: live.counters["detections"] == 5)
        with PanelClient(panel.url) as client:
            found: list[Detection] = []
            for _, item in client:
                found += [item] if isinstance(item, Detection) else []
                if len(found) == 5:
                    break
        assert [item.t for item in found] == sorted(item.t for item in found)


def test_a_board_is_yielded_until_the_server_ends() -> None:
    events = presses(5)
    with Live(0, host=LOOPBACK, array=SMALL) as live:
        panel = Panel(live)
        with PanelClient(panel.url) as client:
            wait_for(live, play(events, live.address[1]))
            shown = iter(client)
            expected, until = above_rest(events), time.monotonic() + SOON
            _, item = next(shown)
            while not (isinstance(item, Frame) and np.array_equal(item.above, expected)):
                assert time.monotonic() < until
                _, item = next(shown)
            panel.stop()
            assert all(isinstance(item, Frame | Curves) for _, item in shown)


def test_what_is_no_panel_is_refused_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for url in ("", "127.0.0.1:80", "http://127.0.0.1:80/", "http://127.0.0.1:80/#open=walk.mcap"):
        with pytest.raises(ProblemError, match=r"^url is .*: must be a panel's address"):
            PanelClient(url)
    with socket.socket() as unused:
        unused.bind((LOOPBACK, 0))
        with pytest.raises(OSError, match="refused"):
            PanelClient(f"http://{LOOPBACK}:{unused.getsockname()[1]}/#token=0")
    taxel.convert(presses(1), tmp_path / "one.mcap")
    with Panel(tmp_path / "one.mcap") as panel:
        with pytest.raises(ProblemError, match="refuses the connection"):
            PanelClient(panel.url.replace("token=", "token=0"))
        with pytest.raises(ProblemError, match="rate_hz is 61"):
            PanelClient(panel.url, rate_hz=61.0)
        monkeypatch.setitem(sys.modules, "websockets.exceptions", None)
        with pytest.raises(ImportError, match="pip install websockets"):
            PanelClient(panel.url)
