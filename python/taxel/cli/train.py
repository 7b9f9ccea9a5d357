"""``taxel train``: train a readout on labelled recordings."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._recordings import (
    SET_HELP,
    TARE_HELP,
    assignments,
    new_report,
    open_all,
    progress,
    references,
    tare_before,
    tare_of,
)

if TYPE_CHECKING:
    from taxel.detect import Example, Judged, Outcome, Readout, Recipe
    from taxel.events import Events
    from taxel.frames import Frames
    from taxel.recording import Recording

__all__ = ["train"]


@app.command()
def train(
    recordings: Annotated[
        list[Path], typer.Argument(help="Recordings: .mcap, .lsa, .npz, .csv or .h5, or folders of them.")
    ],
    labels: Annotated[
        str, typer.Option(help="Reference events: a CSV recording,label,t_us, or notes: the recordings' own notes.")
    ] = "notes",
    recipe: Annotated[
        str | None,
        typer.Option(
            help="The recipe to start from: touch (events of a board), gait_plate (counts), gait_insole (N), "
            "gait_channel (others); or a TOML or JSON file (a path with a dot or a slash): [encoder], [learner], "
            "[neurons.LABEL], run_threshold. Default, without --encoder: the recipe that fits the recording."
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
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the readout if it exists.")] = False,
    window_ms: Annotated[float, typer.Option(help="Largest distance of a detection from its event, ms.")] = 50.0,
    folds: Annotated[
        int | None,
        typer.Option(
            min=2,
            help="Cross-validate in this many folds: of recordings, or of blocks of time of a single recording.",
        ),
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

    Training starts from the recipe that fits the recordings; --recipe, --encoder and --set change that. With --folds
    the score is cross-validated: each fold is scored by neurons that were trained without it. Without --folds the score
    is that of the training data.

    Example: taxel train trials/ -o gait.json
    Example: taxel train walk.npz --labels events.csv --set neurons.contact.kappa=1.5 -o gait.json
    Example: taxel train a.mcap b.mcap --labels events.csv --encoder contact_area --tare 0.05
    --set learner.refractory=15 --set neurons.contact.tau=0.5 --set neurons.contact.delay_ms=0.2 -o touch.json
    """
    from taxel._base.files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Recipe, choose, judge, recipes  # noqa: PLC0415
    from taxel.detect import train as train_readout  # noqa: PLC0415
    from taxel.detect.training import changed  # noqa: PLC0415

    try_whole(out, overwrite=overwrite)
    if report is not None:
        try_whole(new_report(report))
    changes = assignments(values or [])
    if encoder is not None:
        changes["encoder.name"] = encoder
    if recipe is not None:
        Recipe.load(recipe, changes)  # reports errors of the recipe before the recordings are read
    elif "encoder.name" in changes:
        plan = Recipe.from_dict(changed({}, changes))
    opened = open_all(recordings)
    with progress(as_json) as update:
        update("reading")
        labelled = references(labels, "--labels", opened)
        if not any(labelled):
            raise ProblemError(f"--labels {labels}: names no event in {', '.join(str(one.path) for one in opened)}")
        names = sorted({label for events in labelled for label in events})
        if recipe is None and "encoder.name" not in changes:
            recipe = recipes.fitting(_source(opened[0]), names)
        if recipe is not None:
            plan = Recipe.load(recipe, changes, names)
            update(f"starting from the recipe {recipe}")
        examples = _examples(opened, labelled, tare, plan)
        if search and not any(len(plan.points_of(label)) > 1 for label in plan.neurons):
            raise ProblemError("--search: the recipe lists no other points, as [neurons.LABEL] search = [{tau = 20.0}]")
        judged = None
        if folds is not None:
            registers = opened[0].registers
            frame_us = None if registers is None else registers.frame_us
            judged = judge(
                examples, plan, folds, search=search, window_ms=window_ms, frame_us=frame_us, progress=update
            )
        if search:
            plan = choose(examples, plan, window_ms=window_ms, progress=update)
        readout = train_readout(examples, plan, progress=update)
        outcomes = []
        if judged is None or report is not None:
            outcomes = _on_itself(readout, opened, examples, window_ms, update)
    readout.save(out, overwrite=overwrite)
    trained = _Trained(
        out, readout, recipe, plan, opened, judged or _own(outcomes, window_ms), judged, window_ms, search, report
    )
    if report is not None:
        from taxel.report import write_listening  # noqa: PLC0415  pictures load slowly

        held_out = () if judged is None else judged.scores
        title = f"Training of {out}"
        write_listening(report, readout, outcomes, title=title, judged=trained.how, held_out=held_out)
    typer.echo(json.dumps(trained.to_dict()) if as_json else trained.page())


def _source(recording: Recording) -> Events | Frames:
    from taxel.recorded import recorded  # noqa: PLC0415  the command line starts quickly

    return recorded(recording)


def _examples(
    opened: Sequence[Recording], labelled: Sequence[Mapping[str, Any]], tare: str | None, plan: Recipe
) -> list[Example]:
    """Return recordings as examples; if the encoder needs a tare and none is given, it is taken from each recording."""
    from taxel.detect import Example  # noqa: PLC0415

    needs_rest = tare is None and getattr(plan.encoder, "tare", True) is None
    return [
        Example(one, events, tare_before(events, one) if needs_rest else tare_of(tare, one))
        for one, events in zip(opened, labelled, strict=True)
    ]


def _on_itself(
    readout: Readout,
    opened: Sequence[Recording],
    examples: Sequence[Example],
    window_ms: float,
    update: Callable[[str], None],
) -> list[Outcome]:
    """Return the outcomes of the readout on the recordings that it was trained on."""
    from taxel.detect import Example, Outcome, run, score  # noqa: PLC0415

    outcomes = []
    for one, example in zip(opened, examples, strict=True):
        update(f"scoring on {one.path}")
        truth = {label: np.asarray(example.labels.get(label, []), np.int64) for label in readout.labels}
        detections = run(readout, one, tare=example.tare)
        own = score(detections, truth, window_ms)
        outcomes.append(Outcome(str(one.path), Example(one, truth, example.tare), detections, own))
    return outcomes


def _own(outcomes: Sequence[Outcome], window_ms: float) -> Judged:
    """Return the scores of a readout on its own training data."""
    from taxel.detect import Judged  # noqa: PLC0415
    from taxel.detect.scoring import score_together  # noqa: PLC0415

    truths = [one.example.labels for one in outcomes]
    together = score_together([one.found for one in outcomes], truths, window_ms)
    return Judged(tuple(one.score for one in outcomes if one.score is not None), together, "its own training data")


@dataclass(frozen=True)
class _Trained:
    """The result of a training: the readout, and its scores."""

    out: Path
    readout: Readout
    recipe: str | None
    plan: Recipe
    opened: Sequence[Recording]
    scored: Judged
    judged: Judged | None
    window_ms: float
    searched: bool
    report: Path | None

    @property
    def how(self) -> str:
        """Return on which data the readout was scored."""
        if self.judged is None:
            return "on its own training data"
        one = self.judged.together
        counts = f"{one.found} of {one.events} found, {one.missed} missed, {one.false} false"
        return f"on its own training data; held out ({self.judged.how}): {counts}"

    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values for JSON."""
        result: dict[str, Any] = {
            "readout": str(self.out),
            "labels": list(self.readout.labels),
            "recipe": self.recipe,
            "judged_on": self.scored.how,
            "window_ms": self.window_ms,
            "recordings": [
                {"recording": str(one.path), "score": each.to_dict()}
                for one, each in zip(self.opened, self.scored.scores, strict=True)
            ],
        }
        result["score"] = self.scored.together.to_dict()
        if self.report is not None:
            result["report"] = str(self.report / "report.html")
        if self.searched:
            result["neurons"] = {label: dict(self.plan.neurons[label]) for label in self.readout.labels}
        return result

    def page(self) -> str:
        """Return the result as lines for people."""
        lines = []
        if self.recipe is not None:
            lines.append(f"recipe {self.recipe}" + (f": {self.plan.about}" if self.plan.about else ""))
        lines.append(repr(self.readout))
        for label in self.readout.labels if self.searched else ():
            chosen = ", ".join(f"{key} {value}" for key, value in self.plan.neurons[label].items() if key != "search")
            lines.append(f"{label}, chosen: {chosen}")
        how = "on its own training data" if self.judged is None else f"on held-out data: {self.judged.how}"
        lines.append(f"\n{how} (window {self.window_ms:g} ms)")
        lines += [f"\n{one.path}:\n{each!r}" for one, each in zip(self.opened, self.scored.scores, strict=True)]
        if len(self.scored.scores) > 1:
            lines.append(f"\nall recordings:\n{self.scored.together!r}")
        lines.append(f"\nwritten to {self.out}")
        if self.report is not None:
            lines.append(f"report: {self.report / 'report.html'}")
        return "\n".join(lines)
