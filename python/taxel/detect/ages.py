"""The age of a touch: in whole frames where a recording has frames, and when a touch reaches it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.array import Array
from taxel.detect.examples import Example, frame_ms
from taxel.detect.loads import Clock
from taxel.detect.recipe import Point, Recipe
from taxel.encode import Composite, Encoder
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains, to_ms, to_us

#: How long after a spike a neuron is trained to fire if the spike makes its potential jump, ms.
ACTS_AFTER_MS = to_ms(1.0)
#: Times that are nearer are the same, ms: stamps are whole us, and since 1970 resolved to a quarter of one.
_SAME_MS = 5e-4
#: A neuron that has fired is silent for that share of a frame at least: of stamps that are not regular two frames
#: may be in the time of one.
_SILENT_SHARE = 0.9
#: A kernel shorter than a frame, which stamps beside the grid would change, and which is silent between frames only
#: where its grid has points, becomes an exponential one as long as this share, ...
_TAU_SHARE = 0.25
#: ... with such a step of the grid: from a stamp to the next point of it the potential falls by less than a tenth.
_STEP_SHARE = 0.02
#: By which share of a frame an age of frames begins early.
_EARLY = 0.5


class Ages(NamedTuple):
    """The trains of the ages of a touch, one of which fires at every sample of it, and when each begins, ms."""

    trains: range
    begin_ms: tuple[float, ...]


def ages_of(encoder: Encoder, array: Array | None) -> Ages | None:
    """Return the trains of ages of an encoder, or of the first part of a composite one that has any."""
    first = 0
    for part in encoder._each():
        first += part.trains(array or Array(1, 1)) * (2 if part.signed else 1)
        ages = getattr(part, "ages_ms", None)
        if ages is not None:
            return Ages(range(first - len(ages), first), tuple(map(float, ages)))
    return None


def onsets(pattern: SpikeTrains, ages: Ages) -> NDArray[np.float64]:
    """Return when touches began, ms: the least age before its first spike after a pause, or after a greater age."""
    times = [pattern[n] for n in ages.trains]
    order = np.argsort(pooled := np.concatenate(times), kind="stable")
    pooled, age = pooled[order], np.repeat(np.arange(len(times)), [len(t) for t in times])[order]
    apart = np.diff(pooled)
    begins = np.ones(len(pooled), np.bool_)
    begins[1:] = (apart > 1.5 * apart.min(initial=np.inf)) | (np.diff(age) < 0)
    found: NDArray[np.float64] = pooled[begins & (age == 0)] - ages.begin_ms[0]
    return found


def later_us(pattern: SpikeTrains, ages: Ages, felt_ms: NDArray[np.float64], age_ms: float) -> NDArray[np.int64]:
    """Return how much later than at an age the first sample of each touch is that has it, us; 0 where none has.

    Parameters
    ----------
    pattern : SpikeTrains
    ages : Ages
        Of the encoder that made it.
    felt_ms : float64, shape (touches,), ms
        When the touches began.
    age_ms : float, ms
        One of the ages.
    """
    after = np.append(onsets(pattern, ages), np.inf)
    age = [round(to_us(begin)) for begin in ages.begin_ms].index(round(to_us(age_ms)))
    fired = np.append(pattern[ages.trains[age]], np.inf)
    first = fired[np.searchsorted(fired, felt_ms + age_ms - _SAME_MS)]
    same = first < after[np.searchsorted(after, felt_ms + _SAME_MS)]
    return np.asarray(np.rint(to_us(np.where(same, first - (felt_ms + age_ms), 0.0))), np.int64)


def silent_windows(
    pattern: SpikeTrains, ages: Ages, targets: NDArray[np.float64], neuron: Neuron
) -> NDArray[np.float64]:
    """Return windows, one a sample of a touch, in which a neuron must be silent, shape (windows, 2), ms.

    For a potential that jumps at a sample and falls until the next, which exceeds nothing anywhere else. Silence is not
    required at a target and in the refractory time after it.

    Parameters
    ----------
    pattern : SpikeTrains
    ages : Ages
        Of the encoder that made it.
    targets : float64, ascending, ms
    neuron : Neuron
        On a grid.
    """
    clock = np.sort(np.concatenate([pattern[n] for n in ages.trains]))
    last = np.append(-np.inf, targets)[np.searchsorted(targets, clock + ACTS_AFTER_MS + _SAME_MS)]
    clock = clock[clock - last >= neuron.refractory]
    return np.column_stack([clock, clock + neuron.step_ms]) + _SAME_MS


def in_frames(recipe: Recipe, examples: Sequence[Example], clocks: Sequence[Clock]) -> Recipe:
    """Return the recipe with the ages of a touch, and the delays at one, that the frames of (checked) examples show.

    A frame shows a touch at a whole number of frames after its onset, so each age and delay is rounded up to whole
    frames, and points to try whose delays are then those of a point before are left out. As stamps are not regular,
    each age begins half a frame early, and the age of a delay ends a frame later. The state of events is known at any
    time, so for events all that holds only where a frame lasts longer than a delay, and ages begin in time. If there
    are several examples, the longest frame counts. A recipe that names no neurons is trained as it is, and its delays
    are ages.

    Parameters
    ----------
    recipe : Recipe
    examples : sequence of Example
    clocks : sequence of Clock
        Of the examples: how long a frame of events lasts.
    """
    if not recipe.neurons:
        return recipe
    parameters = [{**recipe.learner, **neuron} for neuron in recipe.neurons.values()]
    delays = [_delay_ms(point) for point in parameters if _aged(recipe, point)]
    frames_ms = max(frame_ms(example.source) for example in examples)
    period_ms = frames_ms or max(to_ms(frame_us or 0.0) for frame_us, _ in clocks)
    if not delays or not period_ms or (not frames_ms and period_ms <= min(delays)):
        return recipe
    early = _EARLY if frames_ms else 0.0
    used: set[int] = set()

    def count(ms: float) -> int:
        return ceil(ms / period_ms - 1e-6)

    def begin_ms(frames: int) -> float:
        return max(0.0, to_ms(round(to_us((frames - early) * period_ms))))

    def framed(point: Point, seen: dict[int, float]) -> Point | None:
        merged = {**recipe.learner, **point.values}
        if not _aged(recipe, merged):
            return point
        frames = count(_delay_ms(merged))
        if seen.setdefault(frames, _delay_ms(merged)) != _delay_ms(merged):
            return None
        used.add(frames)
        refractory = max(float(merged.get("refractory", Neuron().refractory)), _SILENT_SHARE * period_ms)
        changed = {**point.values, "delay_ms": begin_ms(frames), "refractory": refractory}
        if frames_ms and float(merged.get("tau", Neuron().tau)) < period_ms:
            changed |= {"kernel": "exponential", "tau": _TAU_SHARE * period_ms, "step_ms": _STEP_SHARE * period_ms}
        return point._replace(values=changed)

    def each_framed(label: str) -> list[Point]:
        seen: dict[int, float] = {}
        return [found for point in recipe.points_of(label) if (found := framed(point, seen)) is not None]

    def encoder(part: Encoder) -> Encoder:
        ages = getattr(part, "ages_ms", None)
        if ages is None:
            return part
        counts = {count(age) for age in ages} | used | {number + 1 for number in used}
        return copy(part).set_params(ages_ms=[begin_ms(number) for number in sorted(counts)])

    points = {label: each_framed(label) for label in recipe.neurons}
    composite = recipe.encoder
    parts = {name: encoder(part) for name, part in composite.parts.items()} if isinstance(composite, Composite) else {}
    of_frames = replace(recipe, encoder=Composite(parts) if parts else encoder(composite), neurons={})
    return of_frames._with_points(points)


def _aged(recipe: Recipe, values: Mapping[str, Any]) -> bool:
    """Whether a neuron with these parameters receives ages of a touch."""
    return any(getattr(part, "ages_ms", None) is not None for part in recipe._received(values)._each())


def _delay_ms(values: Mapping[str, Any]) -> float:
    return float(values.get("delay_ms", 0.0))
