"""Train a readout on labelled recordings, and score it on data that it was not trained on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import instance
from taxel._base.errors import helped, refused
from taxel._base.messages import collected, counted, warn
from taxel._base.parallel import HERE, Workers
from taxel._base.progress import Forecast, Progress, reporting
from taxel._core import ProblemError
from taxel.detect import Example, Outcome, Readout, Recipe, recipes, score
from taxel.detect.board import of_training
from taxel.detect.clock import constants_ms, off_loads
from taxel.detect.drift import training_data
from taxel.detect.examples import check_examples, sizes_of
from taxel.detect.fit import Fitter
from taxel.detect.floors import TOUCH, held_by_tare, measured_floor
from taxel.detect.folds import count_of_folds
from taxel.detect.judge import judge_by, judge_training
from taxel.detect.readout import run
from taxel.detect.scoring import many_wrong
from taxel.events import Events
from taxel.frames import Frames
from taxel.options import GivenTare, TrainOptions
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.opening import sensors_of
from taxel.tasks.info import sensor_line
from taxel.tasks.labels import (
    GivenLabels,
    are_tables,
    labelled_trials,
    moved,
    references,
    sources_without,
    table_names,
    titles_of,
)
from taxel.tasks.rest import TakenRest, UnknownRestError, rest
from taxel.tasks.train_result import Training

#: Work that takes longer says so before it begins, s.
_LONG_S = 60.0
#: Sensors of more taxels are no columns of a table.
_CHANNELS = 256
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
    labelled = references(labels, opened)
    if not any(labelled):
        titles = titles_of(opened)
        if labels == "notes":
            raise helped(ProblemError(f"notes: names no event in {titles}"), "labels", "give")
        raise refused("labels", f" is {_named(labels)}: names no event in {titles}")
    for table in map(recorded, opened):
        if isinstance(table, Events) and table.intensity is None:
            raise ProblemError(
                "the events have no intensities, but the recipe touch and its encoders need them: for an event camera, "
                "use frames of counts (window_ms = 5 in [event_camera] of a layout file) and the recipe event_counts"
            )
    for each, events in zip(opened, labelled, strict=True):
        like = _like_labels(recorded(each), events)
        if len(like) == 1:
            right = "if it holds labels, not readings, leave it out (leave_out in a layout file)"
            warn(f"{each.name}: {like[0]} alone changes with the labels and hardly else; {right}")
    unlabelled = sources_without(labels, opened, labelled)
    some = [k for k, each in enumerate(opened) if each.label not in unlabelled]
    opened, labelled = [opened[k] for k in some], [labelled[k] for k in some]
    labelled = [moved(events, each, options.shift_ms) for events, each in zip(labelled, opened, strict=True)]
    names = sorted({label for events in labelled for label in events})
    rests = _rests(opened, labelled, options.tare)
    if options.recipe is None and "encoder.name" not in options.changes:
        source = recorded(opened[0])
        known = all(map(_is_rest, rests, opened))
        recipe, why = recipes.chosen(source, names, rests=known)
        update(f"recipe {recipe}, chosen for {why}{', whose rest is not known' * (not known)}", 0, 0)
        options = replace(options, recipe=recipe)
    plan = options._plan(names)
    assert plan is not None
    examples = _examples(opened, labelled, rests, plan)
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
    constants = constants_ms(check_examples(examples))
    examples = [
        example._replace(
            labels={label: times - round(1000.0 * constants.get(label, 0.0)) for label, times in example.labels.items()}
        )
        for example in examples
    ]
    plan = options._plan(names, measured_floor(examples))
    assert plan is not None
    taken = [one for one in rests if isinstance(one, TakenRest)]
    training = _Work(opened, examples, taken, options, update, workers).training(plan)
    return replace(training, unlabelled=unlabelled, constants_ms=constants)


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
    return [names[k] for k, own in at.items() if np.abs(own[:, None] - t).min(axis=0).max() <= 1.5 * step]


def _named(labels: GivenLabels) -> str:
    return table_names(labels) if are_tables(labels) else "given as times"


def _rests(
    opened: Sequence[Recording], labelled: Sequence[Mapping[str, NDArray[np.int64]]], tare: GivenTare | None
) -> list[TakenRest | UnknownRestError]:
    """Return the rest of each recording, or why it is not known."""
    found: list[TakenRest | UnknownRestError] = []
    for recording, events in zip(opened, labelled, strict=True):
        try:
            found.append(rest(recording, tare, events))
        except UnknownRestError as error:
            found.append(error)
    return found


def _is_rest(taken: TakenRest | UnknownRestError, recording: Recording) -> bool:
    """Whether a rest is known, and holds no touch."""
    if isinstance(taken, UnknownRestError):
        return False
    source = recorded(recording)
    return held_by_tare([Example(source, {}, taken.tare)]) < min(TOUCH, source.array.taxels)


def _examples(
    opened: Sequence[Recording],
    labelled: Sequence[Mapping[str, NDArray[np.int64]]],
    rests: Sequence[TakenRest | UnknownRestError],
    plan: Recipe,
) -> list[Example]:
    """Return recordings as examples.

    Where the encoder needs no tare, only plain rules use it, and a recording whose rest is not known has none.
    """
    needed = any(part.tare is None for part in plan.encoder._each() if hasattr(part, "tare"))
    examples = []
    for recording, events, taken in zip(opened, labelled, rests, strict=True):
        if needed and isinstance(taken, UnknownRestError):
            raise taken
        tare = None if isinstance(taken, UnknownRestError) else taken.tare
        group = recording.title.removesuffix(recording.label)
        examples.append(Example(recording, events, tare, group, recording.title))
    return examples


def _within_touches(fitter: Fitter) -> Iterator[str]:
    """Yield the labels of ends of touches that lie within touches, where nothing is learnt."""
    named = [label for label in fitter.labels if recipes.neuron_of("touch", label) == "lift"]
    if fitter.lacks or not named:
        return
    times = {label: np.concatenate(fitter.labels_in(label, fitter.whole)) for label in named}
    for label, count in fitter.inside_loads(named).items():
        if 2 * count > len(times[label]):
            yield (
                f"{label}: {count} of {counted(len(times[label]), 'label')} lie within touches, but {label} is read as "
                "the end of a touch, and nothing within a touch is learnt"
            )


@dataclass(frozen=True)
class _Work:
    """Hold the labelled recordings of a training, and how it is scored."""

    opened: Sequence[Recording]
    examples: Sequence[Example]
    rests: Sequence[TakenRest]
    options: TrainOptions
    update: Progress
    workers: Workers

    def training(self, plan: Recipe) -> Training:
        """Return the readout with its scores, held out where that can be, and its outcomes on the training data.

        Where many labels are missed or false, or none can be learnt, it is said by how much they are off what was felt.
        """
        try:
            training = self._training(plan)
        except ProblemError as error:
            off = off_loads(check_examples(self.examples))
            if off:
                error.args = (f"{error.args[0]}; {off[0]}", *error.args[1:])
            raise
        if many_wrong(training.score):
            lines = off_loads(check_examples(self.examples)) + [sensor_line(recording) for recording in self.opened]
            for line in list(filter(None, lines))[:_LINES]:
                warn(line)
        return training

    def _training(self, plan: Recipe) -> Training:
        folds, window_ms = self.options.folds, self.options.window_ms
        registers = self.opened[0].registers
        frame_us = None if registers is None else registers.frame_us
        fitter = Fitter(self.examples, plan, window_ms=window_ms, frame_us=frame_us, progress=self.update)
        count, why = count_of_folds(fitter.examples) if folds is None else (folds, "" if folds else "folds is 0")
        for line in _within_touches(fitter):
            warn(line)
            self.update(line, 0, 0)
        begun = perf_counter()
        trained = fitter.fit()
        self._say_how_long(perf_counter() - begun, count)
        scored = None
        if count:
            try:
                scored = judge_by(fitter, count, self.workers)
            except ProblemError as error:
                # These folds are the default, not a request, and all of the data may still be learnt from.
                if folds is not None:
                    raise
                count, why = 0, f"a part of the training data cannot be learnt from: {error}"
        if scored is None:
            by_halves = trained.readout._with_rules(trained.readout.rules, fitter.by_rule(fitter.whole))
            scored = judge_training(fitter, trained._replace(readout=by_halves))
        rules = {label: rule for label, rule in scored.plain.rules.items() if rule is not None}
        readout = trained.readout._with_rules(rules, scored.by_rule)
        data = training_data(fitter.examples, scored.together, of_training(self.examples))
        trained = trained._replace(readout=readout._with(training=data))
        return Training(self.options, self.opened, trained, scored, why, self._outcomes(trained.readout), self.rests)

    def _say_how_long(self, once_s: float, folds: int) -> None:
        """Say how long all takes by what one training on all data took, if that is more than a minute."""
        # Each fold trains on its part, and on each half of it.
        trainings = 2 * (folds - 1)
        if once_s * trainings < _LONG_S:
            return
        ground = (
            f"one training on all data took {once_s:.1f} s, and the folds take about as long as {trainings} of them"
        )
        sooner = "fewer recordings, or no folds (--folds 0), are a quick trial"
        self.update(Forecast(f"about {once_s * trainings / 60:.0f} min left: {ground}; {sooner}"), 0, 0)

    def _outcomes(self, readout: Readout) -> list[Outcome]:
        """Return the outcomes of the readout on the recordings that it was trained on."""
        outcomes = []
        for recording, example in zip(self.opened, self.examples, strict=True):
            self.update(f"scoring on {recording.title}", 0, 0)
            truth = {label: np.asarray(example.labels.get(label, []), np.int64) for label in readout.labels}
            detections = run(readout, recording, tare=example.tare)
            scored = score(detections, truth, self.options.window_ms)
            of_recording = Example(recording, truth, example.tare)
            outcomes.append(Outcome(recording.title, of_recording, detections, scored))
        return outcomes
