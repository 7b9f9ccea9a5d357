"""``taxel convert``: from one kind of recording to another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli._app import app, with_out
from taxel.cli._opening import FileOptions, with_file_options
from taxel.cli._recordings import of_source

__all__ = ["convert"]


@app.command()
@with_out("target")
@with_file_options
def convert(
    source: Annotated[Path, typer.Argument(help="A recording: .mcap, .lsa, .npz, .csv or .h5.")],
    target: Annotated[Path, typer.Argument(help="The new file; its extension gives the format.")],
    files: FileOptions,
    frames: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Write frames at this rate (.npz, .csv, .h5) instead of events."),
    ] = None,
    part: Annotated[
        str | None, typer.Option("--source", metavar="NAME", help="The source to convert, of a recording with several.")
    ] = None,
    compression: Annotated[str, typer.Option(help="Compression of a .mcap: none, lz4 or zstd.")] = "none",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the target if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Convert a recording to another format, and report what the target cannot hold.

    Example: taxel convert walk.mcap walk.csv
    """
    import taxel  # noqa: PLC0415  the command line starts quickly
    from taxel._base.files import try_whole  # noqa: PLC0415

    try_whole(target, overwrite=overwrite)
    # The status line is shown on a terminal only, and removed at the end.
    with Console(stderr=True).status(f"{source} to {target}"):
        recording = of_source(files.one(source), part)
        lost = taxel.convert(recording, target, frames_hz=frames, compression=compression, overwrite=overwrite)
    if as_json:
        typer.echo(json.dumps({"source": str(source), "target": str(target), "lost": lost}))
        return
    typer.echo(f"written to {target}")
    for what in lost:
        typer.echo(f"  lost: {what}")
