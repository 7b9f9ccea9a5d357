"""Train a readout on labelled recordings, and score it on data that it was not trained on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance
from taxel._base.messages import collected, counted, warn
from taxel._base.parallel import HERE, Workers
from taxel._base.progress import Announcement, Progress, reporting
from taxel._core import ProblemError
from taxel.detect import Example, Outcome, Recipe, recipes, score
from taxel.detect.board import of_training
from taxel.detect.clock import beside_loads, exchanged, off_loads
from taxel.detect.examples import sizes_of
from taxel.detect.fit import Fitter
from taxel.detect.floors import measured_floor
from taxel.detect.folds import count_of_folds
from taxel.detect.judge import judge_by, judge_training
from taxel.detect.readout import run
from taxel.detect.scoring import many, many_wrong
from taxel.events import Events
from taxel.frames import Frames
from taxel.options import TrainOptions
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.analysis.rest import Rest, rest
from taxel.recording.opening import sensors_of
from taxel.tasks.held_together import held_together
from taxel.tasks.info import sensor_lines
from taxel.tasks.labels import GivenLabels, few, given_labels, labelled_trials, spans
from taxel.tasks.train_result import Training

#: Sensors of more taxels are no columns of a table.
_CHANNELS = 256
#: By so much labels may be off the changes of a column that they are of, us.
_LATE_US = 200_000
#: So many lines say what was measured of labels and sensor.
_LINES = 4


def train(
    recordings: Recording | Sequence[Recording],
    labels: GivenLabels = "notes",
    options: TrainOptions | None = None,
    *,
    progress: Progress | None = None,
    workers: Workers = HERE,
) -> Training:
    """Train neurons to detect labelled events, and score them on held-out data.

    `taxel.train` is this function; ``taxel train`` and the page call it.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What `taxel.open` or, of a folder, `taxel.open_all` returns.
    labels : "notes", path, sequence of path or sequence of mapping
        The recordings' own notes; a table label,t_us or recording,label,t_us; several tables, each of the recording
        that it is named after, or with a column recording; or times (us) by label, one mapping for each recording.
    options : TrainOptions, optional
    progress : function of (step, done, all), optional
    workers : Workers, optional
        Who trains the folds; default: this process alone.

    Returns
    -------
    Training
        Nothing is written; `Training.readout` is saved by its `save`.

    Raises
    ------
    ProblemError : labels that name no event, recordings or options that cannot be trained on
    FormatError : a recipe, a table or a tare that is none

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> import taxel
    >>> values = np.zeros((300, 4, 4))
    >>> begins = range(40, 280, 40)
    >>> for k in begins:
    ...     values[k : k + 15, 1:3, 1:3] = 60.0
    >>> frames = taxel.Frames(values, 10_000 * np.arange(300), unit="N", array=taxel.Array(4, 4))
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "walk.npz"
    >>> _ = taxel.convert(frames, place)
    >>> training = taxel.train(taxel.open(place), [{"contact": [10_000 * k for k in begins]}])
    >>> training.score["contact"].found, training.held_out, training.warnings
    (6, True, ())
    >>> training.readout.labels
    ('contact',)
    """
    options = TrainOptions() if options is None else instance("options", options, TrainOptions)
    update = reporting(progress)
    workers = instance("workers", workers, Workers)
    with collected() as warnings:
        training = _train(sensors_of(recordings), labels, options, update, workers)
    return replace(training, warned=tuple(warnings))


def _train(
    recordings: Sequence[Recording], labels: GivenLabels, options: TrainOptions, update: Progress, workers: Workers
) -> Training:
    opened = labelled_trials(labels, recordings)
    labelled, unlabelled = given_labels(labels, opened, shift_ms=options.shift_ms)
    lasting = spans(labels, opened, options.shift_ms)
    _check(opened, labelled, update)
    some = [k for k, each in enumerate(opened) if each.label not in unlabelled]
    opened, labelled = [opened[k] for k in some], [labelled[k] for k in some]
    lasting = [lasting[k] for k in some]
    names = sorted({label for events in labelled for label in events})
    rests = [rest(recording, options.tare) for recording in opened]
    if options.recipe is None and "encoder.name" not in options.changes:
        source = recorded(opened[0])
        known = all(taken.tare is not None for taken in rests)
        recipe, why = recipes.chosen(source, names, rests=known)
        update(f"recipe {recipe}, chosen for {why}{', whose rest is not known' * (not known)}", 0, 0)
        options = replace(options, recipe=recipe)
    plan = options._plan(names)
    assert plan is not None
    column, held_with = held_together(labels, opened, options.hold_out)
    examples = _examples(opened, labelled, rests, plan)
    examples = [
        example._replace(held_with=of, spans=ends)
        for example, of, ends in zip(examples, held_with, lasting, strict=True)
    ]
    if labels == "notes":
        examples = [
            example._replace(labels_of=each._main.facts.labels_of)
            for example, each in zip(examples, opened, strict=True)
        ]
    if sizes := sizes_of(examples):
        smallest, largest = ("{} x {}".format(*extreme) for extreme in (sizes[0], np.max(sizes, axis=0)))
        warn(
            f"arrays of {len(sizes)} sizes, the smallest {smallest} taxels, are padded at their far edges to {largest}"
        )
    plan = options._plan(names, measured_floor(examples))
    assert plan is not None
    registers = opened[0].registers
    frame_us = None if registers is None else registers.frame_us
    # A rest would follow values that fall within half a second.
    absorb_s = 0.0 if options.absorb_s is None and any(taken.falls for taken in rests) else options.absorb_s
    fitter_of = partial(
        Fitter, recipe=plan, window_ms=options.window_ms, frame_us=frame_us, absorb_s=absorb_s, progress=update
    )
    fitter = fitter_of(examples)
    if constants := _constants(fitter, update):
        examples = [
            example._replace(labels=_earlier(example.labels, constants), spans=_earlier(example.spans, constants))
            for example in examples
        ]
        fitter = fitter_of(examples)
    try:
        training = _trained(opened, examples, rests, options, fitter, constants, update, workers)
    except ProblemError as error:
        if off := off_loads(fitter.examples):
            error.args = (f"{error.args[0]}; {off[0]}", *error.args[1:])
        raise
    # Where many labels are missed or false, it is said by how much they are off what was felt.
    if many_wrong(training.score):
        missed = {
            label for label, of_label in training.score.by_label.items() if 2 * of_label.missed >= of_label.events
        }
        rules = training.readout.rules
        beside = [
            example._replace(
                labels={
                    label: times
                    for label, times in example.labels.items()
                    if label not in rules or rules[label].touched_ms is None
                }
            )
            for example in fitter.examples
        ]
        lines = off_loads(beside, missed) or list(_mistaken(training))
        for line in [*lines, *(line for recording in opened for line in sensor_lines(recording))][:_LINES]:
            warn(line)
    return replace(training, unlabelled=unlabelled, constants_ms=constants, held_by=column)


def _earlier(times: Mapping[str, NDArray[np.int64]], constants: Mapping[str, float]) -> dict[str, NDArray[np.int64]]:
    """Return times of labels less their constants, ms."""
    return {label: each - round(1000.0 * constants.get(label, 0.0)) for label, each in times.items()}


def _check(opened: Sequence[Recording], labelled: Sequence[Mapping[str, NDArray[np.int64]]], update: Progress) -> None:
    """Refuse events without intensities; warn of a channel that is one of labels, and of trials that begin loaded."""
    for each, events in zip(opened, labelled, strict=True):
        table = recorded(each)
        if isinstance(table, Events) and table.intensity is None:
            raise ProblemError(
                "the events have no intensities, but the recipe touch and its encoders need them: for an event camera, "
                "use frames of counts (count_ms = 5 in [event_camera] of a layout file) and the recipe event_counts"
            )
        like = _like_labels(table, events)
        if len(like) == 1:
            right = "if it holds labels, not readings, leave it out (leave_out in a layout file)"
            line = f"{each.name}: {like[0]} alone changes with the labels and hardly else; {right}"
            warn(line)
            update(Announcement(line), 0, 0)
    begun = sum(_begins_with_label(recorded(each), events) for each, events in zip(opened, labelled, strict=True))
    if 2 * begun > len(opened):
        warn(
            f"{begun} of {counted(len(opened), 'recording')} begin loaded, at a label, which no sensor can show: if "
            "the load began the recording, write zeros_before_s = 0.6 in a layout file, to train and to detect"
        )


def _begins_with_label(table: Events | Frames, events: Mapping[str, NDArray[np.int64]]) -> bool:
    """Whether the first frame is loaded, and a label is not later."""
    if not isinstance(table, Frames) or not len(table):
        return False
    return bool(np.any(table.values[0])) and any(np.any(times <= table.t[0]) for times in events.values())


def _constants(fitter: Fitter, update: Progress) -> dict[str, float]:
    """Return by how much the labels of each name are later than what was felt, ms; say where two are exchanged."""
    if any(example.labels_of for example in fitter.examples):
        return {}
    if not (line := exchanged(beside_loads(fitter.examples))):
        return fitter.constants_ms()
    warn(line)
    update(Announcement(line), 0, 0)
    return {}


def _mistaken(training: Training) -> Iterator[str]:
    """Yield when labels are missed, or detections lack one, where most are found; with many of both it is no label."""
    for label, of_label in training.score.by_label.items():
        missed, false = (many(count, of_label.events) for count in (of_label.missed, of_label.false))
        if missed == false or 2 * of_label.missed >= of_label.events:
            continue
        are = "are missed: is each right?" if missed else "are false: does each lack a label?"
        wrong = [one for one in training.scored.mistakes if (one.label, one.is_missed) == (label, missed)]
        yield f"{label} at {few(f'{one.t / 1e6:.3f} s' for one in wrong)} {are}"


def _like_labels(table: Events | Frames, events: Mapping[str, NDArray[np.int64]]) -> list[str]:
    """Return the channels that change at each label, and hardly else: they are columns of labels or states."""
    t = np.concatenate([*events.values(), np.empty(0, np.int64)])
    if not isinstance(table, Frames) or not 1 < table.array.taxels <= _CHANNELS or len(table) < 2 or not len(t):
        return []
    changes = np.diff(table.values.reshape(len(table), -1), axis=0) != 0
    few = np.flatnonzero((changes.sum(axis=0) >= len(t)) & (changes.sum(axis=0) <= 2 * len(t) + 2))
    step = float(np.median(np.diff(table.t)))
    names = table.array.names or [f"channel {k + 1}" for k in range(changes.shape[1])]
    at = {k: table.t[1:][changes[:, k]] for k in few.tolist()}
    found = list[str]()
    for k, own in at.items():
        late = own[:, None] - t
        late = late[np.abs(late).argmin(axis=0), np.arange(len(t))]
        usual = float(np.median(late))
        # Labels may be later than the column by one constant.
        if abs(usual) <= _LATE_US and np.abs(late - usual).max() <= 1.5 * step:
            found.append(names[k])
    return found


def _examples(
    opened: Sequence[Recording],
    labelled: Sequence[Mapping[str, NDArray[np.int64]]],
    rests: Sequence[Rest],
    plan: Recipe,
) -> list[Example]:
    """Return recordings as examples.

    Where the encoder needs no tare, only plain rules use it, and a recording whose rest is not known has none.
    """
    needed = any(part.tare is None for part in plan.encoder._each() if hasattr(part, "tare"))
    examples = []
    for recording, events, taken in zip(opened, labelled, rests, strict=True):
        tare = taken._needed(recording) if needed else taken.tare
        if taken.preload_at:
            warn(f"{recording.path}: the rest is {taken}")
        group = recording.title.removesuffix(recording.label)
        examples.append(Example(recording, events, tare, group, recording.title))
    return examples


def _within_touches(fitter: Fitter) -> Iterator[str]:
    """Yield the labels of ends of touches that lie within touches, where no rule finds them.

    Where a rule does, touches are longer than what it finds the end of, as foam and drift make them.
    """
    lifts = {label for label in fitter.within if recipes.neuron_of("touch", label) == "lift"}
    rules = fitter.rules(fitter.whole) if lifts else {}
    for label in sorted(lifts):
        if rules[label] is None:
            yield f"{label}: most labels lie within touches, but {label} is read as the end of a touch"


def _trained(
    opened: Sequence[Recording],
    examples: Sequence[Example],
    rests: Sequence[Rest],
    options: TrainOptions,
    fitter: Fitter,
    constants: Mapping[str, float],
    update: Progress,
    workers: Workers,
) -> Training:
    """Return the readout with its scores, held out where that can be, and its outcomes on the training data."""
    count, why = options.folds or 0, "folds is 0"
    if options.folds is None:
        count, why = count_of_folds(fitter.examples)
    for line in _within_touches(fitter):
        warn(line)
        update(Announcement(line), 0, 0)
    trained = fitter.fit()
    scored = None
    if count:
        try:
            scored, why = judge_by(fitter, count, workers), ""
        except ProblemError as error:
            # These folds are the default, not a request, and all of the data may still be learnt from.
            if options.folds is not None:
                raise
            why = f"a part of the training data cannot be learnt from: {error}"
    if scored is None:
        by_halves = trained.readout._with_rules(trained.readout.rules, fitter.by_rule(fitter.whole))
        scored = judge_training(fitter, trained._replace(readout=by_halves))
    rules = {label: rule for label, rule in scored.plain.rules.items() if rule is not None}
    readout = trained.readout._with_rules(rules, scored.by_rule)
    data = of_training(examples, scored.together, fitter.noise_floor)
    readout = readout._with(training=data | {"constants_ms": dict(constants)})
    outcomes = []
    for recording, example in zip(opened, examples, strict=True):
        update(f"scoring on {recording.title}", 0, 0)
        truth = {label: np.asarray(example.labels.get(label, []), np.int64) for label in readout.labels}
        detections = run(readout, recording, tare=example.tare)
        of_recording = Example(recording, truth, example.tare, spans=example.spans)
        scored_one = score(detections, truth, options.window_ms, example.spans)
        outcomes.append(Outcome(recording.title, of_recording, detections, scored_one))
    return Training(options, opened, trained._replace(readout=readout), scored, why, outcomes, rests)
