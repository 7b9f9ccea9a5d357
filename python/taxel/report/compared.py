"""A picture of a report: nearest detections beside their labels over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import pyplot as plt

from taxel._base.messages import escaped
from taxel.detect import Outcome
from taxel.report.svg import DETECTED, TRUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Recordings whose labels are drawn, and how far a label and its nearest detection are drawn apart at most, ms.
_MOST, _FAR_MS = 4, 2000.0


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
