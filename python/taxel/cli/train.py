"""``taxel train``: train a readout on labelled recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import taxel
from taxel._base.files import check_writable
from taxel._base.messages import collected
from taxel.cli._app import App, JsonOption, OverwriteOption
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import (
    READ_HELP,
    SET_HELP,
    ReportOption,
    assignments,
    one_or_several,
    paths_text,
    progress,
    say_warnings,
    tare_option,
    try_report,
)
from taxel.cli._say import say

app = App()


@app.command()
def train(
    recordings: Annotated[list[Path], typer.Argument(help=f"Recordings: {READ_HELP}, or folders of them.")],
    files: FileOptions,
    labels: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FILE",
            help="Reference events: a CSV with the columns recording,label,t_us, or (notes, the default) the "
            "recordings' notes. May be repeated: a table without a column recording is of the recording that it is "
            "named after.",
        ),
    ] = None,
    recipe: Annotated[
        str | None,
        typer.Option(
            help="The recipe to start from. touch: for events of a board, and for frames of a grid if labels are not "
            "of steps; event_counts: for counts of an event camera; gait_plate, gait_insole, gait_channel: for steps, "
            "in counts, in N, and in other units. Or the path (with a dot or a slash) of a TOML or JSON file with "
            "[encoder] or [encoders.NAME], [learner], [neurons.LABEL], run_threshold and align. Default, without "
            "--encoder: the recipe that fits the recording and its labels."
        ),
    ] = None,
    encoder: Annotated[
        str | None, typer.Option(metavar="NAME", help="The encoder's name; the same as --set encoder.name=NAME.")
    ] = None,
    values: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help=SET_HELP)] = None,
    tare: Annotated[str | None, tare_option("Default: the time before the first label.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="The file that the readout is written to.")] = Path(
        "readout.json"
    ),
    overwrite: OverwriteOption = False,
    window_ms: Annotated[float, typer.Option(help="Largest distance of a detection from its event, ms.")] = 50.0,
    folds: Annotated[
        int | None,
        typer.Option(
            help="Number of folds for scores on held-out data: folds of recordings, or of blocks of time in a single "
            "recording. 0: score on the training data. Default: at most 5, as many as the recordings and the "
            "rarest label allow.",
        ),
    ] = None,
    align: Annotated[
        bool | None,
        typer.Option(help="Move labels to what the sensor felt before they are learnt. Default: as the recipe says."),
    ] = None,
    shift_ms: Annotated[
        float,
        typer.Option(help="First move all labels by this many ms, for example if their times are of another clock."),
    ] = 0.0,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Train neurons to detect labelled events, tune plain rules beside them, and save both as a readout.

    Training starts from the recipe that fits the recordings and labels; --recipe, --encoder and --set change that. Of
    each label the neuron or the rule runs, whichever is better (taxel detect --use runs the other one). The score is
    cross-validated: each fold is scored by what was made without it. The first line states that, or why the score is
    that of the training data.

    Example: taxel train trials/ -o gait.json
    Example: taxel train walk.npz --labels events.csv --set neurons.contact.kappa=1.5 -o gait.json
    Example: taxel train a.mcap b.mcap --labels events.csv --encoder contact_area --tare 0.05
    --set learner.refractory=15 --set neurons.contact.tau=0.5 --set neurons.contact.delay_ms=0.2 -o touch.json
    """
    check_writable(out, overwrite=overwrite)
    if report is not None:
        try_report(report, overwrite=overwrite)
    given = one_or_several(labels or ["notes"])
    changes = assignments(values or []) | {
        key: value for key, value in (("encoder.name", encoder), ("align", align)) if value is not None
    }
    options = taxel.tasks.TrainOptions(recipe, changes, tare, folds, window_ms, shift_ms)
    with progress(as_json) as update:
        update(f"reading {paths_text(recordings)}", 0, 0)
        with collected() as unread:
            opened = files.opener.open_sensors(recordings)
    say_warnings(unread)  # before the training, which may take long, and again with its result
    with progress(as_json) as update:
        training = taxel.train(opened, given, options, progress=update)
    training.readout.save(out, overwrite=overwrite)
    say_warnings(training.warned)
    training = replace(training, warned=(*unread, *training.warned))
    if as_json:
        written = {} if report is None else {"report": str(report / "report.html")}
        say(json.dumps({"readout": str(out), **training.to_dict(), **written}))
    else:
        following = training.command(str(out))
        say(*training.lines(), "", f"written to {out}" + f"; next: {following}" * bool(following))
        say(*(f"warning: {warning}" for warning in (*unread, *training.unreliable())))
    if report is not None:  # last, so that nothing is lost where it fails
        place = taxel.report.write_detections(
            report,
            training.readout,
            training.outcomes,
            title=f"Training of {out}",
            judged=training.how,
            held_out=training.scored.scores if training.held_out else (),
            scored=training.scored,
            warnings=training.warnings,
            printed=training.lines(),
            overwrite=overwrite,
        )
        say(*[] if as_json else [f"report: {place}"])
