"""``taxel detect``: the detections of a readout in a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._recordings import TARE_HELP, new_report, open_all, progress, references, tare_of
from taxel.spikes import to_ms

if TYPE_CHECKING:
    from collections.abc import Sequence

    from taxel.detect import Outcome, Score
    from taxel.detections import Detections

__all__ = ["detect"]

#: No event.
_NONE = np.empty(0, np.int64)
#: Rows of the table that is printed; all go to --csv and --json.
_ROWS = 40


@app.command()
def detect(
    recording: Annotated[
        Path, typer.Argument(help="A recording: .mcap, .lsa, .npz, .csv or .h5, or a folder of them.")
    ],
    readout: Annotated[Path, typer.Option(help="A readout that taxel train wrote.")],
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
    window_ms: Annotated[float, typer.Option(help="Largest distance of a detection from its event, ms.")] = 50.0,
    csv: Annotated[Path | None, typer.Option(help="Write the detections to this .csv.")] = None,
    report: Annotated[
        Path | None, typer.Option(help="Write a report to this folder: potential, weights, errors, the worst events.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the table where it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Detect events in a recording, or in each of a folder, by a trained readout.

    Example: taxel detect walk.mcap --readout gait.json --truth steps.csv --csv found.csv
    """
    from taxel._base.files import try_whole, write_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Example, Outcome, Readout, run, score  # noqa: PLC0415
    from taxel.detect.scoring import score_together  # noqa: PLC0415

    for place in (csv, None if report is None else new_report(report)):
        if place is not None:
            try_whole(place, overwrite=overwrite and place == csv)
    loaded = Readout.load(readout)
    opened = open_all([recording])
    heard = []
    with progress(as_json) as tell:
        events = [None] * len(opened) if truth is None else references(truth, "--truth", opened)
        if truth is not None and not any(events):
            raise ProblemError(f"--truth {truth}: names no event in {recording}")
        for one, happened in zip(opened, events, strict=True):
            tell(f"reading {one.path}")
            rest = tare_of(tare, one)
            found = run(loaded, one, frame_us=frame_us, tare=rest)
            # Labels that the readout does not have do not count as missed.
            wanted = None if happened is None else {label: happened.get(label, _NONE) for label in loaded.labels}
            scored = None if wanted is None else score(found, wanted, window_ms)
            heard.append(Outcome(str(one.path), Example(one, wanted or {}, rest), found, scored))
    truths = [one.example.labels for one in heard if one.score is not None]
    together = score_together([one.found for one in heard], truths, window_ms) if truths else None
    if csv is not None:
        write_whole(csv, lambda file: file.write(_table(heard).encode()), overwrite=overwrite)
    if report is not None:
        from taxel.report import write_listening  # noqa: PLC0415  pictures load slowly

        write_listening(report, loaded, heard, title=f"What {readout} says of {recording}")
    written = {"written": csv, "report": None if report is None else report / "report.html"}
    places = {name: str(place) for name, place in written.items() if place is not None}
    if as_json:
        typer.echo(json.dumps(_result(recording, readout, heard, together, window_ms) | places))
        return
    for said in heard:
        if recording.is_dir() or len(heard) > 1:
            typer.echo(f"{said.name}:")
        _print(said.found)
    if together is not None:
        typer.echo(f"\nagainst {truth} (window {window_ms:g} ms):\n{together!r}")
    for name, path_said in places.items():
        typer.echo(f"written to {path_said}" if name == "written" else f"{name}: {path_said}")


def _result(
    recording: Path, readout: Path, heard: Sequence[Outcome], together: Score | None, window_ms: float
) -> dict[str, Any]:
    """Return what was found as JSON holds it; a detection has the keys that `taxel live --json` gives it."""
    each: list[dict[str, Any]] = [
        {
            "recording": one.name,
            "detections": [
                {"label": d.label, "t_us": d.t, "known_us": d.known, "slope_mv_per_ms": d.slope, "repaired": d.repaired}
                for d in one.found
            ],
        }
        | ({} if one.score is None else {"score": one.score.to_dict()})
        for one in heard
    ]
    if len(each) == 1 and not recording.is_dir():
        result = {"readout": str(readout), **each[0]}
    else:
        result = {"readout": str(readout), "recording": str(recording), "recordings": each}
    return result if together is None else result | {"window_ms": window_ms, "score": together.to_dict()}


def _table(heard: Sequence[Outcome]) -> str:
    """Return the detections as a table; of several recordings each row begins with its recording's name."""
    if len(heard) == 1:
        return heard[0].found._csv()
    lines: list[str] = []
    # One header for all.
    repaired = any(one.found.repaired.any() for one in heard)
    for one in heard:
        head, *rows = one.found._csv(repaired=repaired).splitlines()
        name = '"' + Path(one.name).name.replace('"', '""') + '"'
        lines += [*([] if lines else [f"recording,{head}"]), *(f"{name},{row}" for row in rows)]
    return "\n".join(lines) + "\n"


def _print(found: Detections) -> None:
    typer.echo(repr(found))
    if not len(found):
        return
    width = max(5, *(len(label) for label in found.labels))
    typer.echo(f"{'label':<{width}}  {'t (ms)':>12}  {'known (ms)':>12}  {'slope (mV/ms)':>13}")
    for k in range(min(len(found), _ROWS)):
        row = f"{to_ms(found.t[k]):>12.3f}  {to_ms(found.known[k]):>12.3f}  {found.slope[k]:>13.4g}"
        typer.echo(f"{found.label[k]:<{width}}  {row}")
    if len(found) > _ROWS:
        typer.echo(f"... and {len(found) - _ROWS} more; --csv and --json give all")
