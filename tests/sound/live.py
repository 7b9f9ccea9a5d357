"""Sound calls of `taxel.live`."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, BYTES, Sound, fresh, method, plain
from taxel.recording.text_options import TextOptions


def listen(**arguments: Any) -> None:
    """Begin to listen live, and stop."""
    taxel.live.Live(**arguments).stop()


@cache
def ended() -> taxel.live.Live:
    """Listen live, once for all calls, and stop: `next` then returns at once."""
    live = taxel.live.Live(0, host="127.0.0.1")
    live.stop()
    return live


def on_live(name: str, **options: Any) -> Callable[..., Any]:
    """Return a function that begins to listen live, calls a method of it, and stops."""

    def call(**arguments: Any) -> Any:
        with taxel.live.Live(0, host="127.0.0.1", array=ARRAY, **options) as live:
            return getattr(live, name)(**arguments)

    return call


def panel(**arguments: Any) -> None:
    """Begin to show a recording, and stop."""
    taxel.live.Panel(**arguments).stop()


#: A valid call of every public function and class with arguments, by its full name.
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
        first_line_s=1.0,
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
    "taxel.live.Live.expect_version": plain(on_live("expect_version"), version=2),
    "taxel.live.Live.next": fresh(ended, "next", timeout=1.0),
    "taxel.live.Live.note": plain(on_live("note", record="live.mcap", overwrite=True), message="a note"),
    "taxel.live.Live.record": plain(
        on_live("record", record_later=True), path="live.mcap", compression="none", overwrite=True
    ),
    "taxel.live.Live.sample": plain(
        on_live("sample", record="live.mcap", overwrite=True, sources={"imu": "given,columns=a"}),
        name="imu",
        values=[1.0],
        arrived_ns=10**18,
    ),
    "taxel.live.Panel": plain(
        panel,
        shows="here_panel.mcap",
        control=None,
        folder=None,
        port=0,
        host="127.0.0.1",
        opens=taxel.open_all,
        options=TextOptions(rate_hz=100.0),
    ),
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
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.live.Summary": lambda: taxel.live.Live(0, host="127.0.0.1").stop(),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {
    "taxel.live.Live.source_address": "needs two boards each time; tried in tests/recording/test_sources.py",
    "taxel.live.Live.zero": "waits for events, each time anew; tried in tests/live/test_zero.py",
    "taxel.live.Panel.delta_intensity": "needs a panel each time, 0.25 s; tried in tests/panel/test_server.py",
    "taxel.live.Panel.listen": "needs a panel each time, 0.25 s; tried in tests/panel/test_board.py",
    "taxel.live.Panel.read_source": "needs a panel each time, 0.25 s; tried in tests/panel/test_page_source.py",
    "taxel.live.Panel.read_out": "needs a panel each time, 0.25 s; tried in tests/panel/test_windows.py",
    "taxel.live.RemoteBoard": "is a base of classes of such packages; tried in tests/live/test_remote.py",
    "taxel.live.RemoteBoard.begin": "is called by a Live; tried in tests/live/test_remote.py",
}
