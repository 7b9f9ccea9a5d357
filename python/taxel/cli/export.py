"""``taxel export``: readouts for other simulators and for chips."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import taxel
from taxel._base.messages import installing
from taxel._core import Error
from taxel.cli.app import App, Flat
from taxel.cli.task import OutArgument, Output

app = App(name="export", help="Write a readout for other simulators and for chips.")


@app.command
def nir(
    readout: Path,
    /,
    out: OutArgument,
    *,
    spike_ms: Annotated[float | None, Parameter(metavar="MS")] = None,
    output: Flat[Output] = Output(),
) -> None:
    """Write a readout as a NIR graph, in SI units, and report what the graph cannot represent.

    Example: taxel export nir walk.json walk.nir

    Parameters
    ----------
    readout
        A readout, as taxel train writes it.
    out
        The new file, a .nir.
    spike_ms
        Time step (ms) of the simulator that will read the file, if an input spike is a 1 that lasts one time step
        (snnTorch: 0.1).
    """
    try:
        lost = taxel.Readout.load(readout).to_nir(out, spike_ms=spike_ms, overwrite=output.overwrite)
    except ModuleNotFoundError as error:
        raise Error(f"{error}: {installing('nir')}") from None
    result = {"readout": str(readout), "written": str(out), "lost": lost}
    output.say(result, f"written to {out}", *(f"  not in NIR: {loss}" for loss in lost))
