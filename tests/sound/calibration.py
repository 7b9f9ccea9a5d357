"""Sound calls of `taxel.calibration`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, FRAMES, TARE, Sound, method, plain

LAID = taxel.Load(FRAMES, 9.81)
CALIBRATION = taxel.Calibration.table(ARRAY, [5.0, 50.0], [1.0, 9.0], unit="N")
CALIBRATION_HOW = {"gain": 1.0, "rest": TARE, "floor": 0.5, "date": "2026-11-21", "note": "bench 2"}

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.Calibration.law": plain(
        taxel.Calibration.law, array=ARRAY, ramp=150.0, sensor={"exponent": 0.8}, unit="N", **CALIBRATION_HOW
    ),
    "taxel.Calibration.table": plain(
        taxel.Calibration.table,
        array=ARRAY,
        readings=[5.0, 50.0],
        values=[1.0, 9.0],
        unit="kPa",
        reading_unit="counts",
        **CALIBRATION_HOW,
    ),
    "taxel.Calibration.fit": plain(
        taxel.Calibration.fit,
        loads=[LAID],
        unit="N",
        start=CALIBRATION,
        exponent=None,
        each=False,
        rest=None,
        floor=0.5,
        date="2026-11-21",
        note="bench 2",
    ),
    "taxel.Calibration.apply": method(CALIBRATION, "apply", frames=FRAMES, rest=TARE),
    "taxel.Calibration.readings": method(
        CALIBRATION,
        "readings",
        frames=taxel.Frames(np.ones((3, 4, 4)), [0, 192, 384], unit="N", array=ARRAY),
        rest=TARE,
    ),
    "taxel.Calibration.from_json": plain(taxel.Calibration.from_json, text=CALIBRATION.to_json()),
    "taxel.Calibration.save": method(CALIBRATION, "save", path="calibration.json", overwrite=True),
    "taxel.Calibration.load": plain(taxel.Calibration.load, path="here_calibration.json"),
    "taxel.Calibration.beside": plain(taxel.Calibration.beside, recording="here_events.npz"),
    "taxel.Load": plain(
        lambda **given: taxel.Calibration.fit([taxel.Load(**given)]), frames=FRAMES, load=9.81, unit="N", taxel=(0, 0)
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
