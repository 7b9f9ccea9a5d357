"""``taxel information``: bits that labelled touches give, by sampling period, number of taxels and time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import taxel
from taxel._base.messages import counted
from taxel._base.parallel import Workers
from taxel._core import ProblemError
from taxel.cli._say import in_columns
from taxel.cli.app import App, Flat
from taxel.cli.task import Output, progress, say_warnings
from taxel.options import InformationOptions, Reading

if TYPE_CHECKING:
    from taxel.information import Answer, Estimate, Point

app = App(name="information")


@app.default
def information(
    recordings: list[Path],
    /,
    *,
    labels: Annotated[str | None, Parameter(metavar="FILE")] = None,
    report: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    options: Flat[InformationOptions] = InformationOptions(),
    workers: Flat[Workers] = Workers(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Estimate how many bits labelled touches give, by sampling period, time, number of taxels and data rate.

    Example: taxel information drops.mcap --labels drops.csv --window-ms 50

    Parameters
    ----------
    recordings
        Recordings, or folders of them: .mcap, .lsa, .npz, .csv, other makers' files.
    labels
        A CSV with a row for each trial: recording,t_us,label[,stop_us][,group]; for a single recording the column
        recording may be left out. Or the word notes: each note of the recordings is a trial that
        begins at the time of the note, and the text of the note is the label. Default: each recording is a trial, and
        its folder's name is the label.
    report
        Write a page with the table and a picture to this .html.
    """
    if report is not None and report.suffix != ".html":
        raise ProblemError(f"--report {report}: the name of the report must end in .html")
    output.check(report)
    with progress(output.json) as update:
        opened = []
        for path in recordings:
            update(f"reading {path}", 0, 0)
            opened += reading.open_sensors([path])
        result = taxel.tasks.information(opened, labels, options, progress=update, workers=workers)
        if report is not None:
            update("drawing", 0, 0)
            taxel.report.write_information(report, result.answer, overwrite=output.overwrite)
    say_warnings(result.warned)
    written = {} if report is None else {"report": str(report)}
    output.say(result.to_dict() | written, *lines(result.answer), *(f"report: {page}" for page in written.values()))


def lines(answer: Answer) -> list[str]:
    """Return the lines that are printed of an answer: what was asked, and one table of all settings."""
    sizes = sorted(set(answer.labels.values()))
    each = f"{sizes[0]}" if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
    trials, labels = counted(sum(answer.labels.values()), "trial"), counted(len(answer.labels), "label")
    full, length = answer.full, answer.control
    text = [
        f"{trials}, {labels} x {each}, {counted(answer.groups, 'group') if answer.groups else 'no groups'}",
        f"labels shuffled: {answer.zero}",
        f"the length alone ({length.about}): {_interval(length.found)}",
        f"full: {full.period_ms:g} ms, {counted(full.taxels, 'taxel')}, to {full.window_ms:g} ms: "
        f"{_interval(full.found)}, {100 * full.found.right:.0f} % right",
        "in brackets: the range of the bits in 95 % of new draws of these trials, or of whole groups; with few trials, "
        "the true bits are outside this range more often",
        *(f"warning: {warning}" for warning in answer.warnings),
        "",
    ]
    head = ("period", "to", "taxels", "bits", "[95 %]", "events", "kbit/s", "silent", "keeps 95 % of the full bits?")
    rows = [(*_cells(point), _verdict(point, answer)) for point in (*answer.points, *answer.taxels)]
    text += [*in_columns([head, *rows]), "", *(f"note: {note}" for note in answer.notes)]
    text.append(f"rates are of {answer.wire}")
    return text


def _verdict(point: Point, answer: Answer) -> str:
    verdict = "" if point.verdict is None else str(point.verdict)
    if point is answer.full:
        verdict = "the full setting"
    return verdict + " <- cheapest" * (point is answer.cheapest and not answer.empty)


def _cells(point: Point) -> tuple[str, ...]:
    low, high = point.found.interval
    return (
        f"{point.period_ms:g} ms",
        f"{point.window_ms:g} ms",
        f"{point.taxels}",
        f"{point.found.bits:.2f}",
        f"[{low:.2f} {high:.2f}]",
        f"{point.events:.4g}",
        f"{point.kbps:.3g}",
        f"{100 * point.silent:.0f} %",
    )


def _interval(estimate: Estimate) -> str:
    low, high = estimate.interval
    return f"{estimate.bits:.2f} of {estimate.most:.2f} bits [{low:.2f} {high:.2f}]"
