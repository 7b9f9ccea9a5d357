"""``taxel train``: train a readout on labelled recordings."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

if TYPE_CHECKING:
    from taxel.detect import PlainScore
    from taxel.recording import Recording
    from taxel.tasks.labels import GivenLabels

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
    rule: Annotated[
        Path | None,
        typer.Option(
            help="Write the plain rule to this file, for taxel detect --readout. If several labels have rules, each "
            "rule is written to a separate file: FILE with the label before its suffix."
        ),
    ] = None,
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
    """Train neurons to detect labelled events, and save them as a readout.

    Training starts from the recipe that fits the recordings and labels; --recipe, --encoder and --set change that. The
    score is cross-validated: each fold is scored by neurons that were trained without it. The first line states that,
    or why the score is that of the training data.

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
        _try_rules(rule, given, opened, overwrite=overwrite)
    say_warnings(unread)  # before the training, which may take long, and again with its result
    with progress(as_json) as update:
        training = taxel.train(opened, given, options, progress=update)
    training.readout.save(out, overwrite=overwrite)
    rules = _write_rules(training.scored.plain, rule, overwrite=overwrite)
    say_warnings(training.warned)
    training = replace(training, warned=(*unread, *training.warned))
    if as_json:
        written: dict[str, Any] = {"rules": {str(path): each for path, each in rules.items()}} if rules else {}
        written |= {} if report is None else {"report": str(report / "report.html")}
        say(json.dumps({"readout": str(out), **training.to_dict(), **written}))
    else:
        following = training.command(str(out))
        say(*training.lines(), "", f"written to {out}" + f"; next: {following}" * bool(following))
        say(*(f"plain rule for {' and '.join(each)} written to {path}" for path, each in rules.items()))
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


def _try_rules(given: Path | None, labels: GivenLabels, recordings: Sequence[Recording], *, overwrite: bool) -> None:
    """Check that plain rules can be written, before the work whose result they hold."""
    from taxel.tasks.labels import references  # noqa: PLC0415

    if given is None:
        return
    with collected():  # the training warns of the same
        names = {label for events in references(labels, recordings) for label in events}
    for path in (given, *(_of_label(given, label) for label in sorted(names))):
        check_writable(path, overwrite=overwrite)


def _write_rules(plain: PlainScore | None, path_given: Path | None, *, overwrite: bool) -> dict[Path, list[str]]:
    """Write the plain rules, one of kinds of touch once; return the files, and which labels each detects."""
    if path_given is None or plain is None:
        return {}
    ruled = {label: rule for label, rule in plain.rules.items() if rule is not None}
    rules = {rule.to_json(): rule for rule in ruled.values()}
    written = {}
    for rule in rules.values():
        labels = [label for label in ruled if label in rule.labels and ruled[label] == rule]
        path = path_given if len(rules) == 1 else _of_label(path_given, labels[0])
        written[rule.save(path, overwrite=overwrite)] = labels
    return written


def _of_label(path: Path, label: str) -> Path:
    """Return the file of the rule of one of several labels."""
    name = re.sub(r"[^\w-]", "_", label)
    return path.parent / f"{path.stem}.{name}{path.suffix}"
