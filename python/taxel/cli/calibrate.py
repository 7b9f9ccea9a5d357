"""``taxel calibrate``: from readings to N or kPa."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import taxel
from taxel._base.arguments import text
from taxel._base.files import beside, named
from taxel._core import ProblemError
from taxel.calibration._loads import UNITS
from taxel.cli.app import App, Flat
from taxel.cli.task import OutOption, Output, progress, say_warnings
from taxel.options import CalibrateOptions, Reading

app = App(name="calibrate")


@app.default
def calibrate(
    recording: Path,
    /,
    *,
    load: float | None = None,
    start: Annotated[float | None, Parameter(name="--from", metavar="S")] = None,
    stop: Annotated[float | None, Parameter(name="--to", metavar="S")] = None,
    load_unit: str = "N",
    loads: Path | None = None,
    out: OutOption = None,
    options: Flat[CalibrateOptions] = CalibrateOptions(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Calibrate readings (ticks, counts) to N or kPa by a known load or a table.

    The file is written beside the recording, where taxel info and Recording.calibrated find it; a file
    calibration.json is used for all recordings of its folder.

    Example: taxel calibrate weight.mcap --load 9.81 --from 2 --to 4 --tare 1

    Parameters
    ----------
    recording
        A recording of the sensor, with the loads on it if there are any.
    load
        A known load, on the sensor from --from to --to.
    start
        Start of the load, s, on the time scale of taxel info.
    stop
        End of the load, s, on the time scale of taxel info.
    load_unit
        Unit of --load: N (total) or kPa (at every taxel).
    loads
        A .csv of loads: load,unit,from_s,to_s and, for a load on a single taxel, x,y.
    out
        The new file. Default: beside the recording.
    """
    if load is None and (start is not None or stop is not None):
        raise ProblemError("--from and --to give the time of --load: give --load too")
    if start is not None and stop is not None and start > stop:
        raise ProblemError(f"--from {start} and --to {stop} s: --from must not be after --to")
    text("load_unit", load_unit, UNITS)
    opened = reading.open_one(recording)
    file = beside(recording, f"{named(recording).stem}.calibration.json") if out is None else out
    output.check(file)
    with progress(output.json):
        known = [] if loads is None else taxel.tasks.read_loads(loads)
        known += [] if load is None else [taxel.tasks.KnownLoad(load, load_unit, start, stop, place="--load")]
        result = taxel.tasks.calibrate(opened, known, options)
    calibration = result.calibration
    calibration.save(file, overwrite=output.overwrite)
    say_warnings(result.warnings)
    lines = [f"{calibration.described()}: written to {file}"]
    for number, (true, unit, value) in enumerate(calibration.loads, start=1):
        lines.append(f"  load {number}: {true:g} {unit}, calibrated {value:.4g} {unit}")
    if calibration.loads and calibration.residual is None:
        lines.append("  no residual: with this few loads the fit is exact; give more loads to see how good it is")
    output.say({"calibration": str(file), **result.to_dict()}, *lines)
