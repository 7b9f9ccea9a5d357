"""Sound calls of `taxel.plot`."""

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure

import taxel
from sound.things import EVENTS, FOUND, FRAMES, TRAINS, Sound, plain

#: Drawn on again and again; where it is None a new one is made, which pyplot keeps.
AXES = Figure().add_subplot()

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.plot.detections": plain(taxel.plot.detections, found=FOUND, ax=AXES),
    "taxel.plot.event_picture": plain(taxel.plot.event_picture, events=EVENTS, ax=AXES),
    "taxel.plot.health_map": plain(taxel.plot.health_map, health=taxel.health(EVENTS), ax=AXES),
    "taxel.plot.html": plain(taxel.plot.html, noun=TRAINS),
    "taxel.plot.overview": lambda: (
        taxel.plot.overview,
        {"recording": taxel.open("here_events.npz"), "figure": Figure()},
    ),
    "taxel.plot.pressure": lambda: (taxel.plot.pressure, {"frames": FRAMES, "above": 0.5, "figure": Figure()}),
    "taxel.plot.pressure_map": plain(taxel.plot.pressure_map, frames=FRAMES, at=200, ax=AXES),
    "taxel.plot.raster": plain(taxel.plot.raster, trains=TRAINS, ax=AXES),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
