"""``taxel train``: labelled recordings to a readout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._listening import (
    SET_HELP,
    TARE_HELP,
    assignments,
    open_recording,
    references,
    tare_before,
    tare_of,
    told,
)

__all__ = ["train"]


@app.command()
def train(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings: .mcap, .lsa, .npz or .csv.")],
    labels: Annotated[
        str, typer.Option(help="Reference events: a CSV recording,label,t_us, or notes: the recordings' own.")
    ] = "notes",
    recipe: Annotated[
        str | None,
        typer.Option(
            help="A known recipe: touch (events of a board), gait_plate (counts), gait_insole (N), gait_channel (any "
            "other); or a TOML or JSON file (its path holds a dot or a slash): [encoder], [learner], [neurons.LABEL], "
            "run_threshold. Without it and --encoder: the one that fits the recording."
        ),
    ] = None,
    encoder: Annotated[str | None, typer.Option(help="The encoder's name, short for --set encoder.name=NAME.")] = None,
    values: Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)] = None,
    tare: Annotated[str | None, typer.Option(help=f"{TARE_HELP} Left out: what lies before the first label.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Where the readout goes.")] = Path("readout.json"),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the readout where it exists.")] = False,
    window_ms: Annotated[float, typer.Option(help="Of the score on the training recordings themselves.")] = 50.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Train neurons to say when labelled events happen, and save them as a readout.

    It starts from the recipe that fits the recordings; --recipe, --encoder and --set change that.

    Example: taxel train walk.npz --labels events.csv --set neurons.contact.kappa=1.5 -o gait.json

    Example: taxel train a.mcap b.mcap --labels events.csv --encoder contact_area --tare 0.05
    --set learner.refractory=15 --set neurons.contact.tau=0.5 --set neurons.contact.delay_ms=0.2 -o touch.json
    """
    from taxel._files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Example, Recipe, recipes, run, score  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import train as train_readout  # noqa: PLC0415
    from taxel.detect.training import changed  # noqa: PLC0415

    try_whole(out, overwrite=overwrite)
    changes = assignments(values or [])
    if encoder is not None:
        changes["encoder.name"] = encoder
    if recipe is not None:
        Recipe.load(recipe, changes)  # what is wrong with it is said before the recordings are read
    elif "encoder.name" in changes:
        plan = Recipe.from_dict(changed({}, changes))
    opened = [open_recording(path) for path in recordings]
    with told(as_json) as tell:
        tell("reading")
        happened = references(labels, "--labels", opened)
        if not any(happened):
            raise ProblemError(f"--labels {labels}: names no event in {', '.join(str(one.path) for one in opened)}")
        sources = [one.events if one.has_events else one.frames() for one in opened]
        if recipe is None and "encoder.name" not in changes:
            recipe = recipes.fitting(sources[0])
        if recipe is not None:
            plan = Recipe.load(recipe, changes, sorted({label for events in happened for label in events}))
            tell(f"starting from the recipe {recipe}")
        # An encoder that has a tare needs one.
        rested = tare is not None or getattr(plan.encoder, "tare", True) is not None
        tares = [
            tare_of(tare, one) if rested else tare_before(events, one)
            for one, events in zip(opened, happened, strict=True)
        ]
        examples = [Example(*parts) for parts in zip(sources, happened, tares, strict=True)]
        readout = train_readout(examples, plan, progress=tell)
        scores = []
        for one, example in zip(opened, examples, strict=True):
            tell(f"hearing {one.path} again")
            truth = {label: example.labels.get(label, []) for label in readout.labels}
            scores.append(score(run(readout, one, tare=example.tare), truth, window_ms))
    readout.save(out, overwrite=overwrite)
    result: dict[str, Any] = {
        "readout": str(out),
        "labels": list(readout.labels),
        "recipe": recipe,
        "recordings": [
            {"recording": str(one.path), "score_on_itself": each.to_dict()}
            for one, each in zip(opened, scores, strict=True)
        ],
    }
    if as_json:
        typer.echo(json.dumps(result))
        return
    if recipe is not None:
        typer.echo(f"recipe {recipe}" + (f": {plan.about}" if plan.about else ""))
    typer.echo(repr(readout))
    for one, each in zip(opened, scores, strict=True):
        typer.echo(f"\n{one.path}, on which it was trained (window {window_ms:g} ms):\n{each!r}")
    typer.echo(f"\nwritten to {out}")
