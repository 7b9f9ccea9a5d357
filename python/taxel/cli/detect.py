"""``taxel detect``: the detections of a readout in a recording."""

from __future__ import annotations

import csv
import io
import json
from contextlib import contextmanager
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taxel._base.messages import counted, warn
from taxel._base.times import begun
from taxel._core import ProblemError
from taxel.cli._app import App
from taxel.cli._opening import FileOptions, with_file_options
from taxel.cli._recordings import (
    READ_HELP,
    TARE_HELP,
    end_of_rest_us,
    progress,
    references,
    tare_or_by_unit,
    try_report,
)
from taxel.cli._say import say
from taxel.spikes import SpikeTrains, to_ms

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from taxel.detect import Outcome, PlainRule, Readout, Score
    from taxel.recording import Recording, Verdict

__all__ = ["app", "detect"]

app = App()

#: No event.
_NONE = np.empty(0, np.int64)
#: Rows of the table that is printed; all go to --csv and --json.
_ROWS = 40


@app.command()
@with_file_options
def detect(
    recording: Annotated[Path, typer.Argument(help=f"A recording: {READ_HELP}, or a folder of them.")],
    readout: Annotated[Path, typer.Option(help="A readout that taxel train wrote, or a plain rule.")],
    files: FileOptions,
    tare: Annotated[str | None, typer.Option(help=TARE_HELP)] = None,
    frame_us: Annotated[
        float | None,
        typer.Option(help="Length of the board's frame, us. Default: by the registers or the frames, else 192."),
    ] = None,
    truth: Annotated[
        str | None,
        typer.Option(
            help="Score against a CSV label,t_us or recording,label,t_us, or notes: the recordings' own notes."
        ),
    ] = None,
    window_ms: Annotated[
        float, typer.Option(min=0.0, help="Largest distance of a detection from its event, ms.")
    ] = 50.0,
    csv: Annotated[Path | None, typer.Option(help="Write the detections to this .csv.")] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write a report to this folder: potential, weights, errors, the worst events.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the table if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Detect events in a recording, or in each of a folder, by a trained readout or a plain rule.

    Example: taxel detect walk.mcap --readout gait.json --truth steps.csv --csv found.csv
    """
    from taxel._base.arguments import finite  # noqa: PLC0415  the command line starts quickly
    from taxel._base.files import try_whole, write_whole  # noqa: PLC0415
    from taxel.detect import Example, Outcome, Readout, load, score  # noqa: PLC0415
    from taxel.detect.readout import run_counting  # noqa: PLC0415
    from taxel.detect.scoring import score_together  # noqa: PLC0415

    if csv is not None:
        try_whole(csv, overwrite=overwrite)
    if report is not None:
        try_report(report)
    finite("frame_us", 1.0 if frame_us is None else frame_us, "us", least=1.0, most=3.6e9)
    loaded = load(readout)
    outcomes = []
    with progress(as_json) as update:
        update(f"reading {recording}")
        opened = files.all([recording])
        events = [None] * len(opened) if truth is None else references(truth, "--truth", opened)
        if truth is not None and not any(events):
            raise ProblemError(f"--truth {truth}: names no event in {recording}")
        for one, labelled in zip(opened, events, strict=True):
            update(f"detecting in {one.title}")
            _warn_of_losses(one)
            rest = tare_or_by_unit(tare, one)
            with _naming(one.title, readout):
                begin_us = end_of_rest_us(tare, rest)
                detections, outside = run_counting(loaded, one, frame_us=frame_us, tare=rest, begin_us=begin_us)
            # Labels that the readout does not have do not count as missed.
            true = None if labelled is None else {label: labelled.get(label, _NONE) for label in loaded.labels}
            scored = None if true is None else score(detections, true, window_ms)
            outcomes.append(Outcome(one.title, Example(one, true or {}, rest), detections, scored, outside))
    truths = [one.example.labels for one in outcomes if one.score is not None]
    together = score_together([one.found for one in outcomes], truths, window_ms) if truths else None
    if csv is not None:
        write_whole(csv, lambda file: file.write(_table(outcomes).encode()), overwrite=overwrite)
    if report is not None:
        from taxel.report import write_listening  # noqa: PLC0415  pictures load slowly

        write_listening(report, loaded, outcomes, title=f"Detections of {readout} in {recording}")
    written = {"written": csv, "report": None if report is None else report / "report.html"}
    places = {name: str(path) for name, path in written.items() if path is not None}
    if as_json:
        verdicts = [one.verdict for one in opened]
        say(json.dumps(_result(recording, readout, loaded, outcomes, verdicts, together, window_ms) | places))
        return
    for outcome in outcomes:
        if recording.is_dir() or len(outcomes) > 1:
            say(f"{outcome.name}:")
        _print(outcome, loaded)
        if isinstance(loaded, Readout):
            say(outcome.outside_text)
    if together is not None:
        say("", f"against {truth} (window {window_ms:g} ms):", *repr(together).split("\n"))
        say(*_not_scored(events, loaded.labels))
    for name, path in places.items():
        say(f"written to {path}" if name == "written" else f"{name}: {path}")


def _warn_of_losses(recording: Recording) -> None:
    """Warn of what was lost or damaged, as detections may lack or have wrong times."""
    if recording.verdict.status in ("damaged", "unfinished", "lost", "nothing arrived"):
        warn(f"{recording.title}: {recording.verdict}", stacklevel=2)


@contextmanager
def _naming(recording: str, readout: Path) -> Iterator[None]:
    """Name the recording and the readout that an error is about; of a missing tare not the part that needs it."""
    try:
        yield
    except ProblemError as error:
        lacks_tare = " without a tare: " in str(error)
        said = (
            "the readout needs the taxels' rest: give --tare SECONDS at rest, or --tare FILE" if lacks_tare else error
        )
        raise ProblemError(f"{recording}, by {readout}: {said}") from None


def _result(
    recording: Path,
    readout: Path,
    loaded: Readout | PlainRule,
    outcomes: Sequence[Outcome],
    verdicts: Sequence[Verdict],
    together: Score | None,
    window_ms: float,
) -> dict[str, Any]:
    """Return the detections as plain values for JSON; a detection has the keys of `taxel live --json`."""
    each: list[dict[str, Any]] = [
        {
            "recording": one.name,
            "verdict": verdict,
            "verdict_details": verdict.to_dict(),
            "outside": one.outside,
            "hint": _hint(one, loaded),
            "detections": [
                {
                    "label": d.label,
                    "t_us": d.t,
                    "known_us": d.known,
                    "slope_mv_per_ms": None if isnan(d.slope) else d.slope,
                    "repaired": d.repaired,
                }
                for d in one.found
            ],
        }
        | ({} if one.score is None else {"score": one.score.to_dict()})
        for one, verdict in zip(outcomes, verdicts, strict=True)
    ]
    if len(each) == 1 and not recording.is_dir():
        result = {"readout": str(readout), **each[0]}
    else:
        result = {"readout": str(readout), "recording": str(recording), "recordings": each}
    return result if together is None else result | {"window_ms": window_ms, "score": together.to_dict()}


def _hint(outcome: Outcome, readout: Readout | PlainRule) -> str | None:
    """Return what may keep detections away or make false ones: values that fall from their rest, or a drifted rest."""
    from taxel.detect import PlainRule, Readout  # noqa: PLC0415  the command line starts quickly
    from taxel.detect.advice import drifted  # noqa: PLC0415
    from taxel.encode import ContactArea, Moments  # noqa: PLC0415
    from taxel.frames import Frames  # noqa: PLC0415
    from taxel.recorded import recorded  # noqa: PLC0415
    from taxel.recording.rest import of_pictures  # noqa: PLC0415

    source, tare = recorded(outcome.example.source, hold=False), outcome.example.tare
    if isinstance(source, Frames) and (rest := of_pictures(source)).falls:
        return f"rest: {rest.text(getattr(outcome.example.source, 'path', None))}"
    # The local load tracks the rest.
    floors = [readout.noise_floor] if isinstance(readout, PlainRule) and readout.quantity != "local_load" else []
    for part in readout.encoder._each() if isinstance(readout, Readout) else ():
        floors += [float(part.noise_floor)] if isinstance(part, ContactArea | Moments) else []
    if tare is None or not floors or isinstance(source, SpikeTrains):
        return None
    count = drifted(source, tare, max(floors))
    what = (
        f"rest: {counted(count, 'taxel')} drifted above the tare by more than the noise floor, so that lifts are missed"
    )
    return f"{what}: take another tare" if count else None


def _table(outcomes: Sequence[Outcome]) -> str:
    """Return the detections as a table; of several recordings each row begins with its recording's name."""
    if len(outcomes) == 1:
        return outcomes[0].found._csv()
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    # All recordings share one header.
    repaired = any(one.found.repaired.any() for one in outcomes)
    for one in outcomes:
        # A label may hold line breaks.
        head, *rows = csv.reader(io.StringIO(one.found._csv(repaired=repaired), newline=""))
        name = '"' + Path(one.name).name.replace('"', '""') + '"'
        if not text.tell():
            table.writerow(["recording", *head])
        for row in rows:
            text.write(f"{name},")
            table.writerow(row)
    return text.getvalue()


def _not_scored(events: Sequence[Mapping[str, object] | None], labels: Sequence[str]) -> list[str]:
    """Return a line that names the labels of the truth which the readout does not have; none where it has all."""
    unknown = sorted({label for of in events if of is not None for label in of} - set(labels))
    return [f"not scored, as the readout has {', '.join(labels)}: {', '.join(unknown)}"] if unknown else []


def _print(outcome: Outcome, readout: Readout | PlainRule) -> None:
    """Print detections, with times from the recording's beginning on, and what may have kept others away."""
    from taxel.detections import Detections  # noqa: PLC0415  the command line starts quickly

    found, begin_us = outcome.found, outcome.begin_us
    detections = Detections._of(found.label, found.t - begin_us, found.known - begin_us, found.slope)
    say(repr(detections))
    if (hint := _hint(outcome, readout)) is not None:
        say(hint)
    if not len(detections):
        return
    if begin_us:
        say(f"times are from {begun(begin_us)} on")
    width = max(5, *(len(label) for label in detections.labels))
    first = detections[:_ROWS]
    # A plain rule has no slope; levels of pictures come in steps, and may give one for all.
    sloped = len({f"{slope:.4g}" for slope in detections.slope}) > 1
    say(f"{'label':<{width}}  {'t (ms)':>12}  {'known (ms)':>12}" + f"  {'slope (mV/ms)':>13}" * sloped)
    for label, t, known, slope in zip(first.label, first.t, first.known, first.slope, strict=True):
        say(f"{label:<{width}}  {to_ms(t):>12.3f}  {to_ms(known):>12.3f}" + f"  {slope:>13.4g}" * sloped)
    if len(detections) > _ROWS:
        say(f"... and {len(detections) - _ROWS} more; --csv and --json hold all")
