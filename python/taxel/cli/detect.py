"""``taxel detect``: what a readout says of a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._listening import TARE_HELP, new_report, open_recording, references, tare_of, told

if TYPE_CHECKING:
    from taxel.detect import Score
    from taxel.detections import Detections

__all__ = ["detect"]

#: Rows of the table that is printed; all go to --csv and --json.
_ROWS = 40


@app.command()
def detect(
    recording: Annotated[Path, typer.Argument(help="A recording: .mcap, .lsa, .npz or .csv.")],
    readout: Annotated[Path, typer.Option(help="A readout that taxel train wrote.")],
    tare: Annotated[str | None, typer.Option(help=TARE_HELP)] = None,
    frame_us: Annotated[
        float | None, typer.Option(help="Length of the board's frame; else the registers', the pictures' or 192.")
    ] = None,
    truth: Annotated[
        str | None, typer.Option(help="Score against a CSV label,t_us or recording,label,t_us, or against notes.")
    ] = None,
    window_ms: Annotated[float, typer.Option(help="How far a detection may lie from its event, either way.")] = 50.0,
    csv: Annotated[Path | None, typer.Option(help="Write the detections to this table.")] = None,
    report: Annotated[
        Path | None, typer.Option(help="A folder for a page: potential, weights, errors, the worst events.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the table where it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Say what happens when in a recording, by a trained readout.

    Example: taxel detect walk.mcap --readout gait.json --truth steps.csv --csv found.csv
    """
    from taxel._files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Readout, run, score  # noqa: PLC0415  the command line starts quickly

    for place in (csv, None if report is None else new_report(report)):
        if place is not None:
            try_whole(place, overwrite=overwrite and place == csv)
    loaded = Readout.load(readout)
    opened = open_recording(recording)
    with told(as_json) as tell:
        events = None if truth is None else references(truth, "--truth", [opened])[0]
        if events is not None and not events:
            raise ProblemError(f"--truth {truth}: names no event in {recording}")
        tell(f"reading {recording}")
        rest = tare_of(tare, opened)
        found = run(loaded, opened, frame_us=frame_us, tare=rest)
    scored = None
    if events is not None:
        # What the readout cannot say it cannot miss.
        scored = score(found, {label: events.get(label, []) for label in loaded.labels}, window_ms)
    if csv is not None:
        found.to_csv(csv, overwrite=overwrite)
    if report is not None:
        from taxel.report import Listened, write_listening  # noqa: PLC0415  pictures load slowly

        source = opened.events if opened.has_events else opened.frames()
        heard = Listened(str(recording), source, found, rest, events, scored)
        write_listening(report, loaded, [heard], title=f"What {readout} says of {recording}")
    written = {"written": csv, "report": None if report is None else report / "report.html"}
    places = {name: str(place) for name, place in written.items() if place is not None}
    if as_json:
        typer.echo(json.dumps(_result(recording, readout, found, scored, window_ms) | places))
        return
    _print(found)
    if scored is not None:
        typer.echo(f"\nagainst {truth} (window {window_ms:g} ms):\n{scored!r}")
    for name, said in places.items():
        typer.echo(f"written to {said}" if name == "written" else f"{name}: {said}")


def _result(
    recording: Path, readout: Path, found: Detections, scored: Score | None, window_ms: float
) -> dict[str, Any]:
    """Return what was found as JSON holds it; `taxel live --json` has the same keys."""
    result: dict[str, Any] = {
        "recording": str(recording),
        "readout": str(readout),
        "detections": [
            {"label": str(label), "t_us": int(t), "known_us": int(known), "slope_mv_per_ms": float(slope)}
            for label, t, known, slope in zip(found.label, found.t, found.known, found.slope, strict=True)
        ],
    }
    return result if scored is None else result | {"window_ms": window_ms, "score": scored.to_dict()}


def _print(found: Detections) -> None:
    typer.echo(repr(found))
    if not len(found):
        return
    width = max(5, *(len(label) for label in found.labels))
    typer.echo(f"{'label':<{width}}  {'t (ms)':>12}  {'known (ms)':>12}  {'slope (mV/ms)':>13}")
    for k in range(min(len(found), _ROWS)):
        row = f"{found.t[k] / 1000:>12.3f}  {found.known[k] / 1000:>12.3f}  {found.slope[k]:>13.4g}"
        typer.echo(f"{found.label[k]:<{width}}  {row}")
    if len(found) > _ROWS:
        typer.echo(f"... and {len(found) - _ROWS} more; --csv and --json give all")
