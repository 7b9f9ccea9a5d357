"""Train the readout that comes with the demo: `python tools/demo_readout.py python/taxel/demo/readout.json`.

Contact and lift are trained on scenes of balls that bounce and are caught, and as many with the ball left to rest: none
that the demo plays. All fall on a level array, on columns of foam: the demo's slants and its bonded foam are new to the
readout.
"""

import sys
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.demo.script import TRAINING_SEED, left_to_rest, script
from taxel.detect import Example, Recipe, fit
from taxel.encode import ContactArea
from taxel.simulate import Contact, Scene, play, truth
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US

#: How many boards are drawn for each of the two kinds of scenes, and how many scenes each plays.
BOARDS, SCENES = 4, 4
RECIPE = Recipe.load(Path(__file__).with_suffix(".toml"))


def labels(area: SpikeTrains, contacts: list[Contact]) -> dict[str, NDArray[np.int64]]:
    """Return the labels of touches that made any taxel spike: the first spike, and when the force returns to 0 (us).

    If two are nearer than the refractory time, only the first is labelled.
    """
    rises = area[0]
    times: dict[str, list[float]] = {"contact": [], "lift": []}
    for contact in contacts:
        start, stop = to_ms(contact.start_us), to_ms(contact.stop_us)
        inputs = rises[(rises >= start - to_ms(FRAME_US)) & (rises < stop)]
        if not len(inputs):
            continue
        for label, t in (("contact", float(inputs[0])), ("lift", stop)):
            if not times[label] or t > times[label][-1] + RECIPE.learner["refractory"]:
                times[label].append(t)
    return {label: np.rint(to_us(np.array(seconds))).astype(np.int64) for label, seconds in times.items()}


examples = []
for n in range(2 * BOARDS):
    acts = script(TRAINING_SEED + n, SCENES, draw=Scene.draw if n < BOARDS else left_to_rest)
    events = play(acts, seed=TRAINING_SEED + n).events
    start = events.markers[0][0]
    area = ContactArea(tare=Tare.take(events, stop_us=start)).encode(events)
    # The time before the start marker is for the tare.
    area = area.between(to_ms(start), area.stop)
    examples.append(Example(area, labels(area, truth(acts)[0])))
with warnings.catch_warnings():
    # The base of the foam loses the ball long before a slow lift ends: such events cannot be learnt.
    warnings.filterwarnings("ignore", ".* (cannot be learnt|come too late)")
    fit(examples, RECIPE).save(sys.argv[1], overwrite=True)
