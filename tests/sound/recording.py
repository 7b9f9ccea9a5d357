"""Sound calls of recordings."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import taxel
from sound.things import ARRAY, EVENTS, FRAMES, TARE, Sound, plain
from taxel.recording.contents import Contents, source_from
from taxel.recording.sections import Origin

#: A recording of numbered frames, without times.
NUMBERED = Contents.single(source_from(FRAMES, Origin(Path("grasp"), "grasp", "icub"), untimed=True))

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.open": plain(
        taxel.open,
        path="here_events.npz",
        array=ARRAY,
        layout=None,
        pairing="direct",
        differences=False,
        topic=None,
        field=None,
        types=None,
        ros=None,
        limit=1 << 30,
        window_ms=None,
        bin=None,
        region=None,
        polarity=None,
    ),
    "taxel.open_all": plain(
        taxel.open_all,
        path="here_events.npz",
        array=ARRAY,
        layout=None,
        pairing="direct",
        differences=False,
        topic=None,
        field=None,
        types=None,
        ros=None,
        limit=1 << 30,
        window_ms=None,
        bin=None,
        region=None,
        polarity=None,
    ),
    "taxel.Recording.at_rate": plain(
        lambda **given: taxel.Recording(NUMBERED).at_rate(**given).frames(),
        rate_hz=50.0,
    ),
    "taxel.Recording.between": lambda: (taxel.open("here_events.npz").between, {"start": 0, "stop": 300}),
    "taxel.Recording.frames": lambda: (taxel.open("here_events.npz").frames, {"rate_hz": 1000.0}),
    "taxel.Recording.calibrated": lambda: (
        taxel.open("here_events.npz").calibrated,
        {"rate_hz": 1000.0, "rest": TARE},
    ),
    "taxel.cut": lambda: (
        taxel.cut,
        {
            "recording": taxel.open("here_events.npz"),
            "start_us": 0,
            "stop_us": 300,
            "columns": slice(0, 2),
            "rows": slice(0, 2),
            "label": None,
            "before_us": 10.0,
            "after_us": 10.0,
        },
    ),
    "taxel.merge": lambda: (
        taxel.merge,
        {"recordings": [taxel.open("here_events.npz")] * 2, "gap_us": 1000.0, "beside": True},
    ),
    "taxel.Recording.with_notes": lambda: (
        taxel.open("here_events.npz").with_notes,
        {"notes": [taxel.Note("heel", 100, 0)]},
    ),
    "taxel.convert": plain(
        taxel.convert, source=EVENTS, target="there.npz", frames_hz=1000.0, compression="none", overwrite=True
    ),
    "taxel.health": plain(taxel.health, recorded=EVENTS),
    "taxel.Note": lambda: (
        lambda **given: taxel.open("here_events.npz").with_notes([taxel.Note(**given)]),
        {
            "text": "heel",
            "t": 100,
            "at_ns": 0,
            "recording": "",
            "source": "",
            "replaces": 50,
            "others": (("comment", "slow"),),
        },
    ),
    "taxel.Recording": lambda: (taxel.Recording, {"contents": taxel.open("here_events.npz")._contents}),
    "taxel.Recording.on_clock": lambda: (taxel.open("here_clock.mcap").on_clock, {"name": "host"}),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.BoardChange": lambda: taxel.open("here_clock.mcap").board_changes[0],
    "taxel.Datagrams": lambda: taxel.open("here_clock.mcap").datagrams(),
    "taxel.Health": lambda: taxel.health(EVENTS),
    "taxel.Zeroing": lambda: taxel.open("here_clock.mcap").zeroings[0],
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
