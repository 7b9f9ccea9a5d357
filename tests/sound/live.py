"""Sound calls of `taxel.live`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, BYTES, Sound, method, plain


def listen(**arguments: Any) -> None:
    """Begin to listen live, and stop."""
    taxel.live.Live(**arguments).stop()


def panel(**arguments: Any) -> None:
    """Begin to show a recording, and stop."""
    taxel.live.Panel(**arguments).stop()


#: A sound call of everything public that takes anything, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.live.Source": plain(
        taxel.live.Source, array=ARRAY, rate=100.0, bits=8, noise_floor=3, to="127.0.0.1:9", board=1
    ),
    "taxel.live.Source.push": method(
        taxel.live.Source(ARRAY, 100.0, to="127.0.0.1:9"), "push", frame=np.zeros((4, 4), np.int64)
    ),
    "taxel.live.Live": plain(
        listen,
        port=0,
        host="127.0.0.1",
        remote=None,
        array=None,
        registers="5.2 kHz",
        differences=False,
        readout=None,
        tare=None,
        record="live.mcap",
        record_later=False,
        name="board",
        sources={"imu": "given,columns=a"},
        send=[],
        compression="none",
        overwrite=True,
        guard_frames=5.0,
        gap_frames=1.0,
        say=lambda _: None,
        lines=False,
        kernel_buffer_bytes=100_000,
        queue_bytes=100_000,
        readout_events=1000,
        gro=False,
    ),
    "taxel.live.Panel": plain(panel, shows="here_panel.mcap", control=None, folder=None, port=0, host="127.0.0.1"),
    "taxel.live.send": plain(
        taxel.live.send,
        datagrams=[BYTES],
        host="127.0.0.1",
        port=9,
        each=1,
        period_us=192.0,
        seconds=0.001,
        segment=False,
    ),
    "taxel.live.heard": plain(taxel.live.heard, said=[taxel.Detection("a", 5, 6)]),
}

#: How a call returns one of each type that taxel alone makes.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.live.Summary": lambda: taxel.live.Live(0, host="127.0.0.1").stop(),
}

#: What is not tried, and why.
LEFT_OUT: dict[str, str] = {
    "taxel.live.Live.expect_version": "tried with version 2's own tests",
    "taxel.live.Panel.listen": "begins a Live, which checks",
    "taxel.live.Bridge": "needs a wheel of its own; tried in tests/bridge",
    "taxel.live.Remote": "needs a wheel of its own; tried in tests/bridge",
    "taxel.live.PanelClient": "connects to a panel; tried in tests/live/test_client.py",
    "taxel.live.PanelClient.play": "asks a panel; tried in tests/live/test_client.py",
    "taxel.live.Viewer": "needs an extra and begins a process; tried in tests/live",
    "taxel.live.Viewing": "a result",
    "taxel.live.Viewer.wait": "waits",
    "taxel.live.Panel.delta_intensity": "begins a Live; its flag is checked, and tests/panel tries it",
    "taxel.live.Live.next": "waits",
    "taxel.live.Live.note": "tried with Live's own tests",
    "taxel.live.Live.record": "tried with trials' own tests",
    "taxel.live.Live.zero": "tried with Live's own tests",
    "taxel.live.Live.sample": "tried with Live's own tests",
    "taxel.live.Live.source_address": "tried with Live's own tests",
}
