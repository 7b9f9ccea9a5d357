"""What was measured of loads, in a training and in a recording beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import three_digits
from taxel.detect.examples import Example
from taxel.detect.floors import floor_of
from taxel.detect.loads import touches
from taxel.detect.scoring import Score

#: The quantiles of a feature that are kept.
_SHARES = np.linspace(0.0, 1.0, 41)
#: Of fewer loads nothing is said.
_LEAST = 5
#: The Kolmogorov-Smirnov distance that chance exceeds once in a thousand times, by the numbers of values; and the
#: ratio of the medians: features differ that are beyond both.
_DISTANCE, _RATIO = 1.95, 0.5

_Values = NDArray[np.float64]


def of_loads(examples: Sequence[Example], noise_floor: float) -> dict[str, _Values]:
    """Return features of loads by name: a value a load, of the time apart one fewer.

    Parameters
    ----------
    examples : sequence of Example, checked
        Nothing is known where one has no tare, or is of spike trains.
    noise_floor : float, in the sensor's unit
        By which loads are measured.

    Returns
    -------
    mapping of str to float64, shape (values,)
        ``sum`` above rest, in the sensor's unit; ``taxels`` that are loaded;
        ``lasts_ms``; ``apart_ms``, from begin to begin.
    """
    found = touches(examples, noise_floor)
    if found is None:
        return {}
    loads, *edges = found
    features: dict[str, list[_Values]] = {}
    for k in range(len(examples)):
        here = loads.windows([(k, -np.inf, np.inf)])
        begins, ends = (np.sort(edge.between(here).t) for edge in edges)
        # The first load may have begun before the recording, and the last may not end.
        ends = ends[np.searchsorted(ends, begins[0]) :] if len(begins) else begins
        begins = begins[: len(ends)]
        measured = {"sum": "load", "taxels": "area"}
        of_example = {name: loads.largest(quantity, begins, ends) for name, quantity in measured.items()}
        of_example |= {"lasts_ms": (ends[: len(begins)] - begins) / 1e3, "apart_ms": np.diff(begins) / 1e3}
        for name, values in of_example.items():
            features.setdefault(name, []).append(np.asarray(values, np.float64))
    return {name: np.concatenate(values) for name, values in features.items()}


def training_data(
    examples: Sequence[Example], scored: Score, sender: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return what a readout's file keeps of its training: quantiles of loads, and how late detections were.

    Parameters
    ----------
    examples : sequence of Example, checked
    scored : Score
        Of the detector in its training data, or of folds of them.
    sender : mapping, optional
        What sent them, as `taxel.detect.board.of_training` returns it.
    """
    board = None if sender is None else sender["board"]
    noise_floor = max(floor_of(examples), 0.0 if board is None else float(board["noise_floor"]))
    return {
        "noise_floor": noise_floor,
        "error_ms": error_ms(scored),
        "loads": {
            name: {"count": len(values), "values": np.quantile(values, _SHARES).tolist()}
            for name, values in of_loads(examples, noise_floor).items()
            if len(values)
        },
    } | dict(sender or {})


def error_ms(scored: Score) -> dict[str, float]:
    """Return by how much the detections of each label are late, ms, the median; none of a label without any."""
    return {label: float(part.error.median) for label, part in scored.by_label.items() if part.found}


def lines(data: Mapping[str, Any], features: Mapping[str, _Values]) -> list[str]:
    """Return by how much features of loads differ from those of a training, as one line; none where they do not.

    Parameters
    ----------
    data : mapping
        As of `training_data`.
    features : mapping of str to float64
        As of `of_loads`, by the same noise floor.
    """
    differing = []
    for name, then in data.get("loads", {}).items():
        values = features.get(name, np.empty(0))
        if min(len(values), then["count"]) < _LEAST:
            continue
        medians = float(np.median(values)), float(np.median(then["values"]))
        critical = _DISTANCE * np.sqrt(1.0 / len(values) + 1.0 / then["count"])
        if _distance(values, np.asarray(then["values"])) > critical and min(medians) <= _RATIO * max(medians):
            here, there = map(three_digits, medians)
            differing.append(f"{name} {here}, in training {there}")
    return [f"loads (median): {'; '.join(differing)}"] if differing else []


def _distance(values: _Values, quantiles: _Values) -> float:
    """Return the Kolmogorov-Smirnov distance of values from a distribution of which quantiles are known."""
    points = np.sort(np.concatenate([values, quantiles]))
    here = np.searchsorted(np.sort(values), points, side="right") / len(values)
    below, above = (np.searchsorted(quantiles, points, side=side) for side in ("left", "right"))
    then = np.interp(points, quantiles, np.linspace(0.0, 1.0, len(quantiles)))
    # Where several quantiles are one value, the distribution jumps to the last of them.
    then = np.where(above > below, (above - 1) / (len(quantiles) - 1), then)
    return float(np.max(np.abs(here - then)))
