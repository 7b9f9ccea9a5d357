"""The page of ``taxel train``, ``detect`` and ``live``: the detections of a readout in recordings, and their errors."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib import pyplot as plt

from taxel._base.errors import refused
from taxel._base.files import write_whole
from taxel._base.messages import escaped
from taxel.detect import Judged, Outcome, PlainRule, Readout, Score
from taxel.detect.detector import detector
from taxel.detect.examples import padded_to
from taxel.encode import Composite
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.report import compared
from taxel.report.page import render
from taxel.report.svg import INK, QUIET, STYLE, TRUE, picture
from taxel.report.touch import marked, of_touch
from taxel.spikes import SpikeTrains, to_ms, to_us

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: How many moments are drawn a label, and how much around each in time constants of the neuron.
_MOMENTS, _AROUND = 4, 6.0
#: How much more is drawn around an event that was missed and a false detection, ms: the usual window of a score.
_MISSED_MS = 50.0
#: A spike resets the potential so long after the time of its detection, which is rounded to whole us, ms.
_RESET_MS = 0.002
#: The end of a recording's name that fits over a picture, letters.
_TITLE = 32


class _Moment(NamedTuple):
    """A moment to draw: an event or detection of a label, its time (us), and its outcome."""

    outcome: Outcome
    t: float
    what: str
    badness: float


def write_detections(
    folder: str | os.PathLike[str],
    readout: Readout | PlainRule,
    listened: Sequence[Outcome],
    *,
    title: str,
    judged: str = "",
    touch: tuple[float, float] | None = None,
    held_out: Sequence[Score] = (),
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
    touch : (float, float), us, optional
        Begin and end of a touch in the first recording, which is drawn first; the recording has events and a tare.
    held_out : list of Score, one per recording, or none
        How readouts trained without each recording, or without parts of it, did on it.
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
    target, labels = Path(folder), readout.labels
    moments = {label: _moments(listened, label) for label in labels}
    with mpl.rc_context(STYLE):
        first = [] if touch is None else _pictures(of_touch(listened[0], *touch))
        drawn = {label: _pictures(_of_label(readout, listened, label, moments[label])) for label in labels}
        nearest = _pictures([compared.nearest(listened, labels)])
    text = render(
        "report/listening.html.j2",
        title=title,
        judged=judged,
        first=first,
        readout=repr(readout),
        neurons=isinstance(readout, Readout),
        warnings=warnings,
        printed=printed,
        tables=_tables(listened, labels, held_out, scored),
        nearest=nearest,
        worst=[
            (moment.outcome.name, label, (moment.t - moment.outcome.begin_us) / 1e6, moment.what)
            for label in labels
            for moment in moments[label]
            if moment.badness > 0
        ],
        drawn=drawn,
    )
    target.mkdir(parents=True, exist_ok=True)  # so late that nothing is left of one that is ended
    return write_whole(target / "report.html", lambda file: file.write(text.encode()), overwrite=overwrite)


def _tables(
    listened: Sequence[Outcome], labels: Sequence[str], held_out: Sequence[Score], scored: Judged | None
) -> list[tuple[str, list[tuple[str, str, int | str, Score | None]]]]:
    """Return tables of scores with their titles: rows of a name, a label, the number of detections and the score."""
    tables = []
    if scored is not None and scored.plain is not None:
        rules, together = scored.plain.rules, scored.plain.together
        beside: list[Any] = []
        for label in labels:
            rule = rules[label]
            of_rule = None if rule is None or together is None else together[label]
            beside.append(("neuron", label, "", (scored.neurons or scored.together)[label]))
            beside.append(("no plain rule" if rule is None else rule._compared(), label, "", of_rule))
        tables.append(("Neuron and plain rule, on the same labels", beside))
    if held_out:
        tables.append(("On held-out data: these scores count", _rows(zip(listened, held_out, strict=True), labels)))
    title = "On the training data: these scores do not count" if held_out else ""
    return [*tables, (title, _rows(((outcome, outcome.score) for outcome in listened), labels))]


def _rows(
    scores: Iterable[tuple[Outcome, Score | None]], labels: Sequence[str]
) -> list[tuple[str, str, int | str, Score | None]]:
    rows: list[tuple[str, str, int | str, Score | None]] = []
    for outcome, score in scores:
        for label in labels:
            of_label = None if score is None else score.by_label.get(label)
            count = len(outcome.found[label]) if of_label is None else of_label.found + of_label.false
            rows.append((outcome.name, label, count, of_label))
    return rows


def _pictures(figures: Iterable[Figure | None]) -> list[Markup]:
    drawn = []
    for figure in figures:
        if figure is not None:
            drawn.append(picture(figure))
            plt.close(figure)
    return drawn


def _of_label(
    readout: Readout | PlainRule, listened: Sequence[Outcome], label: str, moments: list[_Moment]
) -> Iterable[Figure | None]:
    """Yield the pictures of a label: potential around its moments, errors and weights; a rule has only errors."""
    by_neuron = readout if isinstance(readout, Readout) and label not in readout.by_rule else None
    if by_neuron is not None and moments:
        yield from _potential(by_neuron, label, moments)
    errors = [
        outcome.score[label].errors_ms for outcome in listened if outcome.score and label in outcome.score.by_label
    ]
    if sum(map(len, errors)):
        figure, axis = plt.subplots(figsize=(3.3, 2.2), layout="constrained")
        axis.hist(np.concatenate(errors), bins=30, color=TRUE)
        axis.axvline(0, color=QUIET, linewidth=0.8)
        axis.set(xlabel="detected minus true, ms", ylabel="events")
        yield figure
    if by_neuron is not None:
        yield _weights(by_neuron, label)


def _moments(listened: Sequence[Outcome], label: str) -> list[_Moment]:
    """Return the worst of a label's events and detections, the worst first; without truth its first detections."""
    moments = []
    for outcome in listened:
        if outcome.score is None:
            moments += [_Moment(outcome, float(t), "detected", 0.0) for t in outcome.found[label].t[:_MOMENTS]]
        elif label in outcome.score.by_label:
            score, times = outcome.score[label], outcome.found.t
            happened = times[score.pairs[:, 0]] - np.rint(to_us(score.errors_ms)).astype(np.int64)
            true = np.asarray(outcome.example.labels.get(label, ()), np.int64)
            moments += [_Moment(outcome, float(t), "missed", np.inf) for t in np.setdiff1d(true, happened)]
            moments += [_Moment(outcome, float(t), "false", np.inf) for t in times[score.false_detections]]
            moments += [
                _Moment(outcome, float(t), f"{error:+.2f} ms", abs(float(error)))
                for t, error in zip(happened, score.errors_ms, strict=True)
            ]
    return sorted(moments, key=lambda moment: -moment.badness)[:_MOMENTS]


def _potential(readout: Readout, label: str, moments: list[_Moment]) -> Iterator[Figure]:
    """Draw potential and threshold around each moment, with the detections and the labels."""
    trained = readout.neurons[label]
    for k, (outcome, t, what, badness) in enumerate(moments):
        figure, axis = plt.subplots(figsize=(3.3, 2.5), layout="constrained")
        # Wide enough for the label and its detection, or for what was felt late of one that has none.
        reach = _AROUND * trained.neuron.tau + trained.delay_ms + (badness if np.isfinite(badness) else _MISSED_MS)
        at, found_ms = to_ms(t), to_ms(outcome.found[label].t)
        trains = readout.trains_of(label, _trains(readout, outcome))
        crossings = found_ms + readout.encoder_of(label).latency_ms + trained.delay_ms
        # A neuron that forgets at once is at its threshold for less than the distance between two of many times.
        near = np.concatenate([trains.times, crossings + _RESET_MS / 2])
        after = np.linspace(0.0, trained.delay_ms + _AROUND * trained.neuron.tau, 40)
        times = np.concatenate([np.linspace(at - reach, at + reach, 600), (near[:, None] + after).ravel()])
        times = np.unique(times[np.abs(times - at) < reach])
        potential = trained.neuron.potential(trained.weights, trains, times, spikes=crossings + _RESET_MS)
        axis.plot(times - at, potential, color=INK, linewidth=1, zorder=3, label="potential")
        threshold = readout.run_threshold * trained.neuron.theta_0
        axis.axhline(threshold, color=QUIET, linewidth=0.8, linestyle=":", label="threshold at rest")
        true = to_ms(np.asarray(outcome.example.labels.get(label, ()), np.float64))
        marked(axis, found_ms, true, at, reach, origin=at)
        seconds = f"{(at - to_ms(outcome.begin_us)) / 1000.0:.3f} s"
        axis.set_title(f"{escaped(outcome.name[-_TITLE:])}\n{escaped(f'{what}, {seconds}')}", fontsize=8)
        axis.set(xlabel="ms from then", ylabel="potential, mV")
        if k == 0:
            axis.legend(fontsize="small")
        yield figure


def _trains(readout: Readout, outcome: Outcome) -> SpikeTrains:
    source, tare, array = recorded(outcome.example.source), outcome.example.tare, readout.array
    if isinstance(source, SpikeTrains):
        return source
    # A readout of grids of several sizes has weights for the largest.
    if isinstance(source, Frames) and array is not None and array.shape != source.array.shape:
        source, tare = padded_to(source, tare, array.shape)
    encoder = readout._for(outcome.example.source, tare).encoder
    return (encoder if tare is None else encoder.with_tare(tare)).encode(source)


def _weights(readout: Readout, label: str) -> Figure:
    """Draw the weights of all trains that a neuron receives."""
    weights, encoder = np.asarray(readout.neurons[label].weights), readout.encoder_of(label)
    figure, axis = plt.subplots(figsize=(5.0, 2.2), layout="constrained")
    axis.bar(np.arange(len(weights)), weights, color=INK)
    axis.axhline(0, color=QUIET, linewidth=0.8)
    parts = f": {', '.join(sorted(encoder.parts))}" if isinstance(encoder, Composite) else ""
    axis.set(xlabel=escaped(f"input: the encoder's trains in their order{parts}"), ylabel="weight, mV")
    return figure
