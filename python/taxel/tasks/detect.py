"""Detect events in recordings by a trained readout or a plain rule, and score them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import isnan
from typing import Any, NamedTuple

import numpy as np

from taxel._base.arguments import finite, instance, shown
from taxel._base.errors import refused
from taxel._base.messages import collected, counted, warn
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.detect import Example, Outcome, PlainRule, Readout, Score, recipes, score
from taxel.detect.cause import Cause
from taxel.detect.detector import detector
from taxel.detect.exchanged import Scored, exchanged
from taxel.detect.floors import measured_floor
from taxel.detect.mistakes import Standing, behind_gaps, causes_of, many_wrong, score_of, unreliable
from taxel.detect.readout import run_counting
from taxel.detect.tares import count_drifted, count_loaded
from taxel.detect.training_data import Unlike, unlike
from taxel.encode import ContactArea, Moments
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded, unit_of
from taxel.recording import Recording
from taxel.recording.analysis.health import Held, health, unchanging_taxels, whole_lines
from taxel.recording.analysis.preload import standing
from taxel.recording.analysis.rest import FORCE_UNITS, of_frames, of_quiet
from taxel.recording.gaps import written_twice
from taxel.recording.opening import sensors_of
from taxel.spikes import SpikeTrains
from taxel.tare import Tare
from taxel.tasks.labels import (
    GivenLabels,
    are_tables,
    check_shift,
    few,
    moved,
    of_other_sources,
    references,
    source_name,
    sources_without,
    table_names,
    titles_of,
)
from taxel.tasks.rest import GivenTare, TakenRest, UnknownRestError, check_tare, given_tare, rest, zero_by_unit

#: At most so many frames are looked at for dead and stuck taxels.
_LOOKS = 2000
#: So many taxels that stick are all named.
_FEW_HELD = 2
#: Causes of a bad score that are of labels or of the recording, not of the readout.
_OF_LABELS = (
    "exchanged_sources",
    "exchanged_names",
    "other_rate",
    "shifted_labels",
    "window",
    "gaps",
    "unlabelled_loads",
    "overlapping_loads",
    "standing_load",
)
#: Those of them that need no advice.
_WITHOUT_ADVICE = ("exchanged_sources", "exchanged_names", "window", "gaps", "standing_load")
#: So many recordings of several are few.
_FEW_BAD = 2
#: The noise is compared with that of the training from so many times that.
_NOISIER = 1.5
#: No event.
_NONE = np.empty(0, np.int64)


@dataclass(frozen=True)
class DetectOptions:
    """Hold how events are detected and scored.

    Parameters
    ----------
    tare : Tare, path or float (s), optional
        The rest of the taxels: a tare, its file, a recording at rest, or the seconds at rest at the beginning of
        each recording. Default: as of `taxel.tasks.rest`.
    frame_us : float, us, optional
        Length of the board's frame. Default: by the registers or the frames, else 192.
    window_ms : float, ms
        Largest distance of a detection from its event.
    shift_ms : float, ms
        By how much labels of the truth are moved before all else, as those of another clock; later is positive.

    Raises
    ------
    ProblemError : values that no recordings could make valid

    Examples
    --------
    >>> DetectOptions(tare=0.5).window_ms
    50.0
    """

    tare: GivenTare | None = None
    frame_us: float | None = None
    window_ms: float = 50.0
    shift_ms: float = 0.0

    def __post_init__(self) -> None:
        """Refuse values that no recordings could make valid, before these are read."""
        check_tare(self.tare)
        finite("frame_us", 1.0 if self.frame_us is None else self.frame_us, "us", least=1.0, most=3.6e9)
        finite("window_ms", self.window_ms, "ms", least=0.0)
        check_shift(self.shift_ms)


@dataclass(frozen=True, eq=False)
class Detected:
    """Hold what was detected in one recording.

    Attributes
    ----------
    recording : Recording
    outcome : taxel.detect.Outcome
        Detections, score and what was outside the range of the training.
    rest : TakenRest, optional
        Which rest was taken; None where the readout needs none.
    remarks : tuple of str
        What may keep detections away or make false ones: gaps, values that fall from their rest, a drifted rest, and in
        what the recording differs from the training.
    """

    recording: Recording
    outcome: Outcome
    rest: TakenRest | None
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the detections as plain values for JSON; a detection has the keys of ``taxel live --json``."""
        verdict, found = self.recording.verdict, self.outcome.score
        return {
            "recording": self.outcome.name,
            "verdict": verdict,
            "verdict_details": verdict.to_dict(),
            "outside": self.outcome.outside,
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
        } | ({} if found is None else {"score": found.to_dict(), "causes": [c.to_dict() for c in self.outcome.causes]})


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
    unlabelled : mapping of str to tuple of str
        The sources that no row of the truth names, by label, where rows name sources: they are not scored for it. No
        sources: the truth has no label of that name, so nothing is scored for it.
    window_ms, shift_ms : float, ms
    unreliable : tuple of str
        The labels whose score is too bad to rely on, in all recordings or in some.
    warnings : tuple of str
    left_out : tuple of str
        The recordings of other arrays than the readout's, beside those that fit, and those without a known rest.
    """

    each: tuple[Detected, ...]
    score: Score | None
    not_scored: tuple[str, ...]
    unlabelled: Mapping[str, tuple[str, ...]]
    window_ms: float
    shift_ms: float = 0.0
    unreliable: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @property
    def outcomes(self) -> list[Outcome]:
        """The outcome of each recording, as a report takes them."""
        return [detected.outcome for detected in self.each]

    def to_dict(self) -> dict[str, Any]:
        """Return the detections and scores as plain values for JSON."""
        result: dict[str, Any] = {
            "recordings": [each.to_dict() for each in self.each],
            "left_out": list(self.left_out),
            "warnings": [*self.unreliable, *self.warnings],
        }
        if self.score is None:
            return result
        unlabelled = {label: list(sources) for label, sources in self.unlabelled.items()}
        asked = {"window_ms": self.window_ms, "shift_ms": self.shift_ms}
        return result | asked | {"score": self.score.to_dict(), "unlabelled": unlabelled}


def detect(
    readout: Readout | PlainRule,
    recordings: Recording | Sequence[Recording],
    truth: GivenLabels | None = None,
    options: DetectOptions | None = None,
    *,
    progress: Progress | None = None,
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

    Returns
    -------
    Detecting

    Raises
    ------
    ProblemError : recordings or a truth that do not fit; a recording that is never quiet, whose readout needs the rest
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
    update = reporting(progress)
    opened = sensors_of(recordings)
    with collected() as warnings:
        events = [] if truth is None else references(truth, opened, "truth")
        if truth is not None and not any(events):
            names = table_names(truth) if are_tables(truth) else truth
            raise refused("truth", f" is {names}: names no event in {titles_of(opened)}")
        unlabelled = {} if truth is None else sources_without(truth, opened, events)
        named = {label for of_recording in events for label in of_recording}
        if named.intersection(readout.labels):
            unlabelled |= {label: () for label in readout.labels if label not in named}
        each_labelled = [
            None if truth is None else moved(events[k], recording, options.shift_ms)
            for k, recording in enumerate(opened)
        ]
        left_out = _of_other_arrays(readout, opened)
        found: list[_Found] = []
        unknown_rests: dict[str, UnknownRestError] = {}
        for recording, labelled in zip(opened, each_labelled, strict=True):
            if left_out and not readout._accepts(recording.array):
                continue
            update(f"detecting in {recording.title}", 0, 0)
            without = {label for label, sources in unlabelled.items() if not sources or recording.label in sources}
            try:
                found.append(_detected(readout, recording, labelled, without, options))
            except UnknownRestError as error:
                of_training = (readout._parts.get("training") or {}).get("noise", 0.0)
                if of_training and error.noise >= _NOISIER * of_training:
                    noisier = f"{error.noise / of_training:.2g} times that of the training"
                    error.args = (f"{error.args[0]}, {noisier}", *error.args[1:])
                unknown_rests[recording.title] = error
        if not found and unknown_rests:
            raise next(iter(unknown_rests.values()))
        for unknown_rest in unknown_rests.values():
            warn(f"left out: {unknown_rest}", stacklevel=2)
        others = {} if truth is None else of_other_sources(truth, opened, each_labelled, options.shift_ms)
        each = tuple(_with_causes(found, others, options.window_ms))
    scored = [outcome for detected in each if (outcome := detected.outcome).score is not None]
    together = score_of(scored, options.window_ms) if scored else None
    unknown = sorted({label for labels_of in events for label in labels_of} - set(readout.labels))
    for label in unknown:
        if alike := [name for name in readout.labels if recipes.spelling(name) == recipes.spelling(label)]:
            warnings.append(
                f"truth has {shown(label)}, the readout {shown(alike[0])}: must be spelt alike to be scored"
            )
    names = (*(recording.title for recording in left_out), *unknown_rests)
    with_labels = [outcome for outcome in scored if outcome.score is not None and outcome.score.events]
    bad = (
        tuple(_unreliable(with_labels, score_of(with_labels, options.window_ms), options.window_ms))
        if with_labels
        else ()
    )
    how = options.window_ms, options.shift_ms
    return Detecting(each, together, tuple(unknown), unlabelled, *how, bad, tuple(warnings), names)


def _with_causes(
    each: Sequence[_Found], others: Mapping[str, Mapping[str, Any]], window_ms: float
) -> Iterator[Detected]:
    """Yield what was detected with the causes of what is missed and false: sources of a recording have the same.

    `others`: the labels of the other sources of each recording, by its title.
    """
    known: dict[str, tuple[Cause, ...]] = {}
    for detected, felt, *_ in each:
        group = felt.example.group
        if group not in known:
            sources = [source for source in each if source.felt.example.group == group]
            scored = [source for source in sources if source.felt.score is not None and source.felt.score.events]
            of_sources = [
                Scored(source.felt, source_name(source.detected.recording), others.get(source.felt.name, {}))
                for source in scored
            ]
            pairs = list(exchanged(of_sources, window_ms))
            mixed_up = {place for _, places in pairs for place in places}
            # All else is measured on the others.
            rest = [source for k, source in enumerate(scored) if k not in mixed_up]
            outcomes, differences = [source.felt for source in rest], [source.differences for source in rest]
            stays = next((source.standing for source in rest if source.standing is not None), None)
            found = causes_of(outcomes, window_ms, differences, stays) if rest else ()
            known[group] = (*(cause for cause, _ in pairs), *found)
        yield replace(detected, outcome=detected.outcome._replace(causes=known[group]))


def _unreliable(outcomes: Sequence[Outcome], together: Score, window_ms: float) -> Iterator[str]:
    """Yield the labels whose score is too bad to rely on, in all recordings or else in some; each has labels."""
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.example.group, []).append(outcome)
    scores = {group: score_of(members, window_ms).by_label for group, members in groups.items()}
    for label, of_all in together.by_label.items():
        causes = [cause for members in groups.values() for cause in members[0].causes]
        text = unreliable(label, of_all, "labels", f"this {_at_fault(label, of_all, causes)} here")
        if text and not _in_few(label, groups, scores, window_ms):
            yield text
            continue
        for group, members in groups.items() if len(groups) > 1 else ():
            of_group = scores[group].get(label)
            if of_group is not None:
                fault = _at_fault(label, of_group, members[0].causes)
                text = unreliable(label, of_group, "labels", f"this {fault} in {group.strip()}")
                # By how much the labels of a recording are off, the score of all does not say.
                yield from ["; ".join(filter(None, (text, of_group.missed_text)))] if text else []


def _in_few(
    label: str,
    groups: Mapping[str, Sequence[Outcome]],
    scores: Mapping[str, Mapping[str, Score]],
    window_ms: float,
) -> bool:
    """Whether a label is unreliable in a few of several recordings, and not in the others together."""
    bad = {group for group, of_group in scores.items() if label in of_group and unreliable(label, of_group[label], "")}
    rest = [outcome for group, members in groups.items() if group not in bad for outcome in members]
    if not bad or len(bad) > _FEW_BAD or 2 * len(bad) > len(groups):
        return False
    of_rest = score_of(rest, window_ms).by_label.get(label)
    return of_rest is not None and not unreliable(label, of_rest, "")


def _at_fault(label: str, scored: Score, causes: Sequence[Cause]) -> str:
    """Return whether a bad score is one of the readout, or by labels and recording, as its causes say, of the score."""
    of_labels = (cause for cause in causes if label in cause.labels and cause.kind in _OF_LABELS)
    count = sum(
        cause.mistakes / len(cause.labels) for cause in of_labels if cause.advice or cause.kind in _WITHOUT_ADVICE
    )
    return "score" if 2 * count >= scored.rank[0] else "readout"


def _of_other_arrays(readout: Readout | PlainRule, recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings that are left out as the readout is of another array, with a warning; none if all are."""
    others = [recording for recording in recordings if not readout._accepts(recording.array)]
    array = readout.array
    if not others or len(others) == len(recordings) or array is None:
        return []
    warn(
        f"left out {counted(len(others), 'recording')} of other arrays than the {array.rows} x {array.columns} taxels "
        f"that the {readout._WHAT} was trained on: {few(recording.title for recording in others)}",
        stacklevel=3,
    )
    return others


class _Found(NamedTuple):
    """The detections in a recording, the same with a rest for what was felt, in what the sensor differs, what stays."""

    detected: Detected
    felt: Outcome
    differences: Sequence[str]
    standing: Standing | None


def _detected(
    readout: Readout | PlainRule,
    recording: Recording,
    labels: Mapping[str, Any] | None,
    without: Collection[str],
    options: DetectOptions,
) -> _Found:
    if recording.verdict.status in ("damaged", "unfinished", "lost", "nothing arrived"):
        # Detections may lack or have wrong times.
        warn(f"{recording.title}: {recording.verdict}", stacklevel=3)
    with _naming(recording.title):
        _check_unit(readout, recording)
        taken = _rest(readout, recording, options.tare)
        if options.tare is None:
            zero_by_unit(recording)  # warns of taxels that do not rest there
        tare, begin_us = (None, None) if taken is None else (taken.tare, taken.detect_from_us)
        found, outside = run_counting(readout, recording, frame_us=options.frame_us, tare=tare, begin_us=begin_us)
    # Labels that the readout does not have do not count as missed.
    named = () if labels is None else tuple(label for label in readout.labels if label not in without)
    true = {} if labels is None else {label: labels.get(label, _NONE) for label in named}
    title = recording.title
    example = Example(recording, true, tare, title.removesuffix(recording.label), title, tuple(without))
    scored = score(example._known(found), true, options.window_ms) if true else None
    outcome = Outcome(title, example, found, scored, outside)
    felt = outcome if tare is not None else outcome._replace(example=example._replace(tare=_quiet(recording)))
    remarks, differs = _remarks(recording, felt, readout)
    if scored is not None and not scored.events:
        remarks.insert(
            0,
            f"0 labels: {counted(scored.false, 'detection')} {'counts' if scored.false == 1 else 'count'} as false, so "
            "the score does not show whether detections are right",
        )
    stays = None if scored is None or not scored.rank[0] else _standing(readout, recording, felt, options)
    return _Found(Detected(recording, outcome, taken, tuple(remarks)), felt, differs.sensor, stays)


def _standing(
    readout: Readout | PlainRule, recording: Recording, outcome: Outcome, options: DetectOptions
) -> Standing | None:
    """Return a load of frames that stays, of a stuck taxel or an object, with the tare that a trial shows to help."""
    source, now = recorded(recording, hold=False), outcome.score
    assert now is not None
    if not isinstance(source, Frames) or are_counts(source.unit):
        return None
    if held := health(source[:: 1 + len(source) // _LOOKS]).held:
        return Standing("; ".join(each.text(source) for each in held))
    where = "" if options.tare is not None else standing(source)
    if not where:
        return None
    text, quiet = f"an object is on the sensor from beginning to end, at {where}", of_quiet(source).quiet_us
    if quiet is None or quiet[0] > source.t[0]:
        return Standing(text)
    seconds = float(np.floor((quiet[1] - quiet[0]) / 1e4) / 100)
    with collected():  # no option states this tare
        tare = given_tare(seconds, recording)
        found, _ = run_counting(readout, recording, frame_us=options.frame_us, tare=tare, begin_us=tare.stop_us)
    tried = score(outcome.example._known(found), outcome.example.labels, options.window_ms)
    if 2 * tried.rank[0] > now.rank[0]:
        return Standing(text)
    trial = f"{tried.found} found and {tried.false} false, instead of {now.found} found and {now.false} false"
    return Standing(f"{text}; tried with it: {trial}", f"--tare {seconds:g}", {"tare": seconds})


def _quiet(recording: Recording) -> Tare | None:
    """Return the rest of frames whose readout needs none, to measure what was felt; None where it is not known."""
    if recording.has_events or not recording.timed:
        return None
    try:
        with collected():
            return rest(recording).tare
    except ProblemError:
        return None


def _check_unit(readout: Readout | PlainRule, recording: Recording) -> None:
    """Refuse a recording in another unit than the readout's, before its rest, which that unit may lack."""
    source = recorded(recording, hold=False)
    if isinstance(source, Events) and source.intensity is None and readout.unit and are_counts(readout.unit):
        window_ms = readout.unit.removesuffix(" ms").rpartition("/")[2]
        raise ProblemError(
            f"these are events, not counts, and the {readout._WHAT} was trained on {readout.unit}: "
            f"add --count-ms {window_ms}, and the --bin, --region and --polarity of training"
        )
    readout._check_unit(unit_of(source))


def _rest(readout: Readout | PlainRule, recording: Recording, tare: GivenTare | None) -> TakenRest | None:
    """Return the rest of a recording; None of one without a rest by its unit, if the readout needs none.

    None of one of another sensor too, which the readout refuses.
    """
    if not readout._accepts(recording.array):
        return None
    source = recorded(recording, hold=False)
    known = tare is not None or (isinstance(source, Frames) and source.unit in FORCE_UNITS)
    return rest(recording, tare) if known or readout._needs_tare else None


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


def noise_floors(readout: Readout | PlainRule) -> list[float]:
    """Return the noise floors above the tare of what a readout reads, in the sensor's unit."""
    if isinstance(readout, PlainRule):
        # The local load tracks the rest.
        return [readout.noise_floor] if readout.quantity != "local_load" else []
    return [float(part.noise_floor) for part in readout.encoder._each() if isinstance(part, ContactArea | Moments)]


def _remarks(recording: Recording, outcome: Outcome, readout: Readout | PlainRule) -> tuple[list[str], Unlike]:
    """Return what may keep detections away or make false ones, and of it in what differs from the training."""
    lines, source, tare = list(_of_gaps(recording, outcome)), recorded(recording, hold=False), outcome.example.tare
    lines += written_twice(source) if isinstance(source, Frames) else []
    if isinstance(source, Frames) and (quiet := of_frames(source)).falls:
        # What else is measured is measured upside down.
        return [*lines, f"rest: {quiet.text(recording.path, recording._turned)}"], Unlike()
    lines += _of_taxels(source)
    floors = noise_floors(readout)
    # Labels that are found show that the rest was right.
    if outcome.score is not None and outcome.score.events and not many_wrong(outcome.score):
        tare = None
    if tare is not None and floors and not isinstance(source, SpikeTrains):
        count = count_drifted(source, tare, max(floors))
        if count:
            lines.append(
                f"rest: {counted(count, 'taxel')} drifted above the tare by more than the noise floor, so that touches "
                "may seem not to end, and other touches may be missed: take a tare between later touches (taxel cut "
                "RECORDING FILE --from S --to S, then --tare FILE); this was not tried"
            )
    if tare is not None and isinstance(source, Frames) and (floor := measured_floor([outcome.example])) is not None:
        count = count_loaded(source, tare, floor)
        if count:
            # Touches are measured above the rest.
            lines.append(
                f"rest: something touches the sensor at the beginning: {counted(count, 'taxel')} read less later, so "
                "touches may be missed: take a tare while nothing touches the sensor (taxel cut RECORDING FILE --from "
                "S --to S, then --tare FILE); this was not tried"
            )
            return lines, Unlike()
    differs = unlike(readout, outcome.example, outcome.found)
    return [*lines, *differs.lines()], differs


def _held(held: Sequence[Held], source: Events | Frames) -> Iterator[str]:
    """Yield which taxels stick at a value after some time: the first of many, and the row or column of all."""
    if len(held) <= _FEW_HELD:
        yield from (f"stuck taxel: {each.text(source)}" for each in held)
        return
    rows, columns = {each.y for each in held}, {each.x for each in held}
    line = f" in row {rows.pop()}" if len(rows) == 1 else f" in column {columns.pop()}" if len(columns) == 1 else ""
    yield f"{len(held)} stuck taxels{line}, for example {held[0].text(source)}"


def _of_taxels(source: Events | Frames | SpikeTrains) -> Iterator[str]:
    """Yield how many taxels are dead, and how many are stuck; nothing of counts, of which pixels may have no event."""
    if isinstance(source, SpikeTrains) or (isinstance(source, Frames) and are_counts(source.unit)):
        return
    if isinstance(source, Frames):
        # What is dead or stuck is so in some of many frames too.
        source = source[:: 1 + len(source) // _LOOKS]
    of_taxels = health(source)
    masks = {"dead": of_taxels.dead, "stuck": of_taxels.stuck, "unchanging": unchanging_taxels(of_taxels, source)}
    lines, within = whole_lines(masks, source.array)
    yield from (f"{line} (taxel info lists them)" for line in lines)
    yield from _held(of_taxels.held, source)
    for held in of_taxels.held:
        within[held.y, held.x] = True
    for word, mask in masks.items():
        if (rest := mask & ~within).any():
            y, x = np.argwhere(rest)[0]
            faulty = counted(int(rest.sum()), f"{word} taxel")
            yield f"{faulty}, for example column {x}, row {y} (taxel info lists them)"


def _of_gaps(recording: Recording, outcome: Outcome) -> Iterator[str]:
    """Yield where the recording has gaps, and which detections may have happened in one."""
    if gaps := recording._gaps():
        yield f"{gaps}: nothing is detected there"
        behind = outcome.found[behind_gaps(outcome.example, outcome.found)]
        if len(behind):
            at = [
                f"{label} at {(t - outcome.begin_us) / 1e6:.3f} s"
                for label, t in zip(behind.label, behind.t, strict=True)
            ]
            yield f"may have happened in a gap that ends just before them: {few(at)}"
