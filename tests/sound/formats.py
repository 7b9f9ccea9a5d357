"""Sound calls of `taxel.formats`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import EVENTS, Sound, every, plain

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.formats.trials": every(taxel.formats.trials, path="pdb", format="gaitpdb"),
    "taxel.formats.Trial": plain(
        taxel.formats.Trial,
        name="walk 1",
        person="anna",
        recorded=EVENTS,
        truth={"contact": np.array([100])},
        source="a plate",
        foot="left",
        group="healthy",
        scored=(0, 400),
        series={"force": np.ones(3)},
        about={"speed": 1.2},
        timed=True,
        unread=("acceleration",),
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.formats.Format": lambda: taxel.formats.FORMATS["gaitpdb"],
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
