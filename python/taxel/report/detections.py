"""The page of ``taxel train``, ``detect`` and ``live``: the detections of a readout in recordings, and their errors."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib import pyplot as plt
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from taxel._base.errors import refused
from taxel._base.files import write_whole
from taxel._base.messages import escaped
from taxel._base.times import begun
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect import Alignment, Judged, Outcome, PlainRule, Readout, Score
from taxel.detect.detector import detector
from taxel.detect.examples import array_of, padded_to
from taxel.encode import Composite, ContactArea, Encoder, LocalLoad, Peak
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.analysis.pressure import series
from taxel.recording.contents import Contents, source_from
from taxel.recording.sections import Origin
from taxel.report import compared
from taxel.report.page import render
from taxel.report.svg import INK, STYLE, picture
from taxel.spikes import SpikeTrains, to_ms, to_us

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: How many moments are drawn a label, and how much around each in time constants of the neuron.
_MOMENTS, _AROUND = 4, 6.0
#: How much more is drawn around an event that was missed and a false detection, ms: the usual window of a score.
_MISSED_MS = 50.0
#: The end of a recording's name that fits over a picture, letters.
_TITLE = 32
#: So many frames are drawn before a moment and behind it at least.
_FRAMES = 15
#: Files that `taxel view` shows, and the largest number of them that the page lists.
_VIEWED, _MOST_VIEWED = (".mcap", ".lsa"), 4
#: Recordings of frames whose sums are drawn, and stretches of a curve, each with its greatest value.
_MOST_SUMS, _STRETCHES = 4, 1000
#: A load is where the sum, as the median of so long, us, rises by so many standard deviations of its noise above what
#: it falls to around it (a rest may drift), until few are left; and by this part of the median of detected loads.
_BIN_US, _DEVIATIONS, _FEW_DEVIATIONS, _PART_OF_LOADS = 50_000, 8.0, 3.0, 0.2
#: What it falls to: this percentile of so many bins around. Loads less far apart than this are one, us.
_FALLS_TO, _AROUND_BINS, _APART_US = 20.0, 201, 300_000
#: Recordings whose details are shown without a click, at most.
_MOST_OPEN = 4
#: Weights below this part of the largest count as none.
_NO_WEIGHT = 1e-6
#: Maps of weights that are drawn a label, those with the largest weights first.
_MAPS = 8
_DETECTED, _TRUE, _POTENTIAL = "#b5423c", "#2f6690", INK


class _Moment(NamedTuple):
    """A moment to draw: an event or detection of a label, its time (us), and its outcome."""

    recording: int
    label: str
    t: float
    title: str
    badness: float


def write_detections(
    folder: str | os.PathLike[str],
    readout: Readout | PlainRule,
    listened: Sequence[Outcome],
    *,
    title: str,
    judged: str = "",
    held_out: Sequence[Score] = (),
    alignments: Mapping[str, Alignment] | None = None,
    scored: Judged | None = None,
    warnings: Sequence[str] = (),
    printed: Sequence[str] = (),
    overwrite: bool = False,
) -> Path:
    """Write the detections of a readout in recordings as a page with pictures, ``report.html`` in a folder.

    Parameters
    ----------
    folder : path
        Made where it is missing.
    readout : Readout or PlainRule
        A rule has neither potential nor weights to draw.
    listened : sequence of Outcome, one or more
    title : str
    judged : str
        On what the scores of `listened` are: held-out data, or the readout's own training data.
    held_out : list of Score, one per recording, or none
        How readouts trained without each recording, or without parts of it, did on it.
    alignments : mapping of str to Alignment, optional
        By how much labels were moved to what the sensor felt before they were learnt; examples are those of `listened`.
    scored : Judged, optional
        The scores of a training, and those of the plain rules beside it.
    warnings : sequence of str
        What may be wrong with the detections; the page shows these lines first.
    printed : sequence of str
        All other lines that the command prints.
    overwrite : bool
        Whether an existing report may be replaced.

    Returns
    -------
    Path

    Raises
    ------
    FileExistsError : the folder holds a report already and `overwrite` is false
    OSError : the folder cannot be made
    """
    detector("readout", readout)
    if not listened:
        raise refused("listened", " is empty: there is nothing to report")
    target = Path(folder)
    moments = {label: _moments(listened, label) for label in readout.labels}
    aligned = {} if alignments is None else alignments
    with mpl.rc_context(STYLE):
        drawn = {
            label: {
                **_of_neuron(readout, listened, label, moments[label], aligned.get(label)),
                "errors": _picture(_errors(listened, label)),
                "moved": _picture(_moves(aligned.get(label))),
            }
            for label in readout.labels
        }
        felt = _picture(_sums(listened, readout.labels))
        nearest = _picture(compared.nearest(listened, readout.labels))
        beside_training = _picture(compared.beside_training(readout, listened))
    text = render(
        "report/listening.html.j2",
        felt=felt,
        nearest=nearest,
        beside_training=beside_training,
        title=title,
        judged=judged,
        readout=repr(readout),
        labels=readout.labels,
        drawn=drawn,
        aligned={label: aligned.get(label) for label in readout.labels},
        rows=[_row(outcome, label, outcome.score) for outcome in listened for label in readout.labels],
        held_out=[
            _row(outcome, label, score)
            for outcome, score in zip(listened, held_out, strict=bool(held_out))
            for label in readout.labels
        ],
        worst=[
            (listened[m.recording].name, label, (m.t - listened[m.recording].begin_us) / 1e6, m.title)
            for label in readout.labels
            for m in moments[label]
            if m.badness > 0
        ],
        unclaimed=[
            (outcome.name, (t - outcome.begin_us) / 1e6, text)
            for outcome in listened
            for t, text in _unclaimed(outcome)[:_MOMENTS]
        ],
        about=[(outcome.name, _about(outcome, readout)) for outcome in listened],
        most_open=_MOST_OPEN,
        together=_together(listened) if len(listened) > 1 else [],
        warnings=warnings,
        printed=printed,
        viewed=[quote(outcome.name) for outcome in listened if outcome.name.endswith(_VIEWED)][:_MOST_VIEWED],
        beside=_beside(readout.labels, scored),
        scored=any(outcome.score is not None for outcome in listened),
    )
    target.mkdir(parents=True, exist_ok=True)  # so late that nothing is left of one that is ended
    return write_whole(target / "report.html", lambda file: file.write(text.encode()), overwrite=overwrite)


def _beside(labels: Sequence[str], scored: Judged | None) -> list[tuple[str, str, Score | None]]:
    """Return label, detector and score of neurons and of the plain rules beside them; None where there is no rule."""
    if scored is None or scored.plain is None:
        return []
    rows: list[tuple[str, str, Score | None]] = []
    for label in labels:
        rule, together = scored.plain.rules[label], scored.plain.together
        rows.append((label, "neuron", scored.together[label]))
        score = None if rule is None or together is None else together[label]
        rows.append((label, "none" if rule is None else rule._compared(), score))
    return rows


def _of_neuron(
    readout: Readout | PlainRule,
    listened: Sequence[Outcome],
    label: str,
    moments: list[_Moment],
    alignment: Alignment | None,
) -> dict[str, Markup | str | None]:
    """Return the drawings of a label's neuron, and its input in words where it has a single one; a rule has none."""
    if isinstance(readout, PlainRule):
        return {"potential": None, "weights": None, "input": ""}
    return {
        "potential": _picture(_potential(readout, listened, label, moments, alignment)),
        "weights": _picture(_weights(readout, listened[0], label)),
        "input": _only_input(readout, label),
    }


def _picture(figure: Figure | None) -> Markup | None:
    if figure is None:
        return None
    drawn = picture(figure)
    plt.close(figure)
    return drawn


def _unclaimed(outcome: Outcome) -> list[tuple[float, str]]:
    """Return when loads of frames begin that hold neither a detection nor a label, us, and how large they are."""
    frames = recorded(outcome.example.source, hold=False)
    if not isinstance(frames, Frames) or len(frames) < 3:
        return []
    stamps, each, unit = _pressed(outcome, frames)
    _, begins = np.unique(stamps // _BIN_US, return_index=True)
    t, total = stamps[begins], np.array([np.median(part) for part in np.split(each, begins[1:])])
    around = np.pad(total, _AROUND_BINS // 2, mode="reflect" if len(total) > _AROUND_BINS else "edge")
    above = total - np.percentile(sliding_window_view(around, _AROUND_BINS), _FALLS_TO, axis=-1)
    # Loads change the sum in few bins, noise in all.
    deviation = float(np.median(np.abs(np.diff(total)))) * 1.4826 / np.sqrt(2.0)
    inside = np.flatnonzero(above > _FEW_DEVIATIONS * deviation)
    stretches = np.split(inside, np.flatnonzero(np.diff(t[inside]) > _APART_US) + 1)
    loads = [load for load in stretches if len(load) > 1 and above[load].max() > _DEVIATIONS * deviation]
    claims = np.sort(np.concatenate([outcome.found.t, *map(np.asarray, outcome.example.labels.values())]))
    edges = [(t[load[0]] - _APART_US, t[load[-1]] + _APART_US) for load in loads]
    claimed = [bool(np.diff(np.searchsorted(claims, edge))[0]) for edge in edges]
    peaks = [float(above[load].max()) for load in loads]
    usual = [peak for peak, has_claim in zip(peaks, claimed, strict=True) if has_claim]
    least = _PART_OF_LOADS * float(np.median(usual)) if usual else 0.0
    return [
        (
            float(t[load[0]]),
            f"a load without a detection: {(t[load[-1]] - t[load[0]]) / 1e6:.2f} s, up to {peak:.4g} {unit}",
        )
        for load, peak, has_claim in sorted(zip(loads, peaks, claimed, strict=True), key=lambda each: -each[1])
        if not has_claim and peak > least
    ]


def _sums(listened: Sequence[Outcome], labels: Sequence[str]) -> Figure | None:
    """Draw the sum of each recording of frames over time, so of each foot, and what was detected."""
    of_outcomes = [(outcome, recorded(outcome.example.source, hold=False)) for outcome in listened]
    shown = [(outcome, source) for outcome, source in of_outcomes if isinstance(source, Frames) and len(source)][
        :_MOST_SUMS
    ]
    if not shown:
        return None
    figure, axes = plt.subplots(
        len(shown), 1, figsize=(9.0, 0.6 + 1.4 * len(shown)), layout="constrained", squeeze=False
    )
    for axis, (outcome, frames) in zip(axes[:, 0], shown, strict=True):
        t, total, unit = _pressed(outcome, frames)
        begins = np.arange(0, len(t), 1 + len(t) // _STRETCHES)
        seconds, most = (t[begins] - outcome.begin_us) / 1e6, np.fmax.reduceat(total, begins)
        axis.plot(seconds, most, color=INK, linewidth=0.9, label=escaped(f"sum, {unit}"))
        for k, label in enumerate(labels):
            at = (outcome.found[label].t - outcome.begin_us) / 1e6
            axis.plot(
                at,
                np.interp(at, seconds, most),
                "o^sD"[k % 4],
                markersize=3,
                color=_DETECTED if k % 2 == 0 else _TRUE,
                label=escaped(label),
            )
        axis.set_title(escaped(outcome.name), fontsize=9)
        axis.set_ylabel(escaped(unit))
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1][0].set_xlabel("s")
    return figure


def _pressed(outcome: Outcome, frames: Frames) -> tuple[NDArray[np.int64], NDArray[np.float64], str]:
    """Return the times of the frames of an outcome, us, the sum of each above its rest, and its unit."""
    pressed = series(Recording(Contents.single(source_from(frames, Origin(Path(outcome.name))))), outcome.example.tare)
    assert pressed is not None  # frames have values
    return (pressed.t, pressed.total, pressed.unit) if pressed.force is None else (pressed.t, pressed.force, "N")


def _about(outcome: Outcome, readout: Readout | PlainRule) -> list[str]:
    """Return what else is known of the detections in a recording."""
    lines = [f"{text}."] if (text := outcome.outside_text) and isinstance(readout, Readout) else []
    return [*lines, *([f"Times are counted from {begun(outcome.begin_us)}."] if outcome.begin_us else [])]


def _together(listened: Sequence[Outcome]) -> list[tuple[str, int, Score | None]]:
    """Return the detections of each recording, and its score, of all labels together."""
    return [(outcome.name, len(outcome.found), outcome.score) for outcome in listened]


def _row(outcome: Outcome, label: str, score: Score | None) -> dict[str, Any]:
    counted = None if score is None else score.by_label.get(label)
    count = len(outcome.found[label]) if counted is None else counted.found + counted.false
    return {"recording": outcome.name, "label": label, "detections": count, "score": counted}


def _moments(listened: Sequence[Outcome], label: str) -> list[_Moment]:
    """Return the worst of a label's events and detections, the worst first; without truth its first detections."""
    moments = []
    for k, outcome in enumerate(listened):
        if outcome.score is None:
            moments += [_Moment(k, label, float(t), "detected", 0.0) for t in outcome.found[label].t]
            continue
        if label not in outcome.score.by_label:
            continue
        score, times = outcome.score[label], outcome.found.t
        happened = times[score.pairs[:, 0]] - np.rint(to_us(score.errors_ms)).astype(np.int64)
        true = np.asarray(outcome.example.labels.get(label, ()), np.int64)
        moments += [_Moment(k, label, float(t), "missed", np.inf) for t in np.setdiff1d(true, happened)]
        moments += [_Moment(k, label, float(t), "false", np.inf) for t in times[score.false_detections]]
        moments += [
            _Moment(k, label, float(t), f"{error:+.2f} ms", abs(float(error)))
            for t, error in zip(happened, score.errors_ms, strict=True)
        ]
    # Of equally bad ones each recording, and both kinds, take turns.
    turns: Counter[tuple[int, str]] = Counter()
    in_turn = []
    for moment in moments:
        in_turn.append((-moment.badness, turns[moment.recording, moment.title], moment))
        turns[moment.recording, moment.title] += 1
    return [moment for *_, moment in sorted(in_turn, key=lambda ranked: ranked[:2])[:_MOMENTS]]


def _potential(
    readout: Readout, listened: Sequence[Outcome], label: str, moments: list[_Moment], aligned: Alignment | None
) -> Figure | None:
    """Draw the sum of frames, potential and threshold around moments, with detections and labels, given and learnt."""
    if not moments:
        return None
    trained = readout.neurons[label]
    sources = {k: recorded(listened[k].example.source, hold=False) for k in {moment.recording for moment in moments}}
    sums = {k: (source, _pressed(listened[k], source)) for k, source in sources.items() if isinstance(source, Frames)}
    rows = 2 if sums else 1
    figure, axes = plt.subplots(
        rows,
        len(moments),
        figsize=(1.6 + 2.5 * len(moments), 0.7 + 1.9 * rows),
        layout="constrained",
        squeeze=False,
        sharex="col",
    )
    for axis in axes[-1][1:]:
        axis.sharey(axes[-1][0])
    lines: dict[str, Any] = {}
    for column, moment in zip(axes.T, moments, strict=True):
        # Wide enough for the label and its detection, or for what was felt late of one that has none.
        apart = moment.badness if np.isfinite(moment.badness) else _MISSED_MS
        reach = _AROUND * trained.neuron.tau + trained.delay_ms + apart
        outcome, at = listened[moment.recording], to_ms(moment.t)
        if moment.recording in sums:
            frames, (stamps, total, unit) = sums[moment.recording]
            reach = max(reach, _FRAMES * to_ms(float(np.median(np.diff(frames.t))))) if len(frames) > 1 else reach
            near = np.abs(to_ms(stamps) - at) < reach
            (lines["sum above rest"],) = column[0].plot(
                to_ms(stamps[near]) - at, total[near], ".-", color=INK, linewidth=1, markersize=3
            )
            axes[0][0].set_ylabel(escaped(f"sum, {unit}"))
        trains = readout.trains_of(label, _trains(readout, outcome))
        detected_ms = to_ms(outcome.found[label].t)
        # A neuron that forgets at once is at its threshold for less than the distance between two of many times.
        inputs = trains.times[np.abs(trains.times - at) < reach]
        after = np.linspace(0.0, trained.delay_ms + _AROUND * trained.neuron.tau, 40)
        times = np.concatenate([np.linspace(at - reach, at + reach, 600), (inputs[:, None] + after).ravel()])
        times = np.unique(times[times < at + reach])
        crossings = detected_ms + readout.encoder_of(label).latency_ms + trained.delay_ms
        potential = trained.neuron.potential(trained.weights, trains, times, spikes=crossings)
        (lines["potential"],) = column[-1].plot(times - at, potential, color=_POTENTIAL, linewidth=1)
        threshold = readout.run_threshold * trained.neuron.theta_0
        lines["threshold at rest"] = column[-1].axhline(threshold, color="#999999", linewidth=0.8, linestyle=":")
        true = to_ms(np.asarray(outcome.example.labels.get(label, ()), np.float64))
        felt = np.empty(0) if aligned is None else to_ms(aligned.felt(moment.recording))
        marks = (("detected", detected_ms, _DETECTED, "-"), ("true", true, _TRUE, "--"), ("felt", felt, _TRUE, ":"))
        for title, ms, color, style in marks:
            for t in ms[np.abs(ms - at) < reach]:
                for axis in column:
                    lines[title] = axis.axvline(t - at, color=color, linewidth=1.2, linestyle=style)
        seconds = f"{(at - to_ms(outcome.begin_us)) / 1000.0:.3f} s"
        source = outcome.name[-_TITLE:] if len(listened) > 1 else ""
        column[0].set_title(f"{escaped(source)}\n{escaped(f'{moment.title}, {seconds}')}".strip(), fontsize=8)
        column[-1].set_xlabel("ms from then")
    axes[-1][0].set_ylabel("potential, mV")
    figure.legend(list(lines.values()), list(lines), loc="outside right upper")
    return figure


def _moves(aligned: Alignment | None) -> Figure | None:
    """Draw how far each label was moved to what the sensor felt, one recording after the other."""
    if aligned is None or aligned.train is None:
        return None
    figure, axis = plt.subplots(figsize=(6.5, 2.2), layout="constrained")
    number = np.arange(len(aligned.given))
    axis.vlines(number, 0.0, aligned.moved_ms, color=_TRUE, linewidth=0.8)
    axis.plot(number, aligned.moved_ms, ".", color=_TRUE, label="felt")
    axis.plot(number[aligned.unpaired], np.zeros(aligned.unpaired.sum()), "x", color=_DETECTED, label="no input near")
    axis.axhline(0, color="#999999", linewidth=0.8)
    axis.set_xlabel("label, in the order of recordings and time")
    axis.set_ylabel("sensor minus label, ms")
    axis.legend()
    return figure


def _trains(readout: Readout, outcome: Outcome) -> SpikeTrains:
    source, tare, array = recorded(outcome.example.source), outcome.example.tare, readout.array
    if isinstance(source, SpikeTrains):
        return source
    # A readout of grids of several sizes has weights for the largest.
    if isinstance(source, Frames) and array is not None and array.shape != source.array.shape:
        source, tare = padded_to(source, tare, array.shape)
    encoder = readout._at_noise_of(tare).encoder
    return (encoder if tare is None else encoder.with_tare(tare)).encode(source)


def _weights(readout: Readout, outcome: Outcome, label: str) -> Figure:
    """Draw weights over the array where trains are taxels', else as bars."""
    weights = np.asarray(readout.neurons[label].weights)
    array = array_of([outcome.example]) if readout.array is None else readout.array
    if array is None:
        raise ProblemError(f"{outcome.name}: spike trains do not state their array")
    largest = float(np.abs(weights).max()) or 1.0
    planes = _planes(weights, readout.encoder_of(label), len(readout.delays_ms), array.rows * array.columns)
    if not planes or array.rows * array.columns < 4:
        figure, axis = plt.subplots(figsize=(6.5, 2.2), layout="constrained")
        axis.bar(np.arange(len(weights)), weights, color=_POTENTIAL)
        axis.axhline(0, color="#999999", linewidth=0.8)
        _name_inputs(axis, readout.encoder_of(label), array, len(readout.delays_ms))
        axis.set_ylabel("weight, mV")
        return figure
    if not array._has_neighbours:
        return _channels(planes, array)
    planes = sorted(planes, key=lambda plane: -float(np.abs(plane[1]).max()))[:_MAPS]
    columns = min(4, len(planes))
    rows = -(-len(planes) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(2.4 * columns, 2.4 * rows), layout="constrained", squeeze=False)
    scale = Normalize(-largest, largest)
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, (name, plane) in zip(axes.flat, planes, strict=False):
        axis.set_axis_on()
        picture = plane.reshape(array.shape)
        axis.imshow(picture if array.exists is None else np.where(array.exists, picture, np.nan), "RdBu_r", scale)
        axis.set_title(escaped(name or "weights"), fontsize=9)
        axis.set_xlabel("column")
        axis.set_ylabel("row")
    figure.colorbar(ScalarMappable(scale, "RdBu_r"), ax=axes, label="weight, mV")
    return figure


def _only_input(readout: Readout, label: str) -> str:
    """Return which level of which quantity is the only input of a neuron, a threshold; "" of another neuron."""
    weights = np.asarray(readout.neurons[label].weights)
    learnt = np.flatnonzero(np.abs(weights) > _NO_WEIGHT * np.abs(weights).max())
    parts, delays = readout.encoder_of(label)._each(), readout.delays_ms
    if len(learnt) != 1 or len(parts) != 1 or len(delays) != 1:
        return ""
    (encoder,) = parts
    quantities = {
        Peak: ["the peak, in units of noise,"],
        ContactArea: ["the number of loaded taxels"],
        LocalLoad: [
            f"the largest sum over 3 x 3 taxels{_beside_mean(name)}, in units of noise,"
            for name in getattr(encoder, "quantities", ())
            if name.startswith("largest") and "mean of" not in name
        ],
    }
    levels = getattr(encoder, "levels", ())
    names = quantities.get(type(encoder), [])
    if np.ndim(levels) != 1 or len(weights) != 2 * len(names) * len(levels):
        return ""
    falls, at = divmod(int(learnt[0]), len(names) * len(levels))
    quantity, level = divmod(at, len(levels))
    value = levels[level] * (getattr(encoder, "release", 1.0) if falls else 1.0)
    way = "falls below" if falls else "rises to"
    return f"The neuron has one input, and is a threshold: it fires when {names[quantity]} {way} {value:.4g}."


def _beside_mean(name: str) -> str:
    """Return above or below what a quantity of `LocalLoad` is, if that is a running mean: "largest below, 50 ms"."""
    side, _, length = name.removeprefix("largest").partition(", ")
    return f" {side.strip() or 'above'} running means of {length}" if length else ""


def _channels(planes: list[tuple[str, NDArray[np.float64]]], array: Array) -> Figure:
    """Draw the weights of channels side by side, with their names: a row for each plane."""
    rows = np.stack([plane for _, plane in planes])
    size = (2.0 + 0.45 * rows.shape[1], 1.6 + 0.25 * len(rows))
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    scale = Normalize(-(float(np.abs(rows).max()) or 1.0), float(np.abs(rows).max()) or 1.0)
    axis.imshow(rows, "RdBu_r", scale, aspect="auto")
    axis.set_yticks(range(len(rows)), [escaped(name or "weights") for name, _ in planes])
    if array.names is not None and len(array.names) == rows.shape[1]:
        axis.set_xticks(range(rows.shape[1]), [escaped(name) for name in array.names], rotation=45, ha="right")
    else:
        axis.set_xlabel("channel")
    figure.colorbar(ScalarMappable(scale, "RdBu_r"), ax=axis, label="weight, mV")
    return figure


def _name_inputs(axis: Axes, encoder: Encoder, array: Array, delays: int) -> None:
    """Name the inputs of bars by the encoder, or by the parts of a composite encoder, which are separated by lines."""
    names = sorted(encoder.parts) if isinstance(encoder, Composite) else [encoder.name.replace("_", " ")]
    counts = [part.trains(array) * (2 if part.signed else 1) for part in encoder._each()] * delays
    ends = np.cumsum(counts) - 0.5
    ticks = [name + f", {_nth('delay', delays, d)}" * (delays > 1) for d in range(delays) for name in names]
    axis.set_xticks(ends - np.array(counts) / 2.0, ticks)
    for end in ends[:-1]:
        axis.axvline(end, color="#999999", linewidth=0.8, linestyle=":")
    axis.set_xlabel("input: the encoder's trains in their order")


def _planes(
    weights: NDArray[np.float64], encoder: Encoder, delays: int, taxels: int
) -> list[tuple[str, NDArray[np.float64]]]:
    """Return weights by taxel, with the names of what else tells trains apart; none where trains are not taxels'.

    Trains are ordered by delay, then ON before OFF, then by taxel and level; the tonic trains come last.
    """
    several = isinstance(encoder, Composite)
    if several or encoder.trains(Array(taxels, 1)) == encoder.trains(Array(taxels, 2)):
        return []
    halves, tonic = 2 if encoder.signed else 1, getattr(encoder, "tonic_ms", None) is not None
    levels, left = divmod(len(weights), taxels * halves * delays)
    if left or not levels:
        return []
    planes = []
    for d, delayed in enumerate(np.split(weights, delays)):
        for s, half in enumerate(np.split(delayed, halves)):
            crossing = half[: taxels * (levels - tonic)].reshape(taxels, levels - tonic)
            behind = [("tonic", half[-taxels:])] if tonic else []
            for name, plane in [*((_nth("level", levels - tonic, n), p) for n, p in enumerate(crossing.T)), *behind]:
                words = (("ON", "OFF")[s] if halves == 2 else "", name, _nth("delay", delays, d))
                planes.append((" ".join(filter(None, words)), plane))
    return planes


def _nth(noun: str, count: int, n: int) -> str:
    return f"{noun} {n + 1}" if count > 1 else ""


def _errors(listened: Sequence[Outcome], label: str) -> Figure | None:
    """Draw how far detections lay from their events."""
    scores = [outcome.score.by_label.get(label) for outcome in listened if outcome.score is not None]
    errors = [score.errors_ms for score in scores if score is not None]
    if not errors or not sum(map(len, errors)):
        return None
    figure, axis = plt.subplots(figsize=(4.2, 2.2), layout="constrained")
    axis.hist(np.concatenate(errors), bins=30, color=_TRUE)
    axis.axvline(0, color="#999999", linewidth=0.8)
    axis.set_xlabel("time minus true, ms")
    axis.set_ylabel("events")
    return figure
