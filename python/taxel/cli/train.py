"""``taxel train``: train a readout on labelled recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import taxel
from taxel._base.messages import collected
from taxel._base.parallel import Workers
from taxel.cli._say import say
from taxel.cli.app import OUTSIDE, App, Flat
from taxel.cli.task import OutArgument, Output, one_or_several, paths_text, progress, say_warnings
from taxel.options import Reading, TrainOptions

app = App(name="train")


@app.default
def train(
    recordings: list[Path],
    /,
    *,
    labels: Annotated[Sequence[str], Parameter(metavar="FILE")] = ("notes",),
    encoder: Annotated[str | None, Parameter(metavar="NAME")] = None,
    align: Annotated[bool | None, Parameter(negative="--no-align")] = None,
    out: OutArgument = Path("readout.json"),
    report: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    options: Flat[TrainOptions] = TrainOptions(),
    workers: Flat[Workers] = Workers(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> int:
    """Train neurons to detect labelled events, tune plain rules beside them, and save both as a readout.

    Training starts from the recipe that fits the recordings and labels; --recipe, --encoder and --set change that. Of
    each label runs what makes fewer mistakes beyond chance, else what is known much earlier, else what makes fewer
    (taxel detect --use: the other).
    The score is cross-validated: each fold is scored by what was made without it. The first line states that, or why
    the score is that of the training data. Exit code 3: no label is detected better than by nothing, and no readout is
    written.

    Example: taxel train trials/ -o gait.json
    Example: taxel train walk.npz --labels events.csv --set neurons.contact.kappa=1.5 -o gait.json
    Example: taxel train a.mcap b.mcap --labels events.csv --encoder contact_area --tare 0.05 -o touch.json

    Parameters
    ----------
    recordings
        Recordings: .mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of a sensor's maker, or folders of them.
    labels
        Reference events: a CSV with the columns recording,label,t_us, or (notes, the default) the recordings' notes.
        May be repeated: a table without a column recording is of the recording that it is named after.
    encoder
        The encoder's name; the same as --set encoder.name=NAME.
    align
        Move labels to what the sensor felt before they are learnt. Default: as the recipe says.
    out
        The file that the readout is written to.
    report
        Write a report to this folder, with potential, weights, errors and the worst events.
    """
    output.check(out)
    output.check_report(report)
    chosen = {key: value for key, value in (("encoder.name", encoder), ("align", align)) if value is not None}
    options = replace(options, changes={**options.changes, **chosen})
    with progress(output.json) as update:
        update(f"reading {paths_text(recordings)}", 0, 0)
        with collected() as unread:
            opened = reading.open_sensors(recordings)
    say_warnings(unread)  # before the training, which may take long, and again with its result
    with progress(output.json) as update:
        training = taxel.train(opened, one_or_several(labels), options, progress=update, workers=workers)
    end = "nothing is written, because no label is detected better than by nothing"
    if training.learnt:
        training.readout.save(out, overwrite=output.overwrite)
        following = training.command(str(out))
        end = f"written to {out}" + f"; next: {following}" * bool(following)
    say_warnings(training.warned)
    training = replace(training, warned=(*unread, *training.warned))
    written = {} if report is None else {"report": str(report / "report.html")}
    output.say(
        {"readout": str(out) if training.learnt else None, **training.to_dict(), **written},
        *training.lines(),
        "",
        end,
        *(f"warning: {warning}" for warning in (*unread, *training.unreliable())),
    )
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
            overwrite=output.overwrite,
        )
        say(*[] if output.json else [f"report: {place}"])
    return 0 if training.learnt else OUTSIDE
