"""``taxel calibrate``: from readings to N or kPa."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

import taxel
from taxel._base.files import beside, check_writable, named
from taxel._core import ProblemError
from taxel.cli._app import App, JsonOption, OverwriteOption
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import progress, say_warnings, tare_option
from taxel.cli._say import say

app = App()


@app.command()
def calibrate(
    recording: Annotated[
        Path, typer.Argument(help="A recording of the sensor, with the loads on it if there are any.")
    ],
    files: FileOptions,
    load: Annotated[float | None, typer.Option(help="A known load, on the sensor from --from to --to.")] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Start of the load, s, on the time scale of taxel info.")
    ] = None,
    stop: Annotated[
        float | None, typer.Option("--to", metavar="S", help="End of the load, s, on the time scale of taxel info.")
    ] = None,
    load_unit: Annotated[str, typer.Option(help="Unit of --load: N (total) or kPa (at every taxel).")] = "N",
    loads: Annotated[
        Path | None,
        typer.Option(help="A .csv of loads: load,unit,from_s,to_s and, for a load on a single taxel, x,y."),
    ] = None,
    table: Annotated[
        Path | None,
        typer.Option(
            help="Use a .csv of reading,value (above rest); with columns x,y for each taxel. Loads, if given, correct "
            "the gain of this table."
        ),
    ] = None,
    unit: Annotated[str, typer.Option(help="Unit of the calibrated values: N or kPa, at a taxel.")] = "N",
    each: Annotated[
        bool, typer.Option("--each", help="Fit a gain for each taxel (needs uniform kPa, or loads on single taxels).")
    ] = False,
    exponent: Annotated[float | None, typer.Option(help="A fixed exponent, which is then not fitted.")] = None,
    tare: Annotated[str | None, tare_option("Default: measured in a quiet part of the recording.")] = None,
    date: Annotated[
        str | None, typer.Option(help="Date of the calibration, for example 2026-11-21. Default: today.")
    ] = None,
    note: Annotated[str, typer.Option(help="A note: which sensor, which weights.")] = "",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The new file. Default: beside the recording.")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Calibrate readings (ticks, counts) to N or kPa by a known load or a table.

    The file is written beside the recording, where taxel info and Recording.calibrated find it; a file
    calibration.json is used for all recordings of its folder.

    Example: taxel calibrate weight.mcap --load 9.81 --from 2 --to 4 --tare 1
    """
    if load is None and (start is not None or stop is not None):
        raise ProblemError("--from and --to give the time of --load: give --load too")
    if start is not None and stop is not None and start > stop:
        raise ProblemError(f"--from {start} and --to {stop} s: --from must not be after --to")
    options = taxel.tasks.CalibrateOptions(table, unit, each, exponent, tare, date, note)
    opened = files.opener.open_one(recording)
    file = beside(recording, f"{named(recording).stem}.calibration.json") if out is None else out
    check_writable(file, overwrite=overwrite)
    with progress(as_json):
        known = [] if loads is None else taxel.tasks.read_loads(loads)
        known += [] if load is None else [taxel.tasks.KnownLoad(load, load_unit, start, stop, place="--load")]
        result = taxel.tasks.calibrate(opened, known, options)
    result.calibration.save(file, overwrite=overwrite)
    say_warnings(result.warnings)
    if as_json:
        say(json.dumps({"calibration": str(file), **result.to_dict()}))
        return
    calibration = result.calibration
    say(f"{calibration.described()}: written to {file}")
    for number, (true, unit_of_load, value) in enumerate(calibration.loads, start=1):
        say(f"  load {number}: {true:g} {unit_of_load}, calibrated {value:.4g} {unit_of_load}")
    if calibration.loads and calibration.residual is None:
        say("  no residual: with this few loads the fit is exact; give more loads to see how good it is")
