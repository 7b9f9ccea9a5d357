"""``taxel export``: readouts for other simulators and for chips."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

import taxel
from taxel._base.messages import installing
from taxel._core import Error
from taxel.cli._app import App, JsonOption, OverwriteOption, with_out
from taxel.cli._say import say

app = App(no_args_is_help=True, help="Write a readout for other simulators and for chips.")


@app.callback()
def _root() -> None:
    """Write a readout for other simulators and for chips."""


@app.command()
@with_out("out")
def nir(
    readout: Annotated[Path, typer.Argument(help="A readout, as taxel train writes it.")],
    out: Annotated[Path, typer.Argument(help="The new file, a .nir.")],
    spike_ms: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            help="Time step (ms) of the simulator that will read the file, if an input spike is a 1 that lasts one "
            "time step (snnTorch: 0.1).",
        ),
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write a readout as a NIR graph, in SI units, and report what the graph cannot represent.

    Example: taxel export nir walk.json walk.nir
    """
    try:
        lost = taxel.Readout.load(readout).to_nir(out, spike_ms=spike_ms, overwrite=overwrite)
    except ModuleNotFoundError as error:
        raise Error(f"{error}: {installing('nir')}") from None
    if as_json:
        say(json.dumps({"readout": str(readout), "written": str(out), "lost": lost}))
        return
    say(f"written to {out}", *(f"  not in NIR: {loss}" for loss in lost))
