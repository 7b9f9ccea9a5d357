"""``taxel merge``: several recordings as one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

import taxel
from taxel.cli._app import App, JsonOption, OverwriteOption
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import READ_HELP
from taxel.cli._say import say

app = App()


@app.command()
def merge(
    recordings: Annotated[list[Path], typer.Argument(help=f"Recordings: {READ_HELP}.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The new file; its extension gives the format.")],
    files: FileOptions,
    gap: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="S",
            help="Put the recordings one after another, with this pause, s. Default: keep their times.",
        ),
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="Merge only the half second before and after each note with this text.")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Merge recordings: by time, side by side, or the parts around a label in each.

    At the beginning of each recording, a note has the name of its file.

    Example: taxel merge left.mcap right.mcap -o both.mcap
    """
    opened = [files.opener.open_one(path) for path in recordings]
    parts = opened if label is None else [part for each in opened for part in taxel.cut(each, label=label)]
    merged = taxel.merge(parts, gap_us=None if gap is None else gap * 1e6)
    lost = taxel.convert(merged, out, overwrite=overwrite)
    if as_json:
        say(json.dumps({"recordings": [str(path) for path in recordings], "file": str(out), "lost": lost}))
        return
    say(f"written to {out}: {merged!r}", *(f"  lost: {loss}" for loss in lost))
