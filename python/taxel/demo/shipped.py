"""The readout that comes with the demo, and the labelled scenes that it is trained on: none that the demo plays."""

from __future__ import annotations

import warnings
from importlib.resources import as_file, files

import numpy as np
from numpy.typing import NDArray

from taxel._base.progress import Progress, reporting
from taxel.demo.script import TRAINING_SEED, left_to_rest, script
from taxel.detect import Example, Readout, Recipe, fit
from taxel.encode import ContactArea
from taxel.simulate import Contact, Scene, play, truth
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = ["recipe", "shipped", "trained"]


def shipped() -> Readout:
    """Return the readout that `taxel demo` plays with, as ``taxel demo --train`` wrote it."""
    return Readout.from_json(files("taxel.demo").joinpath("readout.json").read_text(encoding="utf-8"))


def recipe() -> Recipe:
    """Return the recipe that the shipped readout is trained by."""
    with as_file(files("taxel.demo").joinpath("recipe.toml")) as path:
        return Recipe.load(path)


def trained(*, boards: int = 4, scenes: int = 4, progress: Progress | None = None) -> Readout:
    """Train contact and lift on scenes of balls that bounce and are caught, and as many with the ball left to rest.

    All fall on a level array, on columns of foam: the demo's slants and its bonded foam are new to the readout.

    Parameters
    ----------
    boards : int
        How many sensors are drawn for each of the two kinds.
    scenes : int
        On each of them; by default 16 scenes of each kind.
    progress : function of (step, done, all), optional
        Called before each board.
    """
    labelled = []
    for n in range(2 * boards):
        reporting(progress)(f"playing training scenes, board {n + 1} of {2 * boards}", 0, 0)
        seed = TRAINING_SEED + n
        acts = script(seed, scenes, draw=Scene.draw if n < boards else left_to_rest)
        events = play(acts, seed=seed).events
        start = events.markers[0][0]
        area = ContactArea(tare=Tare.take(events, stop_us=start)).encode(events)
        # The time before the start marker is for the tare.
        area = area.between(to_ms(start), area.stop)
        labelled.append(Example(area, _labels(area, truth(acts)[0])))
    with warnings.catch_warnings():
        # The base of the foam loses the ball long before a slow lift ends: such events cannot be learnt.
        warnings.filterwarnings("ignore", ".* (cannot be learnt|come too late)")
        return fit(labelled, recipe(), progress=progress)


def _labels(area: SpikeTrains, contacts: list[Contact]) -> dict[str, NDArray[np.int64]]:
    """Return the labels of touches that made any taxel spike: the first spike, and when the force returns to 0 (us).

    If two are nearer than the refractory time, only the first is labelled.
    """
    rises = area[0]
    times: dict[str, list[float]] = {"contact": [], "lift": []}
    refractory = recipe().learner["refractory"]
    for contact in contacts:
        start, stop = to_ms(contact.start_us), to_ms(contact.stop_us)
        inputs = rises[(rises >= start - to_ms(FRAME_US)) & (rises < stop)]
        if not len(inputs):
            continue
        for label, t in (("contact", float(inputs[0])), ("lift", stop)):
            if not times[label] or t > times[label][-1] + refractory:
                times[label].append(t)
    return {label: np.rint(to_us(np.array(seconds))).astype(np.int64) for label, seconds in times.items()}
