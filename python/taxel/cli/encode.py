"""``taxel encode``: a recording to spikes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

import taxel
from taxel._base.files import check_writable
from taxel._core import ProblemError, encoder_names
from taxel.cli._app import App, JsonOption, OverwriteOption, with_out
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import SET_HELP, assignments, progress, say_warnings, tare_option
from taxel.cli._say import say

app = App()


@app.command()
@with_out("out")
def encode(
    recording: Annotated[Path, typer.Argument(help="A recording: .mcap, .lsa, .npz or .csv.")],
    out: Annotated[Path, typer.Argument(help="The new file, a .npz that SpikeTrains.load reads.")],
    encoder: Annotated[str, typer.Option(metavar="NAME", help=f"One of {', '.join(encoder_names())}.")],
    files: FileOptions,
    values: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help=SET_HELP)] = None,
    tare: Annotated[str | None, tare_option()] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Encode a recording as spike trains.

    Example: taxel encode walk.mcap walk.npz --encoder level_crossing --set "levels=[40, 80]" --set hold_ms=2
    """
    if out.suffix != ".npz":
        raise ProblemError(f"{out}: the name of the spikes' file must end in .npz")
    check_writable(out, overwrite=overwrite)
    options = taxel.tasks.EncodeOptions(encoder, assignments(values or []), tare)
    with progress(as_json) as update:
        update(f"reading {recording}", 0, 0)
        encoded = taxel.tasks.encode(files.opener.open_one(recording), options, progress=update)
    encoded.trains.save(out, overwrite=overwrite)
    say_warnings(encoded.warnings)
    result = {"recording": str(recording), **encoded.to_dict(), "written": str(out)}
    lines = [f"{encoded.trains!r}, {result['silent_trains']} silent", f"written to {out}"]
    say(*([json.dumps(result)] if as_json else lines))
