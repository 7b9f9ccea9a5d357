"""Pictures of one touch, with which a report begins: maps of its load; events, load and data rate over time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import pyplot as plt

from taxel._base.messages import escaped
from taxel.detect import Outcome
from taxel.events import Events
from taxel.frames import Frames
from taxel.plot import pressure_map
from taxel.plot.nouns import OFF, ON
from taxel.recorded import recorded
from taxel.report.svg import DETECTED, INK, TRUE
from taxel.spikes import to_ms
from taxel.wire import FRAME_US

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

#: Before and after a touch are drawn so long, as a share of it.
_AROUND = 0.25
#: Bits on version 1 of the wire: an event is a word of its change and one of its intensity, a value in a frame has ten.
_EVENT_BITS, _VALUE_BITS = 80, 10
_BIN_US = 1000
#: So long after the first contact, and before the last, something is felt.
_FELT_US = 1000


def of_touch(outcome: Outcome, start_us: float, stop_us: float) -> Iterator[Figure]:
    """Yield maps near the begin, at the largest load and near the end of a touch, then events, load and data rate.

    Parameters
    ----------
    outcome : Outcome
        Of events with intensities, and a tare.
    start_us, stop_us : float, us
        The touch, by the board's clock.

    Raises
    ------
    ProblemError : other sources, or events without intensities
    """
    events, tare = recorded(outcome.example.source), outcome.example.tare
    assert isinstance(events, Events)
    assert tare is not None
    around = int(_AROUND * (stop_us - start_us))
    begin, end = int(start_us) - around, int(stop_us) + around
    frames = tare.off(Frames.from_events(events.between(events.t.min(), end), int(FRAME_US), begin, end))
    total = frames.total()
    deepest = int(frames.t[total.argmax()])
    moments = (
        ("1 ms after contact", start_us + _FELT_US),
        ("deepest", deepest),
        ("1 ms before lift", stop_us - _FELT_US),
    )
    for name, at in moments:
        figure, axis = plt.subplots(figsize=(2.7, 2.5), layout="constrained")
        pressure_map(frames, at=int(at), ax=axis)
        axis.set_title(f"{name}\n{to_ms(at):.1f} ms", fontsize=8)
        yield figure
    shown = events.between(begin, end)
    figure, (where, load, rate) = plt.subplots(
        3, 1, figsize=(6.0, 5.4), height_ratios=(2, 1.4, 1.2), sharex=True, layout="constrained"
    )
    taxel = shown.y.astype(np.int64) * shown.array.columns + shown.x
    for rising, color, name in ((True, ON, "rises"), (False, OFF, "falls")):
        where.scatter(to_ms(shown.t[shown.p == rising]), taxel[shown.p == rising], 3, color, linewidths=0, label=name)
    where.set_ylabel("taxel")
    where.legend(loc="upper right", fontsize="small", markerscale=3)
    load.plot(to_ms(frames.t), total, color=INK, linewidth=1)
    load.set_ylabel(escaped(f"sum, {frames.unit}"))
    true = np.concatenate([np.asarray(times, np.float64) for times in outcome.example.labels.values()])
    middle = (begin + end) / 2
    marked(load, to_ms(outcome.found.t), to_ms(true), to_ms(middle), to_ms(end - middle), origin=0.0)
    load.legend(fontsize="small")
    edges = np.arange(begin, end + _BIN_US, _BIN_US)
    sent = np.histogram(shown.t, edges)[0] * _EVENT_BITS / _BIN_US
    rate.stairs(sent, to_ms(edges), color=INK, label="events")
    of_frames = frames.values[0].size * _VALUE_BITS / FRAME_US
    rate.axhline(of_frames, color=TRUE, linestyle="--", label="frames")
    rate.set(yscale="symlog", ylabel="Mbit/s", xlabel="board time, ms", xlim=(to_ms(begin), to_ms(end)), ylim=(0, None))
    rate.legend(loc="center right", fontsize="small")
    yield figure


def marked(
    axis: Axes, found: NDArray[np.float64], true: NDArray[np.float64], at: float, reach: float, origin: float
) -> None:
    """Draw detections and labels (ms) within `reach` of `at` as lines, at their distance from an origin."""
    for title, times, color, style in (("detected", found, DETECTED, "-"), ("true", true, TRUE, "--")):
        for k, each in enumerate(times[np.abs(times - at) < reach]):
            axis.axvline(
                each - origin,
                color=color,
                linewidth=1.2,
                linestyle=style,
                label=None if k else title,
            )
