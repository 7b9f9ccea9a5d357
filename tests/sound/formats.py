"""Sound calls of `taxel.formats`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import EVENTS, Sound, every, plain

#: A sound call of everything public that takes anything, by its full name.
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
    ),
}

#: How a call returns one of each type that taxel alone makes.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.formats.Format": lambda: taxel.formats.FORMATS["gaitpdb"],
}

#: What is not tried, and why.
LEFT_OUT: dict[str, str] = {}
