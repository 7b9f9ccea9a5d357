"""The report's pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel.demo.evaluation import Evaluation
from taxel.demo.judging import LABELS, Judged
from taxel.events import Events
from taxel.report.svg import INK
from taxel.simulate import Contact
from taxel.spikes import to_ms, to_us
from taxel.wire import FRAME_US

__all__ = ["close_up", "delay_split", "delays_by_class", "maps", "noise", "rates", "scene_picture"]

#: How many taxels of a side a map shows.
_CROP = 28

#: Colours of truth, contact, lift, and what is less important.
_TRUE, _COLOURS, _QUIET = "#e8b04b", {"contact": "#b5423c", "lift": "#2f6690"}, "#8a8a8a"


def _figure(rows: int, columns: int, size: tuple[float, float], **kwargs: Any) -> tuple[Figure, Any]:
    return plt.subplots(rows, columns, figsize=size, layout="constrained", squeeze=False, **kwargs)


def scene_picture(evaluation: Evaluation, start_us: float, stop_us: float) -> Figure:
    """Draw force with truth, both potentials and the detections, from one time to another."""
    figure, axes = _figure(3, 1, (9.5, 5.4), sharex=True, height_ratios=[2, 1, 1])
    first, last = int(start_us / FRAME_US), int(stop_us / FRAME_US)
    t = np.arange(first, last) * FRAME_US * 1e-6
    top = axes[0, 0]
    # Presses of half a newton and impacts of twenty in one picture.
    top.set_yscale("function", functions=(lambda v: np.sqrt(np.maximum(v, 0.0)), np.square))
    top.plot(t, evaluation.force_n[first:last], color=INK, linewidth=1.2, label="force on the foam")
    top.set(ylabel="force (N, root scale)", title="Force on the foam")
    shown = [c for c in evaluation.contacts if c.start_us < stop_us and c.stop_us > start_us]
    for axis in axes[:, 0]:
        for contact in shown:
            edges = contact.start_us * 1e-6, contact.stop_us * 1e-6
            axis.axvspan(*edges, color=_TRUE, alpha=0.3, linewidth=0, label="really touches" * (contact is shown[0]))
    times = to_ms(np.arange(start_us, stop_us, FRAME_US))
    for axis, label in zip(axes[1:, 0], LABELS, strict=True):
        colour = _COLOURS[label]
        threshold = evaluation.readout.neurons[label].neuron.theta_0 * evaluation.readout.run_threshold
        axis.plot(times * 1e-3, evaluation.potential(label, times), color=colour, linewidth=0.9, label="potential")
        axis.axhline(threshold, color=_QUIET, linewidth=0.8, linestyle="--", label="its threshold")
        detections = evaluation.detections[label].between(start_us, stop_us)
        for place in (axis, top):
            for k, at in enumerate(detections.known):
                name = f"{label} detected" * (k == 0)
                place.axvline(at * 1e-6, color=colour, linewidth=0.9, alpha=0.9, label=name)
        axis.set(ylabel="potential (mV)", title=f"Potential of the neuron for {label}")
        axis.legend()
    top.legend()
    axes[2, 0].set(xlabel="board time (s)", xlim=(start_us * 1e-6, stop_us * 1e-6))
    return figure


def close_up(evaluation: Evaluation, contact: Contact, reach_us: float = 5_000.0) -> Figure:
    """Draw force, every event and the contact area's spikes around a touch and around its end."""
    figure, axes = _figure(3, 2, (9.5, 6.2), sharex="col", height_ratios=[1, 2.2, 1.4])
    for column, (label, at) in enumerate((("contact", contact.start_us), ("lift", contact.stop_us))):
        begin, end = at - reach_us, at + reach_us
        frames = np.arange(max(0, int(begin / FRAME_US)), min(len(evaluation.force_n), int(end / FRAME_US) + 1))
        force, raster, area = axes[:, column]
        force.plot(to_ms(frames * FRAME_US - at), evaluation.force_n[frames], color=INK, linewidth=1.2)
        force.set(ylabel="force (N)", title=f"{label}, {contact.kind}, {contact.speed_m_s:.2f} m/s")
        near = evaluation.events.between(begin, end)
        index = near.y.astype(int) * near.array.columns + near.x
        for rising, colour in ((True, "#c44e52"), (False, "#4c72b0")):
            mine = near.p == rising
            name = f"{'more' if rising else 'less'} pressure ({int(mine.sum())})"
            raster.plot(to_ms(near.t[mine] - at), index[mine], ".", color=colour, markersize=2.5, label=name)
        raster.set(ylabel="taxel (row by row)")
        spikes = evaluation.area.between(to_ms(begin), to_ms(end))
        for train in range(len(spikes)):
            colour = _COLOURS["contact"] if train < 5 else _COLOURS["lift"]
            ms = spikes[train] - to_ms(at)
            area.plot(ms, np.full(len(ms), train), "|", color=colour, markersize=9)
        names = [f"{sign} {n}" for sign in ("≥", "<") for n in (2, 4, 8, 16, 32)]
        area.set(yticks=range(10), yticklabels=names, ylim=(-0.7, 9.7), xlabel="from the true moment (ms)")
        area.set_ylabel("taxels loaded")
        for axis in (force, raster, area):
            axis.axvline(0.0, color=_TRUE, linewidth=2.0, zorder=0, label="true moment")
            for k, known in enumerate(evaluation.detections[label].between(begin, end).known):
                name = f"{label} known" * (k == 0)
                axis.axvline(to_ms(known - at), color=_COLOURS[label], linewidth=1.0, label=name)
            axis.legend()
    return figure


def maps(evaluation: Evaluation, contact: Contact) -> Figure:
    """Draw what the host holds of the taxels, above their rest, around a touch and where it is."""
    moments = (-0.4, 0.4, 1.0, 3.0, 8.0, 1e-3 * (contact.stop_us - contact.start_us) + 1.0)
    figure, axes = _figure(1, len(moments), (9.5, 1.9))
    rest = np.nan_to_num(evaluation.tare.rest)
    held = [_held(evaluation.events, contact.start_us + to_us(after), rest) for after in moments]
    touched = evaluation.events.between(contact.start_us, contact.start_us + 3_000.0)
    middle = [float(np.median(v)) if len(v) else 31.5 for v in (touched.y, touched.x)]
    top, left = (int(np.clip(m - _CROP / 2, 0, n - _CROP)) for m, n in zip(middle, rest.shape, strict=True))
    seen = [h[top : top + _CROP, left : left + _CROP] for h in held]
    most = max(1.0, *(float(s.max()) for s in seen))
    image = None
    for axis, frame, after in zip(axes[0], seen, moments, strict=True):
        edges = (left - 0.5, left + _CROP - 0.5, top + _CROP - 0.5, top - 0.5)
        image = axis.imshow(frame, cmap="magma", vmin=0.0, vmax=most, interpolation="nearest", extent=edges)
        axis.set(title=f"{after:+.1f} ms", xlabel="column", ylabel="row")
    if image is not None:
        figure.colorbar(image, ax=list(axes[0]), label="ticks above rest", shrink=0.9)
    return figure


def _held(events: Events, until_us: float, rest: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ticks above rest as the host holds them; a taxel without events since the start is at rest."""
    held = rest.copy()
    before = events.t <= until_us
    if events.intensity is not None:
        # The last of equal places stays.
        held[events.y[before], events.x[before]] = events.intensity[before]
    return held - rest


def rates(evaluation: Evaluation, bits: int = 9) -> Figure:
    """Draw the data rate of impacts as events beside that of frames, as figure 5.14."""
    impacts = [c for c in evaluation.contacts if c.kind == "first"]
    spans = [evaluation.events.between(c.start_us - 500.0, c.stop_us + 1_000.0) for c in impacts]
    each = np.array([len(s) / max(1, int(s.t[-1] - s.t[0])) * 1e6 for s in spans if len(s) > 1])
    figure, axes = _figure(1, 1, (9.5, 2.6))
    axis = axes[0, 0]
    bins = np.geomspace(1e3, 1e9, 121)
    if len(each):
        axis.hist(
            each * bits, bins, color=_COLOURS["contact"], label=f"events in a first impact, {bits} bits each (as 5.14)"
        )
        axis.hist(each * 80, bins, color=_COLOURS["lift"], label="the same on the wire, 80 bits with intensity")
    whole = len(evaluation.events) / max(1.0, evaluation.stop_us - evaluation.start_us) * 1e6
    taxels, hz = evaluation.events.array.rows * evaluation.events.array.columns, 1e6 / FRAME_US
    for value, colour, name in (
        (whole * 80, "#4b8f4b", "the whole play on the wire"),
        (taxels * hz * 2, _QUIET, "frames, 2 bits a taxel"),
        (taxels * hz * 10, INK, "frames, 10 bits a taxel"),
    ):
        axis.axvline(value, color=colour, linewidth=2.0, label=f"{name}: {_bits(value)}")
    axis.set(xscale="log", xlabel="bits a second (log scale)", ylabel="impacts", xlim=(1e4, 1e9))
    axis.legend()
    return figure


def _bits(value: float) -> str:
    return f"{value / 1e6:.3g} Mbit/s" if value >= 1e6 else f"{value / 1e3:.3g} kbit/s"


def delays_by_class(judged: Judged, plain: Judged) -> Figure:
    """Draw the delay of each touch's detection by class; neuron above, plain rule below."""
    figure, axes = _figure(1, 2, (9.5, 3.6), sharey=True)
    names = [row.name for row in judged.rows if row.label == "contact" and row.touches]
    jitter = np.random.default_rng(1)
    for axis, label in zip(axes[0], LABELS, strict=True):
        for place, name in enumerate(names):
            for who, shift, colour in ((judged, 0.17, _COLOURS[label]), (plain, -0.17, _QUIET)):
                delays = who.row(name, label).delays_ms
                height = place + shift + jitter.uniform(-0.08, 0.08, len(delays))
                kind = ("neuron" if who is judged else "plain rule") * (place == 0)
                axis.plot(delays, height, ".", color=colour, markersize=3.5, label=kind)
        axis.axvline(0.0, color=_TRUE, linewidth=2.0, zorder=0, label="true moment")
        axis.set(xscale="symlog", xlabel="known minus true (ms)", title=label)
        axis.legend()
        axis.set_xticks([-30, -10, -3, -1, 0, 1, 3, 10, 30], ["-30", "-10", "-3", "-1", "0", "1", "3", "10", "30"])
        axis.minorticks_off()
    axes[0, 0].set_yticks(range(len(names)), names)
    # Half a class of room at either end, from the first class at the top.
    axes[0, 0].set_ylim(len(names) - 0.5, -0.5)
    return figure


def delay_split(parts: Mapping[str, Mapping[str, float]]) -> Figure:
    """Draw the medians of what a delay is made of, one bar a class and label."""
    figure, axes = _figure(1, 1, (9.5, 0.9 + 0.34 * max(1, len(parts))))
    axis = axes[0, 0]
    colours = {"physics": _TRUE, "kernel": "#b5423c", "frame": "#2f6690", "host": "#4b8f4b"}
    labelled: set[str] = set()
    for place, split in enumerate(parts.values()):
        left = 0.0
        for name, value in split.items():
            # A bar of no width would have the axis end where it stands, and clip the others.
            if value == 0.0:
                continue
            # A part below 0 (the base loses the ball before it leaves) is drawn thin, over the part that starts there.
            shape = {"height": 0.7} if value >= 0 else {"height": 0.25, "zorder": 3}
            axis.barh(place, value, left=left, color=colours[name], label=None if name in labelled else name, **shape)
            labelled.add(name)
            left += value
    axis.set_yticks(range(len(parts)), list(parts))
    axis.invert_yaxis()
    axis.set(xlabel="part of the delay (ms, medians)")
    axis.legend()
    return figure


def noise(evaluation: Evaluation) -> Figure:
    """Draw a stretch in which nothing touches: events a second, and detections."""
    figure, axes = _figure(1, 1, (9.5, 1.8))
    axis: Axes = axes[0, 0]
    seconds = np.arange(0.0, (evaluation.stop_us - evaluation.start_us) * 1e-6, 1.0)
    each = np.histogram((evaluation.events.t - evaluation.start_us) * 1e-6, np.append(seconds, seconds[-1] + 1.0))[0]
    axis.bar(seconds + 0.5, each, width=0.9, color=_QUIET, label="events")
    for label in LABELS:
        for k, at in enumerate(evaluation.detections[label].t):
            axis.axvline((at - evaluation.start_us) * 1e-6, color=_COLOURS[label], label=f"{label} detected" * (k == 0))
    axis.legend()
    counts: Sequence[str] = [f"{counted(len(evaluation.detections[label]), 'time')} {label}" for label in LABELS]
    axis.set_xlim(0.0, seconds[-1] + 1.0)
    axis.set(xlabel="board time (s)", ylabel="events/s", title=f"Noise alone: detected {' and '.join(counts)}")
    return figure
