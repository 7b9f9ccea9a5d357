"""Levels of an encoder from the training data, where those of the recipe are outside what the sensor reads."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.detect.examples import Example
from taxel.detect.loads import Stretch
from taxel.detect.recipe import Recipe
from taxel.encode import Encoder, LevelCrossing, ThresholdIzhikevich
from taxel.frames import Frames
from taxel.recording.analysis.rest import SHARE

#: A reading is of a loaded taxel from this share of the largest above rest on.
_LOADED_SHARE = 0.01
#: The standard deviation of noise is this many times the median step from frame to frame ...
_PER_STEP = 1.05
#: ... and of whole numbers at least that within a step; a loaded taxel reads so many of them above its rest.
_WITHIN_A_STEP, _TIMES_NOISE = 0.3, 5.0
#: Levels are within the loaded readings between these quantiles of them.
_LOW, _HIGH = 0.1, 0.9
#: Levels of the data are quantiles between these, each the same share above the one before: most are low, where touches
#: begin and end.
_FITTED = (0.01, 0.5)
#: So many levels must be within them.
LEAST_LEVELS = 2
#: A sensor has no noise at rest if at most this share of its unloaded readings differs from the least one.
_NOISY_SHARE = 0.01


class _Readings(NamedTuple):
    """The readings of loaded taxels of an example."""

    values: NDArray[np.float64]
    begins: float
    """The reading above which nine taxels in ten are loaded."""
    noisy: bool
    """Whether unloaded taxels have noise."""


class LoadedLevels(NamedTuple):
    """Hold how many of an encoder's levels are within what loaded taxels read, and levels that are."""

    within: int
    low: float
    """The 10th percentile of the readings of loaded taxels, in the sensor's unit."""
    high: float
    """The 90th percentile of these readings."""
    fitted: list[float]


def fit_levels(recipe: Recipe, examples: Sequence[Example], parts: Iterable[Stretch]) -> Recipe:
    """Return a recipe with the levels that parts of (checked) examples give it; itself where its levels are within.

    They are within if two of them or more are between the 10th and the 90th percentile of what loaded taxels read;
    where taxels at rest have no noise that could cross it, a lower one counts too. The levels of the data are as many
    as there were: where a taxel is loaded, and quantiles of the loaded readings up to their median.

    A taxel is loaded while it reads more than a hundredth of the largest reading above its rest, and more than its
    noise: five standard deviations of it. Its rest is that of the tare, else the least that it reads.
    """
    loaded = loaded_levels(recipe.encoder, examples, parts) if recipe.fit_levels else None
    if loaded is None or loaded.within >= LEAST_LEVELS:
        return recipe
    return replace(recipe, encoder=copy(recipe.encoder).set_params(levels=loaded.fitted), fit_levels=False)


def loaded_levels(encoder: Encoder, examples: Sequence[Example], parts: Iterable[Stretch]) -> LoadedLevels | None:
    """Return which levels are within what parts of (checked) examples read; None without levels or loads."""
    if not _has_levels(encoder):
        return None
    each = [_readings(examples[k], start, stop) for k, start, stop in parts]
    readings = np.concatenate([found.values for found in each if found is not None] or [np.empty(0)])
    if not len(readings):
        return None
    levels = np.asarray(encoder.levels, np.float64)  # type: ignore[attr-defined]
    low, high = (float(quantile) for quantile in np.quantile(readings, [_LOW, _HIGH]))
    noisy = any(found.noisy for found in each if found is not None)
    within = int(np.count_nonzero((levels >= low if noisy else levels > 0.0) & (levels <= high)))
    begins = max(found.begins for found in each if found is not None)
    quantiles = np.quantile(readings[readings >= begins], np.geomspace(*_FITTED, max(1, len(levels) - 1)))
    return LoadedLevels(within, low, high, sorted({float(f"{level:.3g}") for level in (begins, *quantiles)}))


def _has_levels(encoder: Encoder) -> bool:
    """Whether an encoder has levels in the sensor's unit."""
    return isinstance(encoder, ThresholdIzhikevich) or (
        isinstance(encoder, LevelCrossing) and encoder.running_range is None
    )


def _readings(example: Example, start: float, stop: float) -> _Readings | None:
    """Return what loaded taxels read in a part of an example; None of what has no frames, or nothing loaded."""
    source, tare = example.source, example.tare
    if not isinstance(source, Frames):
        return None
    source = source.between(start, stop)
    values = source.values.reshape(len(source), -1)
    if not np.isfinite(values).any():
        return None
    least = np.fmin.reduce(values, axis=0)
    rest = least if tare is None else np.where(np.isfinite(tare.rest.ravel()), tare.rest.ravel(), least)
    above, steps = values - rest, np.abs(np.diff(values, axis=0))
    most = float(np.nanmax(above))
    noise = float(np.nanmedian(steps)) * _PER_STEP if np.isfinite(steps).any() else 0.0
    if (values == np.rint(values)).all():
        noise = max(noise, _WITHIN_A_STEP)
    floor = max(_TIMES_NOISE * noise, _LOADED_SHARE * most)
    loaded, begins = above > floor, float(np.nanquantile(rest, SHARE)) + floor
    if not (values[loaded] >= begins).any():
        return None
    unloaded = ~loaded & np.isfinite(values)
    moved = np.count_nonzero(unloaded & (values != least))
    noisy = moved > _NOISY_SHARE * np.count_nonzero(unloaded)
    return _Readings(values[loaded].astype(np.float64), begins, bool(noisy))
