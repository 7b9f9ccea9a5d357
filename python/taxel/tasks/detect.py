"""Detect events in recordings by a trained readout or a plain rule, and score them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from math import isnan
from typing import Any, TypeAlias

import numpy as np

from taxel._base.arguments import instance, shown
from taxel._base.messages import collected, counted, warn
from taxel._base.parallel import HERE, Workers
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.detect import Example, Outcome, PlainRule, Readout, Score, recipes, score
from taxel.detect.board import differences, other_frames
from taxel.detect.clock import off_detections
from taxel.detect.detector import detector
from taxel.detect.drift import left_line
from taxel.detect.examples import unreliable
from taxel.detect.readout import rest_for, run_watched, used
from taxel.detect.scoring import many_wrong, score_together
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.options import DetectOptions
from taxel.recorded import recorded, unit_of
from taxel.recording import Recording
from taxel.recording.analysis.rest import Rest
from taxel.recording.opening import sensors_of
from taxel.spikes import to_us
from taxel.tasks.info import sensor_lines
from taxel.tasks.labels import GivenLabels, given_labels, spans

#: So many lines, beside that of each sensor, say what was measured.
_LINES = 3
#: No event.
_NONE = np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class Detected:
    """Hold what was detected in one recording.

    Attributes
    ----------
    recording : Recording
    outcome : taxel.detect.Outcome
        Detections and score.
    rest : Rest, optional
        Which rest was taken; None where the readout needs none.
    remarks : tuple of str
        What may keep detections away or make false ones: gaps, dead, stuck and noisy taxels, values that fall from
        their rest; none where at most 5 % of the labels are missed or false.
    """

    recording: Recording
    outcome: Outcome
    rest: Rest | None
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the detections as plain values for JSON; a detection has the keys of ``taxel live --json``."""
        verdict, found = self.recording.verdict, self.outcome.score
        return {
            "recording": self.outcome.name,
            "verdict": verdict,
            "verdict_details": verdict.to_dict(),
            "rest": None if self.rest is None else self.rest.to_dict(),
            "remarks": list(self.remarks),
            "detections": [
                {
                    "label": d.label,
                    "t_us": d.t,
                    "known_us": d.known,
                    "slope_mv_per_ms": None if isnan(d.slope) else d.slope,
                    "repaired": d.repaired,
                }
                for d in self.outcome.found
            ],
        } | ({} if found is None else {"score": found.to_dict()})


@dataclass(frozen=True, eq=False)
class Detecting:
    """Hold what a readout detected in recordings.

    Attributes
    ----------
    each : tuple of Detected
    score : taxel.detect.Score, optional
        Over all recordings, if the truth is known.
    not_scored : tuple of str
        The labels of the truth that the readout does not have.
    unlabelled : tuple of str
        The labels of the readout that the truth does not name, and the sources that no row of it names, where rows name
        sources: they are not scored.
    window_ms, shift_ms : float, ms
    use : str
        As asked (`DetectOptions`).
    unreliable : tuple of str
        The labels whose score is too bad to rely on, in all recordings or in some.
    warnings : tuple of str
    left_out : tuple of str
        The recordings in which the readout cannot detect, as those of another array or without a known rest.
    """

    each: tuple[Detected, ...]
    score: Score | None
    not_scored: tuple[str, ...]
    unlabelled: tuple[str, ...]
    window_ms: float
    shift_ms: float = 0.0
    use: str = "better"
    unreliable: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def outcomes(self) -> list[Outcome]:
        """The outcome of each recording, as a report takes them."""
        return [detected.outcome for detected in self.each]

    def by_frame(self) -> Any:
        """Return a DataFrame of the detections in a data set, which joins with its tables; None in others.

        Its columns are ``episode_index``, ``frame_index`` (of the last frame not after ``known_s``), ``label``, ``t_s``
        and ``known_s``, and ``source`` where an episode has several.
        """
        if any(each.recording.episode is None for each in self.each):
            return None
        import pandas as pd  # noqa: PLC0415  takes long

        tables = []
        for each in self.each:
            recording, found = each.recording, each.outcome.found
            last = np.searchsorted(recording.frames().t, found.known, side="right") - 1
            of = {"episode_index": recording.episode, "source": recording.label, "frame_index": last}
            tables.append(
                pd.DataFrame({**of, "label": found.label, "t_s": found.t / 1e6, "known_s": found.known / 1e6})
            )
        table = pd.concat(tables, ignore_index=True)
        return table if len({each.recording.label for each in self.each}) > 1 else table.drop(columns="source")

    def to_dict(self) -> dict[str, Any]:
        """Return the detections and scores as plain values for JSON."""
        result: dict[str, Any] = {
            "recordings": [each.to_dict() for each in self.each],
            "left_out": list(self.left_out),
            "use": self.use,
            "warnings": [*self.unreliable, *self.warnings],
        }
        if self.score is None:
            return result
        asked = {"window_ms": self.window_ms, "shift_ms": self.shift_ms}
        return result | asked | {"score": self.score.to_dict(), "unlabelled": list(self.unlabelled)}


def detect(
    readout: Readout | PlainRule,
    recordings: Recording | Sequence[Recording],
    truth: GivenLabels | None = None,
    options: DetectOptions | None = None,
    *,
    progress: Progress | None = None,
    workers: Workers | None = None,
) -> Detecting:
    """Detect events in recordings by a trained readout or a plain rule; score them where the truth is given.

    ``taxel detect`` and the page call this function.

    Parameters
    ----------
    readout : Readout or PlainRule
        `taxel.detect.load` reads one from its file.
    recordings : Recording or sequence of Recording
        What `taxel.open` or, of a folder, `taxel.open_all` returns.
    truth : "notes", path, sequence of path or sequence of mapping, optional
        Labels to score against, as of `taxel.train`.
    options : DetectOptions, optional
    progress : function of (step, done, all), optional
    workers : Workers, optional
        Who detects in the recordings; default: this process alone.

    Returns
    -------
    Detecting

    Raises
    ------
    ProblemError : recordings of which none fits, or a truth that does not
    FormatError : a table or a tare that is none

    Notes
    -----
    The rest is the same on the page, in the shell and in Python: see `taxel.tasks.rest`. The truth never counts.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> import taxel
    >>> values = np.full((100, 4, 4), 50.0)
    >>> values[70:90, 1:3, 1:3] += 200
    >>> frames = taxel.Frames(values, 10_000 * np.arange(100), unit="counts", array=taxel.Array(4, 4))
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "press.npz"
    >>> _ = taxel.convert(frames, place)
    >>> [found] = detect(taxel.detect.PlainRule("area", 2, noise_floor=40.0), taxel.open(place)).each
    >>> found.outcome.found.t, str(found.rest)
    (array([700000, 900000]), 'its first quiet stretch, 0.000 to 0.500 s')
    """
    detector("readout", readout)
    options = DetectOptions() if options is None else instance("options", options, DetectOptions)
    readout = used(readout, options.use).absorbing(options.absorb_s)
    update = reporting(progress)
    opened = sensors_of(recordings)
    with collected() as warnings:
        events, sources = ([], ()) if truth is None else given_labels(truth, opened, "truth", options.shift_ms)
        lasting = [{} for _ in opened] if truth is None else spans(truth, opened, options.shift_ms)
        named = {label for of_recording in events for label in of_recording}
        known = [label for label in readout.labels if label in named] or list(readout.labels)
        each_labelled = [
            None if truth is None or recording.label in sources else events[k] for k, recording in enumerate(opened)
        ]
        each_one = list(zip(opened, each_labelled, lasting, strict=True))
        workers = instance("workers", HERE if workers is None else workers, Workers)
        update(f"detecting in {opened[0].title}" if opened else "detecting", 0, 0)
        one_of = partial(_detected, readout, known, options)
        tried = workers.tried(one_of, each_one, lambda _, done: update("detecting", done, len(each_one)))
        for text in dict.fromkeys(text for one in tried for text in one.warnings):
            warn(text, stacklevel=2)
        each = tuple(one.result for one in tried if one.error is None)
        failed = {
            recording.title: one.error for recording, one in zip(opened, tried, strict=True) if one.error is not None
        }
        if failed and not each:
            raise next(iter(failed.values()))
        for failure in failed.values():
            warn(f"left out: {failure}", stacklevel=2)
        scored = [outcome for detected in each if (outcome := detected.outcome).score is not None]
        together = _score_of(scored, options.window_ms) if scored else None
        if together is not None and together.events and many_wrong(together):
            data = readout._parts.get("training") or {}
            for line in off_detections(scored, data.get("error_ms", {}))[:_LINES]:
                warn(line, stacklevel=2)
    unknown = sorted({label for labels_of in events for label in labels_of} - set(readout.labels))
    for label in unknown:
        if alike := [name for name in readout.labels if recipes.spelling(name) == recipes.spelling(label)]:
            warnings.append(
                f"truth has {shown(label)}, the readout {shown(alike[0])}: must be spelt alike to be scored"
            )
    training = readout._parts.get("training") or {}
    boards = (recording.registers for recording in opened if recording.has_events)
    differing = [differences(training, held) for held in boards if held is not None]
    differing += [other_frames(training, recording) for recording in opened]
    warnings += dict.fromkeys(filter(None, differing))
    with_labels = [outcome for outcome in scored if outcome.score is not None and outcome.score.events]
    bad = (
        tuple(_unreliable(with_labels, _score_of(with_labels, options.window_ms), options.window_ms))
        if with_labels
        else ()
    )
    how = options.window_ms, options.shift_ms, options.use
    without = () if truth is None else (*(label for label in readout.labels if label not in known), *sources)
    return Detecting(each, together, tuple(unknown), without, *how, bad, tuple(warnings), tuple(failed))


def _score_of(outcomes: Sequence[Outcome], window_ms: float) -> Score:
    """Return the score of the detections in several examples as one."""
    return score_together(
        [outcome.compared for outcome in outcomes],
        [outcome.example.labels for outcome in outcomes],
        window_ms,
        [outcome.example.spans for outcome in outcomes],
    )


def _unreliable(outcomes: Sequence[Outcome], together: Score, window_ms: float) -> Iterator[str]:
    """Yield the labels whose score is too bad to rely on, in all recordings or else in some; each has labels."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.example.group, []).append(outcome)
    scores = {group: _score_of(members, window_ms).by_label for group, members in groups.items()}
    for label, of_all in together.by_label.items():
        if text := unreliable(label, of_all, "labels", "this readout here"):
            yield text
            continue
        for group, of_group in scores.items():
            on = f"this readout in {group.strip()}"
            if len(scores) > 1 and label in of_group and (text := unreliable(label, of_group[label], "labels", on)):
                yield text


#: A recording, its labels if the truth is known, and begins and ends of those that last.
_One: TypeAlias = tuple[Recording, Mapping[str, Any] | None, Mapping[str, Any]]


def _detected(readout: Readout | PlainRule, known: Sequence[str], options: DetectOptions, one: _One) -> Detected:
    recording, labels, ends = one
    if recording.verdict.status in ("damaged", "unfinished", "lost", "nothing arrived"):
        # Detections may lack or have wrong times.
        warn(f"{recording.title}: {recording.verdict}", stacklevel=3)
    with _naming(recording.title):
        _check_unit(readout, recording)
        taken = rest_for(readout, recording, options.tare)
        tare, begin_us = (None, None) if taken is None else (taken._needed(recording), taken.detect_from_us)
        found, left = run_watched(readout, recording, options.frame_us, tare, begin_us=begin_us)
    if left is not None:
        begin_us = 0 if taken is None else taken.begin_us
        warn(f"{recording.title}: {left_line(readout, *left, begin_us)}", stacklevel=3)
    # Labels that the readout does not have do not count as missed.
    true = {} if labels is None else {label: labels.get(label, _NONE) for label in known}
    title = recording.title
    example = Example(recording, true, tare, title.removesuffix(recording.label), title, spans=ends)
    outcome = Outcome(title, example, found)
    scored = score(outcome.compared, true, options.window_ms, ends) if true else None
    for label, ms in (readout._parts.get("training") or {}).get("constants_ms", {}).items():
        # As in the training, if these labels are of the same hand.
        moved = true | {label: true.get(label, _NONE) - round(to_us(ms))}
        if scored is None or not len(true.get(label, _NONE)):
            continue
        second = score(outcome.compared, moved, options.window_ms, ends)
        if second.rank < scored.rank:
            true, scored = moved, second
            side = "after" if ms > 0 else "before"
            warn(f"{label}: labels are {abs(ms):.0f} ms {side} what was felt, as in the training: taken off to score")
    outcome = outcome._replace(example=example._replace(labels=true), score=scored)
    remarks = [] if scored is not None and scored.events and not many_wrong(scored) else list(sensor_lines(recording))
    if scored is not None and not scored.events:
        remarks.insert(
            0,
            f"0 labels: {counted(scored.false, 'detection')} {'counts' if scored.false == 1 else 'count'} as false, so "
            "the score does not show whether detections are right",
        )
    return Detected(recording, outcome, taken, tuple(remarks))


def _check_unit(readout: Readout | PlainRule, recording: Recording) -> None:
    """Refuse a recording in another unit than the readout's, before its rest, which that unit may lack."""
    source = recorded(recording, hold=False)
    if isinstance(source, Events) and source.intensity is None and readout.unit and are_counts(readout.unit):
        count_ms = readout.unit.removesuffix(" ms").rpartition("/")[2]
        raise ProblemError(
            f"these are events, not counts, and the {readout._WHAT} was trained on {readout.unit}: "
            f"write count_ms = {count_ms} in [event_camera] of a layout file, and the bin, region and polarity of "
            "training"
        )
    readout._check_unit(unit_of(source))


@contextmanager
def _naming(recording: str) -> Iterator[None]:
    """Name the recording that an error is about."""
    try:
        yield
    except ProblemError as error:
        # A wrong argument is none of the recording.
        is_of_argument = error.argument is not None and error.hint is None
        if not is_of_argument and not str(error).startswith(recording):
            error.args = (f"{recording}: {error.args[0]}", *error.args[1:])
        raise
