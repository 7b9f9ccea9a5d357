"""Two pictures of a report: nearest detections beside their labels over time, and loads beside the training's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import pyplot as plt

from taxel._base.messages import escaped
from taxel.detect import Outcome, PlainRule, Readout, drift
from taxel.detect.examples import check_examples
from taxel.report.svg import DETECTED, TRUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Recordings whose labels are drawn, and how far a label and its nearest detection are drawn apart at most, ms.
_MOST, _FAR_MS = 4, 2000.0
#: What is measured of loads, with the sensor's unit.
_NAMES = {
    "sum": "sum, {}",
    "taxels": "loaded taxels",
    "lasts_ms": "lasts, ms",
    "apart_ms": "from begin to begin, ms",
}


def nearest(listened: Sequence[Outcome], labels: Sequence[str]) -> Figure | None:
    """Draw each label's nearest detection minus it over time: an offset, a jump or another rate is seen at once."""
    shown = [outcome for outcome in listened if outcome.score is not None and outcome.score.events][:_MOST]
    if not any(len(outcome.found) for outcome in shown):
        return None
    figure, axes = plt.subplots(
        len(shown), 1, figsize=(9.0, 0.6 + 1.6 * len(shown)), layout="constrained", squeeze=False
    )
    for axis, outcome in zip(axes[:, 0], shown, strict=True):
        for k, label in enumerate(labels):
            times, found = np.sort(np.asarray(outcome.example.labels.get(label, ()), np.int64)), outcome.found[label].t
            if not len(times) or not len(found):
                continue
            apart_ms = (found[None, :] - times[:, None]) / 1e3
            least_ms = apart_ms[np.arange(len(times)), np.abs(apart_ms).argmin(axis=1)]
            near = np.abs(least_ms) <= _FAR_MS
            seconds = (times[near] - outcome.begin_us) / 1e6
            colour = DETECTED if k % 2 == 0 else TRUE
            axis.plot(seconds, least_ms[near], "o^sD"[k % 4], markersize=3, color=colour, label=escaped(label))
        axis.axhline(0, color="#999999", linewidth=0.8)
        axis.set_title(escaped(outcome.name[-32:]), loc="left", fontsize="small")
        axis.set_ylabel("detection minus label, ms")
        if axis.get_legend_handles_labels()[0]:
            axis.legend(loc="upper right", fontsize="small")
    axes[-1, 0].set_xlabel("time, s")
    return figure


def beside_training(readout: Readout | PlainRule, listened: Sequence[Outcome]) -> Figure | None:
    """Draw the share of loads up to each value of a feature, a curve of the training and one of the recordings."""
    data: Mapping[str, Any] = readout._parts.get("training") or {}
    examples = check_examples([outcome.example for outcome in listened])
    features = {
        name: np.sort(values) for name, values in drift.of_loads(examples, data.get("noise_floor", 0.0)).items()
    }
    shown = [name for name in data.get("loads", {}) if len(features.get(name, ()))]
    if not shown:
        return None
    figure, axes = plt.subplots(2, 3, figsize=(9.0, 4.0), layout="constrained")
    for axis, name in zip(axes.ravel(), shown, strict=False):
        then = np.asarray(data["loads"][name]["values"])
        axis.plot(then, np.linspace(0.0, 1.0, len(then)), color=TRUE, label="training")
        here = features[name]
        axis.step(here, np.arange(1, len(here) + 1) / len(here), where="post", color=DETECTED, label="here")
        axis.set_xlabel(_NAMES[name].format(escaped(readout.unit or "")))
    for axis in axes.ravel()[len(shown) :]:
        axis.set_axis_off()
    axes[0, 0].set_ylabel("share")
    axes[0, 0].legend(fontsize="small")
    return figure
