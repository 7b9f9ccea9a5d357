"""The demo's readout, trained on seeds and places that the demo never plays."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.demo.script import TRAINING_SEED, Draw, left_to_rest, script
from taxel.detect import Readout
from taxel.encode import ContactArea
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.simulate import Contact, Scene, play, truth
from taxel.spikes import SpikeTrains, to_ms
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = ["train"]

#: One frame, ms: the step of silent rows and of the neuron's grid.
_FRAME_MS = to_ms(FRAME_US)

#: How much later than the event each neuron is trained to fire, ms.
_DELAY_MS = {"contact": 0.2, "lift": 0.5}

_REFRACTORY_MS = 15.0


class _Example(NamedTuple):
    area: SpikeTrains
    contacts: list[Contact]


def train(
    *, boards: int = 4, scenes: int = 4, draw: int = 0, progress: Callable[[str], object] = lambda _: None
) -> Readout:
    """Train contact and lift on scenes of balls that bounce and are caught, and as many with the ball left to rest.

    All fall on a level array, on columns of foam: the demo's slants and its bonded foam are new to the readout.

    Parameters
    ----------
    boards : int
        How many sensors are drawn for each of the two kinds.
    scenes : int
        On each of them; by default 16 scenes of each kind.
    draw : int
        Another draw of all of them.
    progress : function of str, optional
        Told what is being done.

    Notes
    -----
    The encoder is the contact area, without place, so that weights hold at other places. Contact: tau 0.5 ms, target =
    first input + 0.2 ms, weights 0 to 3 mV; lift: tau 3 ms, target = truth + 0.5 ms, weights 0 to 1 mV. Both run at 0.9
    of their thresholds, since the trained weights only just touch them (one input ends at 0.815 of the threshold).
    """
    examples = []
    for n in range(2 * boards):
        progress(f"playing training scenes, board {n + 1} of {2 * boards}")
        examples.append(_example(TRAINING_SEED + 1000 * draw + n, scenes, Scene.draw if n < boards else left_to_rest))
    areas = [example.area for example in examples]
    cones = {}
    for label, tau, bound in (("contact", 0.5, 3.0), ("lift", 3.0, 1.0)):
        progress(f"learning {label}")
        neuron = Neuron(tau=tau, refractory=_REFRACTORY_MS, step_ms=_FRAME_MS)
        cone = ConeR(neuron=neuron, lb=0.0, ub=bound)
        with warnings.catch_warnings():
            # Of slow lifts the foam's base loses the ball long before: their targets are out of reach, and known to be.
            warnings.filterwarnings("ignore", "no weights within")
            cones[label] = cone.fit(areas, [_targets(example, label) for example in examples])
    return Readout(ContactArea(), cones, delay_ms=_DELAY_MS, run_threshold=0.9)


def _example(seed: int, scenes: int, draw: Draw) -> _Example:
    acts = script(seed, scenes, draw=draw)
    events = play(acts, seed=seed).events
    start = events.markers[0][0]
    area = ContactArea(tare=Tare.take(events, stop_us=start)).encode(events)
    # What comes before the start marker is the tare's.
    return _Example(area.between(to_ms(start), area.stop), truth(acts)[0])


def _targets(example: _Example, label: str) -> NDArray[np.float64]:
    """Return when the neuron shall fire: for touches that the taxels told of, apart by the refractory time."""
    rises = example.area[0]
    targets: list[float] = []
    for contact in example.contacts:
        start, stop = to_ms(contact.start_us), to_ms(contact.stop_us)
        inputs = rises[(rises >= start - _FRAME_MS) & (rises < stop)]
        if not len(inputs):
            continue
        target = (float(inputs[0]) if label == "contact" else stop) + _DELAY_MS[label]
        if not targets or target > targets[-1] + _REFRACTORY_MS:
            targets.append(target)
    return np.array(targets)
