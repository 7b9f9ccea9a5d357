"""``taxel detect``: what a readout says of a recording."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from taxel._core import ProblemError
from taxel.cli._app import app
from taxel.cli._listening import TARE_HELP, open_recording, references, tare_of, told

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
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the table where it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Say what happens when in a recording, by a trained readout.

    Example: taxel detect walk.mcap --readout gait.json --truth steps.csv --csv found.csv
    """
    from taxel._files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Readout, run, score  # noqa: PLC0415  the command line starts quickly

    if csv is not None:
        try_whole(csv, overwrite=overwrite)
    loaded = Readout.load(readout)
    opened = open_recording(recording)
    with told(as_json) as tell:
        events = None if truth is None else references(truth, "--truth", [opened])[0]
        if events is not None and not events:
            raise ProblemError(f"--truth {truth}: names no event in {recording}")
        tell(f"reading {recording}")
        found = run(loaded, opened, frame_us=frame_us, tare=tare_of(tare, opened))
    scored = None
    if events is not None:
        # What the readout cannot say it cannot miss.
        scored = score(found, {label: events.get(label, []) for label in loaded.labels}, window_ms)
    if csv is not None:
        found.to_csv(csv, overwrite=overwrite)
    if as_json:
        result: dict[str, Any] = {
            "recording": str(recording),
            "readout": str(readout),
            "detections": [
                {"label": str(label), "t_us": int(t), "known_us": int(known), "slope_mv_per_ms": float(slope)}
                for label, t, known, slope in zip(found.label, found.t, found.known, found.slope, strict=True)
            ],
        }
        if scored is not None:
            result |= {"window_ms": window_ms, "score": scored.to_dict()}
        if csv is not None:
            result["written"] = str(csv)
        typer.echo(json.dumps(result))
        return
    typer.echo(repr(found))
    if len(found):
        width = max(5, *(len(label) for label in found.labels))
        typer.echo(f"{'label':<{width}}  {'t (ms)':>12}  {'known (ms)':>12}  {'slope (mV/ms)':>13}")
        for k in range(min(len(found), _ROWS)):
            row = f"{found.t[k] / 1000:>12.3f}  {found.known[k] / 1000:>12.3f}  {found.slope[k]:>13.4g}"
            typer.echo(f"{found.label[k]:<{width}}  {row}")
        if len(found) > _ROWS:
            typer.echo(f"... and {len(found) - _ROWS} more; --csv and --json give all")
    if scored is not None:
        typer.echo(f"\nagainst {truth} (window {window_ms:g} ms):\n{scored!r}")
    if csv is not None:
        typer.echo(f"written to {csv}")
