"""``taxel train``: train a readout on labelled recordings."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taxel._base.messages import warn
from taxel._core import ProblemError
from taxel.cli._app import App
from taxel.cli._opening import FileOptions, with_file_options
from taxel.cli._recordings import (
    READ_HELP,
    SET_HELP,
    TARE_HELP,
    assignments,
    labelled_trials,
    progress,
    references,
    tare_before,
    tare_if_any,
    tare_of,
    try_report,
)
from taxel.cli._say import say

if TYPE_CHECKING:
    from taxel.cli._trained import Result
    from taxel.detect import Example, Judged, Outcome, PlainScore, Readout, Recipe
    from taxel.recording import Recording
    from taxel.tare import Tare

__all__ = ["app", "train"]

app = App()


@app.command()
@with_file_options
def train(
    recordings: Annotated[list[Path], typer.Argument(help=f"Recordings: {READ_HELP}, or folders of them.")],
    files: FileOptions,
    labels: Annotated[
        str, typer.Option(help="Reference events: a CSV recording,label,t_us, or notes: the recordings' own notes.")
    ] = "notes",
    recipe: Annotated[
        str | None,
        typer.Option(
            help="The recipe to start from: touch (events of a board; all labels but those of steps on any grid), "
            "gait_plate (counts), gait_insole (N), gait_channel (others); or a TOML or JSON file (a path with a dot or "
            "a slash): [encoder] or [encoders.NAME], [learner], [neurons.LABEL], run_threshold, align. Default, "
            "without --encoder: that which fits the recording and its labels."
        ),
    ] = None,
    encoder: Annotated[
        str | None, typer.Option(help="The encoder's name; the same as --set encoder.name=NAME.")
    ] = None,
    values: Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)] = None,
    tare: Annotated[str | None, typer.Option(help=f"{TARE_HELP} Default: the time before the first label.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file that the readout is written to.")] = Path(
        "readout.json"
    ),
    rule: Annotated[
        Path | None,
        typer.Option(
            help="Write the plain rule to this file, for taxel detect --readout; rules of several labels each to its "
            "own: FILE with the label before its suffix."
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the files if they exist.")] = False,
    window_ms: Annotated[float, typer.Option(help="Largest distance of a detection from its event, ms.")] = 50.0,
    folds: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Score on held-out data, in so many folds: of recordings, or of blocks of time of a single one; 0: on "
            "the training data. Default: at most 5, as many as the recordings and the rarest label allow.",
        ),
    ] = None,
    align: Annotated[
        bool | None,
        typer.Option(help="Move labels to what the sensor felt before they are learnt. Default: as the recipe says."),
    ] = None,
    search: Annotated[
        bool,
        typer.Option(
            "--search", help="Choose each neuron's parameters among those that the recipe lists, on held-out data."
        ),
    ] = False,
    report: Annotated[
        Path | None, typer.Option(help="Write a report to this folder: potential, weights, errors, the worst events.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Train neurons to detect labelled events, and save them as a readout.

    Training starts from the recipe that fits the recordings and labels; --recipe, --encoder and --set change that. The
    score is cross-validated: each fold is scored by neurons that were trained without it. The first line says so, or
    why the score is that of the training data.

    Example: taxel train trials/ -o gait.json
    Example: taxel train walk.npz --labels events.csv --set neurons.contact.kappa=1.5 -o gait.json
    Example: taxel train a.mcap b.mcap --labels events.csv --encoder contact_area --tare 0.05
    --set learner.refractory=15 --set neurons.contact.tau=0.5 --set neurons.contact.delay_ms=0.2 -o touch.json
    """
    from taxel._base.files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import recipes  # noqa: PLC0415
    from taxel.detect.floors import measured_floor  # noqa: PLC0415
    from taxel.recorded import recorded  # noqa: PLC0415

    try_whole(out, overwrite=overwrite)
    if report is not None:
        try_report(report)
    if folds == 1:
        raise ProblemError("--folds 1: must be 2 or more, or 0 for none")
    changes = assignments(values or []) | {
        key: value for key, value in (("encoder.name", encoder), ("align", align)) if value is not None
    }
    _planned(recipe, changes)  # reports errors of the recipe before the recordings are read
    with progress(as_json) as update:
        update(f"reading {', '.join(map(str, recordings[:3]))}" + " ..." * (len(recordings) > 3))
        opened = labelled_trials(labels, files.all(recordings))
        labelled = references(labels, "--labels", opened)
        if not any(labelled):
            table = "; give --labels FILE, a table label,t_us" if labels == "notes" else ""
            raise ProblemError(f"--labels {labels}: names no event in {', '.join(one.title for one in opened)}{table}")
        names = sorted({label for events in labelled for label in events})
        _try_rules(rule, names, overwrite=overwrite)
        if recipe is None and "encoder.name" not in changes:
            recipe, why = recipes.chosen(recorded(opened[0]), names)
            update(f"recipe {recipe}, chosen for {why}")
        plan = _planned(recipe, changes, names)
        assert plan is not None
        if search and not any(len(plan.points_of(label)) > 1 for label in plan.neurons):
            raise ProblemError("--search: the recipe lists no other points, as [neurons.LABEL] search = [{tau = 20.0}]")
        examples = _examples(opened, labelled, tare, plan)
        plan = _planned(recipe, changes, names, measured_floor(examples))
        assert plan is not None
        result, outcomes = _Training(opened, examples, search, window_ms, update).result(plan, folds)
    result.made.readout.save(out, overwrite=overwrite)
    result = replace(result, rules=_write_rules(result.scored.plain, rule, overwrite=overwrite))
    if report is not None:
        from taxel.report import write_listening  # noqa: PLC0415  pictures load slowly

        title, held_out = f"Training of {out}", () if result.why else result.scored.scores
        more: dict[str, Any] = {"held_out": held_out, "alignments": result.made.alignments, "scored": result.scored}
        write_listening(report, result.made.readout, outcomes, title=title, judged=result.how, **more)
    taken = _taken(examples) if tare is None else []
    page = result.page(out, recipe, report, _tares(taken), _tare_again(taken) if tare is None else tare)
    say(*([json.dumps(result.to_dict(out, recipe, report))] if as_json else page))


def _try_rules(place: Path | None, labels: Sequence[str], *, overwrite: bool) -> None:
    """Check that plain rules can be written, before the work whose result they hold."""
    from taxel._base.files import try_whole  # noqa: PLC0415  the command line starts quickly

    for one in () if place is None else (place, *(_of_label(place, label) for label in labels)):
        try_whole(one, overwrite=overwrite)


def _write_rules(plain: PlainScore | None, place: Path | None, *, overwrite: bool) -> dict[Path, list[str]]:
    """Write the plain rules, one of kinds of touch once; return the files, and which labels each detects."""
    if place is None or plain is None:
        return {}
    every = {label: rule for label, rule in plain.rules.items() if rule is not None}
    rules = {rule.to_json(): rule for rule in every.values()}
    written = {}
    for rule in rules.values():
        labels = [label for label in every if label in rule.labels and every[label] == rule]
        path = place if len(rules) == 1 else _of_label(place, labels[0])
        written[rule.save(path, overwrite=overwrite)] = labels
    return written


def _of_label(place: Path, label: str) -> Path:
    """Return the file of the rule of one of several labels."""
    return place.parent / f"{place.stem}.{re.sub('[^A-Za-z0-9_-]', '_', label)}{place.suffix}"


def _taken(examples: Sequence[Example]) -> list[tuple[int, int, int]]:
    """Return from when to when each recording's tare was taken, and how long it lasts, us.

    Of those whose rest is 0 by their unit nothing.
    """
    from taxel.recorded import recorded  # noqa: PLC0415  the command line starts quickly
    from taxel.recording.rest import BY_UNIT  # noqa: PLC0415
    from taxel.spikes import SpikeTrains  # noqa: PLC0415

    spans = []
    for one in examples:
        source = recorded(one.source)
        if one.tare is not None and one.tare.note != BY_UNIT and not isinstance(source, SpikeTrains):
            first = int(source.t[0])
            spans.append((one.tare.start_us - first, one.tare.stop_us - first, int(source.t[-1]) - first))
    return spans


def _tares(spans: Sequence[tuple[int, int, int]]) -> str:
    """Return the line of which tares were taken from the recordings."""
    from taxel.spikes import to_ms  # noqa: PLC0415  the command line starts quickly

    lengths = [to_ms(end - begin) for begin, end, _ in spans]
    said = f"of each of {len(spans)} recordings its own, {min(lengths):g} to {max(lengths):g} ms long" if spans else ""
    if len(spans) == 1:
        said = "what the recording holds from {:g} to {:g} ms".format(*map(to_ms, spans[0][:2]))
    return f"tare: {said}; --tare gives another" if said else ""


def _tare_again(spans: Sequence[tuple[int, int, int]]) -> str:
    """Return the --tare of the seconds that each recording begins with at rest; "" where none needs one."""
    if not spans or any(begin > 0 for begin, *_ in spans):
        return "SECONDS" if spans else ""
    # More than half of a recording is refused.
    return f"{min(min(end, lasts // 2) for _, end, lasts in spans) / 1e6:g}"


def _planned(
    recipe: str | None,
    changes: Mapping[str, Any],
    labels: Sequence[str] | None = None,
    noise_floor: float | None = None,
) -> Recipe | None:
    """Return the recipe that is named, or that of the encoder that is; None of neither."""
    from taxel.detect import Recipe  # noqa: PLC0415  the command line starts quickly
    from taxel.detect.recipe import changed, with_floor  # noqa: PLC0415

    if recipe is None and "encoder.name" in changes:
        values = changed({}, changes)
        return Recipe.from_dict(values if noise_floor is None else with_floor(values, noise_floor))
    return None if recipe is None else Recipe.load(recipe, changes, labels, noise_floor)


def _examples(
    opened: Sequence[Recording], labelled: Sequence[Mapping[str, Any]], tare: str | None, plan: Recipe
) -> list[Example]:
    """Return recordings as examples; if no tare is given, it is taken from each recording.

    Where the encoder needs none, only plain rules use it, and a recording from which it cannot be taken has none.
    """
    from taxel.detect import Example  # noqa: PLC0415

    rests = [part.tare for part in plan.encoder._each() if hasattr(part, "tare")]
    if tare is not None or any(rest is not None for rest in rests):
        rest: Callable[..., Tare | None] = lambda _, one: tare_of(tare, one)  # noqa: E731
    else:
        rest = tare_before if rests else tare_if_any
    return [
        Example(one, events, rest(events, one), one.title.removesuffix(one.label), one.title)
        for one, events in zip(opened, labelled, strict=True)
    ]


@dataclass(frozen=True)
class _Training:
    """Hold the labelled recordings of a training, and how it is scored."""

    opened: Sequence[Recording]
    examples: Sequence[Example]
    search: bool
    window_ms: float
    update: Callable[[str], None]

    def result(self, plan: Recipe, folds: int | None) -> tuple[Result, list[Outcome]]:
        """Return the readout with its scores, held out where that can be, and its outcomes on the training data.

        Say first where values fall from their rest. An error says that too, or by how much labels are off.
        """
        from taxel.detect.advice import fallen  # noqa: PLC0415  the command line starts quickly
        from taxel.detect.examples import checked  # noqa: PLC0415
        from taxel.detect.label_times import off_by  # noqa: PLC0415
        from taxel.detect.plain_score import floor_of  # noqa: PLC0415
        from taxel.detect.training import UNFELT  # noqa: PLC0415

        if fall := fallen(self.examples):
            warn(fall, stacklevel=2)
        try:
            return self._result(plan, folds)
        except ProblemError as error:
            if fall and str(error).endswith(UNFELT):
                raise ProblemError(f"{str(error).removesuffix(UNFELT)}: {fall}") from None
            names = sorted({label for one in self.examples for label in one.labels})
            off = off_by(checked(self.examples), names, floor_of(plan.encoder))
            said = (f"{label}: {one}" for label, one in off.items())
            raise ProblemError("; ".join([str(error), *said])) from None

    def _result(self, plan: Recipe, folds: int | None) -> tuple[Result, list[Outcome]]:
        from taxel.cli._trained import Result  # noqa: PLC0415  the command line starts quickly
        from taxel.detect import choose, judge  # noqa: PLC0415
        from taxel.detect.advice import advised  # noqa: PLC0415
        from taxel.detect.folds import INNER, count_of_folds  # noqa: PLC0415
        from taxel.detect.training import trained  # noqa: PLC0415

        count, why = count_of_folds(self.examples) if folds is None else (folds, "" if folds else "--folds 0")
        scored = None
        if count:
            registers = self.opened[0].registers
            frame_us = None if registers is None else registers.frame_us
            how: dict[str, Any] = {"search": self.search, "window_ms": self.window_ms, "frame_us": frame_us}
            try:
                scored = judge(self.examples, plan, count, **how, progress=self.update)
            except ProblemError as error:
                # These folds are the default, not a request, and all of the data may still be learnt from.
                if folds is not None:
                    raise
                count, why = 0, f"a part of the training data cannot be learnt from: {error}"
        if self.search:
            plan = choose(self.examples, plan, window_ms=self.window_ms, progress=self.update)
        begun = perf_counter()
        made = trained(self.examples, plan, self.update)
        outcomes = self._outcomes(made.readout)
        a_point_s = None if self.search else (perf_counter() - begun) * INNER * (count + 1)
        own = _own(outcomes, self.window_ms)
        if scored is None:
            own = replace(own, plain=self._plain_score(plan, [one.example.labels for one in outcomes]))
        scored = own if scored is None else scored
        advice = advised(made, self.examples, scored.together, own.together, a_point_s, scored.plain)
        return Result(self.opened, made, scored, why, advice, self.window_ms, self.search), outcomes

    def _plain_score(self, plan: Recipe, truths: Sequence[Mapping[str, Any]]) -> PlainScore:
        """Return how plain rules do on the recordings that they were tuned on."""
        from taxel.detect.examples import checked  # noqa: PLC0415
        from taxel.detect.loads import clock_of  # noqa: PLC0415
        from taxel.detect.plain_score import floor_of, plain_score  # noqa: PLC0415

        clocks = [clock_of(one) for one in self.examples]
        rest = checked(self.examples), list(truths[0]), clocks, floor_of(plan.encoder)
        return plain_score(*rest, [], truths, self.window_ms, self.update)

    def _outcomes(self, readout: Readout) -> list[Outcome]:
        """Return the outcomes of the readout on the recordings that it was trained on."""
        from taxel.detect import Example, Outcome, score  # noqa: PLC0415  the command line starts quickly
        from taxel.detect.readout import run_counting  # noqa: PLC0415

        outcomes = []
        for one, example in zip(self.opened, self.examples, strict=True):
            self.update(f"scoring on {one.title}")
            truth = {label: np.asarray(example.labels.get(label, []), np.int64) for label in readout.labels}
            detections, outside = run_counting(readout, one, tare=example.tare)
            own = score(detections, truth, self.window_ms)
            outcomes.append(Outcome(one.title, Example(one, truth, example.tare), detections, own, outside))
        return outcomes


def _own(outcomes: Sequence[Outcome], window_ms: float) -> Judged:
    """Return the scores of a readout on its own training data."""
    from taxel.detect import Judged  # noqa: PLC0415
    from taxel.detect.scoring import score_together  # noqa: PLC0415

    truths = [one.example.labels for one in outcomes]
    together = score_together([one.found for one in outcomes], truths, window_ms)
    return Judged(tuple(one.score for one in outcomes if one.score is not None), together, "its own training data")
