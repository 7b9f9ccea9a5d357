"""A noise floor above what noise requires, where the labels show that a sensor also reads what only comes near it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.detector import tare_text
from taxel.detect.examples import Example
from taxel.detect.floors import measured_floor
from taxel.detect.loads import Stretch, lacks_neighbours
from taxel.detect.recipe import Recipe
from taxel.encode import Composite, Encoder
from taxel.frames import Frames
from taxel.spikes import to_us

#: The floor may be so many times what noise requires ...
_RAISED = (2.0, 4.0)
#: ... if so many fewer labels and touches then lack each other, and that share of the labels.
_FEWER, _FEWER_SHARE = 3, 0.05


def fit_floor(recipe: Recipe, examples: Sequence[Example], parts: Iterable[Stretch]) -> Recipe:
    """Return a recipe whose measured noise floor is raised where labels show it; itself where they do not.

    A sensor may read what comes near before anything touches it. Touches of all that is above the noise then begin too
    early, end too late, or are several. The floor is what the noise requires, or two or four times that: where the
    fewest labels have no begin or end of a touch within `WINDOW_MS`, and the fewest touches no label.

    Parameters
    ----------
    recipe : Recipe
        With the floor of `measured_floor`; a floor that is stated stays.
    examples : sequence of Example, checked
    parts : iterable of (int, float, float)
        The parts of the examples whose labels are known: the example, and from when to when, us.
    """
    floor = measured_floor(examples)
    measured = [part for part in recipe.encoder._each() if getattr(part, "noise_floor", None) == floor]
    if floor is None or not measured or lacks_neighbours(examples) or any(e.tare is None for e in examples):
        return recipe
    # Where labels are not known, touches lack them.
    stretches = [part for part in parts if not examples[part[0]].unlabelled]
    labels = sum(np.count_nonzero((t >= a) & (t < b)) for k, a, b in stretches for t in examples[k].labels.values())
    alone = {times: sum(_alone(examples[k], times * floor, a, b) for k, a, b in stretches) for times in (1.0, *_RAISED)}
    best = min(alone, key=lambda times: alone[times])
    if alone[1.0] - alone[best] < max(_FEWER, _FEWER_SHARE * labels):
        return recipe

    def raised(part: Encoder) -> Encoder:
        return copy(part).set_params(noise_floor=best * floor) if part in measured else part

    encoder = recipe.encoder
    parts_of = {name: raised(part) for name, part in encoder.parts.items()} if isinstance(encoder, Composite) else {}
    return replace(recipe, encoder=Composite(parts_of) if parts_of else raised(encoder))


def _alone(example: Example, floor: float, start: float, stop: float) -> int:
    """Return how many labels of a part have no begin or end of a touch near, and how many touches have no label."""
    source = example.source
    assert isinstance(source, Frames)
    curve = _core.LoadCurve.of_frames("area", [], floor, source._parts(), None, tare_text(example.tare))
    begins, ends = (np.asarray(edge[0], np.int64) for edge in curve.edges(1.0, 0.5, 1, None, False))
    labels = np.sort(np.concatenate([*example.labels.values(), np.empty(0, np.int64)]))
    labels = labels[(labels >= start) & (labels < stop)]

    def near(times: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.bool_]:
        window = to_us(WINDOW_MS)
        found: NDArray[np.bool_] = np.searchsorted(others, times - window) < np.searchsorted(
            others, times + window, side="right"
        )
        return found

    count = min(len(begins), len(ends))
    begins, edges = begins[:count], np.sort(np.concatenate([begins, ends]))
    strays = ~near(begins, labels) & ~near(ends[:count], labels) & (begins >= start) & (begins < stop)
    return int(np.count_nonzero(~near(labels, edges)) + np.count_nonzero(strays))
