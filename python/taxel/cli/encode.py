"""``taxel encode``: a recording to spikes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from taxel._base.files import try_whole
from taxel._base.messages import counted
from taxel._core import ProblemError, encoder_names
from taxel.cli._app import App, with_out
from taxel.cli._opening import FileOptions, with_file_options
from taxel.cli._recordings import SET_HELP, TARE_HELP, encoder_of, progress, tare_or_by_unit
from taxel.cli._say import say

__all__ = ["app", "encode"]

app = App()


@app.command()
@with_out("out")
@with_file_options
def encode(
    recording: Annotated[Path, typer.Argument(help="A recording: .mcap, .lsa, .npz or .csv.")],
    out: Annotated[Path, typer.Argument(help="The new file, a .npz that SpikeTrains.load reads.")],
    encoder: Annotated[str, typer.Option(help=f"One of {', '.join(encoder_names())}.")],
    files: FileOptions,
    values: Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)] = None,
    tare: Annotated[str | None, typer.Option(help=TARE_HELP)] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace OUT if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Encode a recording as spike trains.

    Example: taxel encode walk.mcap walk.npz --encoder level_crossing --set "levels=[40, 80]" --set hold_ms=2
    """
    if out.suffix != ".npz":
        raise ProblemError(f"{out}: spikes are written to a .npz")
    try_whole(out, overwrite=overwrite)
    chosen = encoder_of(encoder, values or [])
    with progress(as_json) as update:
        update(f"reading {recording}")
        opened = files.one(recording)
        source = opened.events if opened.has_events else opened.frames()
        rest = tare_or_by_unit(tare, opened)
        if rest is not None:
            chosen = chosen.with_tare(rest)
        update(f"encoding {counted(len(source), 'event' if opened.has_events else 'picture')}")
        trains = chosen.encode(opened)
    trains.save(out, overwrite=overwrite)
    counts = trains.counts
    result = {
        "recording": str(recording),
        "encoder": {key: value for key, value in json.loads(chosen.to_json()).items() if key != "tare"},
        "latency_ms": chosen.latency_ms,
        "trains": len(trains),
        "kind": trains.kind,
        "signed": trains.signed,
        "spikes": int(counts.sum()),
        "silent_trains": int(np.count_nonzero(counts == 0)),
        "start_ms": trains.start,
        "stop_ms": trains.stop,
        "written": str(out),
    }
    lines = [f"{trains!r}, {result['silent_trains']} silent", f"written to {out}"]
    say(*([json.dumps(result)] if as_json else lines))
