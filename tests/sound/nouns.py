"""Sound calls of the nouns at the root."""

from collections.abc import Callable
from datetime import datetime
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, EVENTS, FOUND, FRAMES, TARE, TRAINS, Sound, method, plain

CLOCK = taxel.Clock(np.array([0, 1000]), np.array([5, 1_000_005]))

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.Array": plain(
        taxel.Array,
        rows=4,
        columns=4,
        pitch_mm=1.0,
        exists=np.ones((4, 4)),
        name="small",
        places=None,
        names=[f"n{k}" for k in range(16)],
    ),
    "taxel.Places": plain(taxel.Places, x=[0.0, 1.0], y=[0.0, 0.0], area=[1.0, 2.0], unit="mm"),
    "taxel.Array.fits": method(ARRAY, "fits", array=taxel.Array(4, 4)),
    "taxel.Array.index": method(ARRAY, "index", x=1, y=2),
    "taxel.Array.region": method(ARRAY, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.Events": plain(
        taxel.Events,
        t=[1],
        x=[1],
        y=[1],
        p=[True],
        array=ARRAY,
        intensity=[5],
        present=[True],
        repaired=[True],
        markers=[(0, True)],
    ),
    "taxel.Events.between": method(EVENTS, "between", start=0, stop=300),
    "taxel.Events.region": method(EVENTS, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.Events.from_numpy": plain(taxel.Events.from_numpy, records=EVENTS.to_numpy(), array=ARRAY),
    "taxel.Events.from_tonic": plain(taxel.Events.from_tonic, records=EVENTS.to_tonic(), array=ARRAY),
    "taxel.Events.from_faery": plain(taxel.Events.from_faery, records=EVENTS.to_faery(), array=ARRAY),
    "taxel.Frames": plain(taxel.Frames, values=np.ones((2, 4, 4)), t=[0, 5], unit="N", array=ARRAY),
    "taxel.Frames.area": method(FRAMES, "area", above=0.5),
    "taxel.Frames.loaded": method(FRAMES, "loaded", above=0.5),
    "taxel.Frames.centre": method(FRAMES, "centre", above=0.5),
    "taxel.Frames.from_events": plain(
        taxel.Frames.from_events, events=EVENTS, period_us=100, start=0, stop=500, held=np.ones((4, 4))
    ),
    "taxel.Frames.between": method(FRAMES, "between", start=0, stop=200),
    "taxel.Frames.region": method(FRAMES, "region", x=slice(0, 2), y=slice(0, 2)),
    "taxel.SpikeTrains": plain(
        taxel.SpikeTrains,
        times=[1.0, 2.0],
        offsets=[0, 1, 2],
        start=0.0,
        stop=5.0,
        values=[1.0, -1.0],
        kind="graded",
    ),
    "taxel.SpikeTrains.from_lists": plain(
        taxel.SpikeTrains.from_lists, times=[[1.0], []], start=0.0, stop=5.0, values=[[1.0], []], kind="signed"
    ),
    "taxel.SpikeTrains.side_by_side": plain(taxel.SpikeTrains.side_by_side, parts=[TRAINS, TRAINS]),
    "taxel.SpikeTrains.lasting": method(TRAINS, "lasting", stop=99.0),
    "taxel.SpikeTrains.between": method(TRAINS, "between", start=0.0, stop=2.0),
    "taxel.SpikeTrains.select": method(TRAINS, "select", trains=[1]),
    "taxel.SpikeTrains.delayed": method(TRAINS, "delayed", delays_ms=[0.0, 2.0]),
    "taxel.SpikeTrains.to_nwb": method(
        TRAINS, "to_nwb", path="trains.nwb", begun=datetime(2020, 1, 1), description="a walk", overwrite=True
    ),
    "taxel.SpikeTrains.from_nwb": plain(taxel.SpikeTrains.from_nwb, path="here.nwb", start=0.0, stop=30.0),
    "taxel.SpikeTrains.from_neo": plain(taxel.SpikeTrains.from_neo, trains=TRAINS.to_neo()),
    "taxel.SpikeTrains.save": method(TRAINS, "save", path="trains.npz", overwrite=True),
    "taxel.SpikeTrains.load": plain(taxel.SpikeTrains.load, path="here.npz"),
    "taxel.Detections": plain(
        taxel.Detections, label=["a"], t=[1], known=[2], slope=[0.5], reported=[3], repaired=[True]
    ),
    "taxel.Detections.between": method(FOUND, "between", start=0, stop=15),
    "taxel.Detections.from_list": plain(taxel.Detections.from_list, detections=[taxel.Detection("a", 5, 6)]),
    "taxel.Detections.from_numpy": plain(taxel.Detections.from_numpy, records=FOUND.to_numpy()),
    "taxel.Detections.from_neo": plain(taxel.Detections.from_neo, events=FOUND.to_neo()),
    "taxel.Detections.to_csv": method(FOUND, "to_csv", path="found.csv", overwrite=True),
    "taxel.Detections.from_csv": plain(taxel.Detections.from_csv, path="here.csv"),
    "taxel.Tare.off": method(TARE, "off", frames=FRAMES),
    "taxel.Tare.take": plain(taxel.Tare.take, x=FRAMES, start_us=0, stop_us=300, note="bench 2"),
    "taxel.Tare.from_json": plain(taxel.Tare.from_json, text=TARE.to_json()),
    "taxel.Tare.save": method(TARE, "save", path="tare.json", overwrite=True),
    "taxel.Tare.load": plain(taxel.Tare.load, path="here_tare.json"),
    "taxel.Labels": plain(taxel.Labels, path="here_labels.csv"),
    "taxel.Labels.named": lambda: (
        taxel.Labels("here_labels.csv").named,
        {"recording": "walk.mcap", "trial": "walk 1", "source": "left"},
    ),
    "taxel.Labels.times": lambda: (taxel.Labels("here_labels.csv").times, {"recording": taxel.open("here_events.npz")}),
    "taxel.Verdict.from_dict": plain(
        taxel.Verdict.from_dict, held={"status": "lost", "text": "LOST: 2 datagrams", "lost": {"lost_on_the_way": 2}}
    ),
    "taxel.Clock.host_ns": method(CLOCK, "host_ns", board_us=[500]),
    "taxel.Clock.board_us_at": method(CLOCK, "board_us_at", host_ns=[500_000]),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.Clock": lambda: CLOCK,
    "taxel.Detection": lambda: FOUND[0],
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
