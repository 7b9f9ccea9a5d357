"""``taxel encode``: a recording to spikes."""

from __future__ import annotations

from pathlib import Path

import taxel
from taxel._core import ProblemError
from taxel.cli.app import App, Flat
from taxel.cli.task import OutArgument, Output, progress, say_warnings
from taxel.options import EncodeOptions, Reading

app = App(name="encode")


@app.default
def encode(
    recording: Path,
    /,
    out: OutArgument,
    *,
    options: Flat[EncodeOptions],
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Encode a recording as spike trains.

    Example: taxel encode walk.mcap walk.npz --encoder level_crossing --set "levels=[40, 80]" --set hold_ms=2

    Parameters
    ----------
    recording
        A recording: .mcap, .lsa, .npz or .csv.
    out
        The new file, a .npz that SpikeTrains.load reads.
    """
    if out.suffix != ".npz":
        raise ProblemError(f"{out}: the name of the spikes' file must end in .npz")
    output.check(out)
    with progress(output.json) as update:
        update(f"reading {recording}", 0, 0)
        encoded = taxel.tasks.encode(reading.open_one(recording), options, progress=update)
    encoded.trains.save(out, overwrite=output.overwrite)
    say_warnings(encoded.warnings)
    result = {"recording": str(recording), **encoded.to_dict(), "written": str(out)}
    output.say(result, f"{encoded.trains!r}, {result['silent_trains']} silent", f"written to {out}")
