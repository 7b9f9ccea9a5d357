"""The report's pictures."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.demo.evaluation import Evaluation
from taxel.demo.judging import LABELS
from taxel.events import Events
from taxel.report.svg import INK
from taxel.simulate import Contact
from taxel.spikes import to_ms, to_us
from taxel.wire import FRAME_US

__all__ = ["close_up", "maps", "scene_picture"]

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
        for drawing in (axis, top):
            for k, at in enumerate(detections.known):
                name = f"{label} detected" * (k == 0)
                drawing.axvline(at * 1e-6, color=colour, linewidth=0.9, alpha=0.9, label=name)
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
            chosen = near.p == rising
            name = f"{'more' if rising else 'less'} pressure ({int(chosen.sum())})"
            raster.plot(to_ms(near.t[chosen] - at), index[chosen], ".", color=colour, markersize=2.5, label=name)
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
    above_rest = [_held(evaluation.events, contact.start_us + to_us(after), rest) for after in moments]
    touched = evaluation.events.between(contact.start_us, contact.start_us + 3_000.0)
    middle = [float(np.median(v)) if len(v) else 31.5 for v in (touched.y, touched.x)]
    top, left = (int(np.clip(m - _CROP / 2, 0, n - _CROP)) for m, n in zip(middle, rest.shape, strict=True))
    seen = [h[top : top + _CROP, left : left + _CROP] for h in above_rest]
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
    values = rest.copy()
    before = events.t <= until_us
    if events.intensity is not None:
        # The last of equal places stays.
        values[events.y[before], events.x[before]] = events.intensity[before]
    return values - rest
