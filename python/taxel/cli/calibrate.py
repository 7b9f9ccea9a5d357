"""``taxel calibrate``: from readings to N or kPa."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from taxel._base.files import beside, named
from taxel._core import FormatError, ProblemError
from taxel.cli._app import App
from taxel.cli._opening import FileOptions, with_file_options
from taxel.cli._recordings import TARE_HELP, assignments, progress, tare_of
from taxel.cli._say import say

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from taxel.array import Array
    from taxel.calibration import Calibration, Load
    from taxel.frames import Frames
    from taxel.recording import Recording

__all__ = ["app", "calibrate"]

app = App()


@app.command()
@with_file_options
def calibrate(
    recording: Annotated[
        Path, typer.Argument(help="A recording of the sensor, with the loads on it if there are any.")
    ],
    files: FileOptions,
    load: Annotated[float | None, typer.Option(help="A known load, on the sensor from --from to --to.")] = None,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Start of the load, board time, s.")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="S", help="End of the load, board time, s.")] = None,
    load_unit: Annotated[str, typer.Option(help="Unit of --load: N (total) or kPa (at every taxel).")] = "N",
    loads: Annotated[
        Path | None,
        typer.Option(help="A .csv of loads: load,unit,from_s,to_s and, for a load on a single taxel, x,y."),
    ] = None,
    law: Annotated[
        bool, typer.Option("--law", help="Use the law of the fabric, amplifier and ramp; loads correct its gain.")
    ] = False,
    table: Annotated[
        Path | None,
        typer.Option(
            help="Use a .csv of reading,value (above rest); with columns x,y for each taxel. Loads correct its gain."
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE: a parameter of the law: v_trans, feedback_kohm, exponent ..."),
    ] = None,
    unit: Annotated[str, typer.Option(help="Unit of the calibrated values: N or kPa, at a taxel.")] = "N",
    each: Annotated[
        bool, typer.Option("--each", help="Fit a gain for each taxel (needs uniform kPa, or loads on single taxels).")
    ] = False,
    exponent: Annotated[float | None, typer.Option(help="The exponent, given instead of fitted.")] = None,
    tare: Annotated[str | None, typer.Option(help=f"{TARE_HELP} Default: that of a quiet stretch.")] = None,
    date: Annotated[str | None, typer.Option(help="Date of the calibration, as 2026-11-21. Default: today.")] = None,
    note: Annotated[str, typer.Option(help="A note: which sensor, which weights.")] = "",
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The new file. Default: beside the recording.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file if it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Calibrate readings (ticks, counts) to N or kPa by a known load, a table or the fabric's law.

    The file is written beside the recording, where taxel info and Recording.calibrated find it; a file
    calibration.json is used for all recordings of its folder.

    Example: taxel calibrate weight.mcap --load 9.81 --from 2 --to 4 --tare 1
    """
    from taxel._base.files import try_whole  # noqa: PLC0415  the command line starts quickly
    from taxel.calibration import Calibration  # noqa: PLC0415

    for wrong, why in (
        (
            load is None and (start is not None or stop is not None),
            "--from and --to are the time of --load: give --load",
        ),
        (
            start is not None and stop is not None and start > stop,
            f"--from {start} and --to {stop} s: --from must not be after --to",
        ),
        (
            load is None and loads is None and not law and table is None,
            "nothing to calibrate by: give --load, --loads, --table or --law",
        ),
        (law and table is not None, "--law and --table: one of the two"),
        (bool(set_) and not law, "--set: values of the law; give --law with it"),
        (
            load is None and loads is None and (each or exponent is not None),
            "--each and --exponent belong to a fit: give --load",
        ),
    ):
        if wrong:
            raise ProblemError(why)
    opened = files.one(recording)
    place = beside(recording, f"{named(recording).stem}.calibration.json") if out is None else out
    try_whole(place, overwrite=overwrite)
    with progress(as_json):
        read = _read(opened, tare)
    how: dict[str, Any] = {"unit": unit, "rest": read.rest, "floor": read.floor, "date": date, "note": note}
    calibration: Calibration | None = None
    if law:
        if read.frames.unit != "ticks":
            raise ProblemError(f"--law: turns ticks of a board into {unit}; {recording} holds {read.frames.unit}")
        registers = opened.registers
        ramp = 150.0 if registers is None else float(registers.ramp)
        calibration = Calibration.law(opened.array, ramp=ramp, sensor=assignments(set_ or []), **how)
    elif table is not None:
        calibration = Calibration.table(opened.array, *_points(table, opened.array), of=read.frames.unit, **how)
    measured = [] if loads is None else _loads(loads, read.frames)
    if load is not None:
        measured.append(_load(read.frames, "--load", load, load_unit, (start, stop), None))
    if measured:
        calibration = Calibration.fit(measured, start=calibration, exponent=exponent, each=each, **how)
    assert calibration is not None  # one of the four was given
    calibration.save(place, overwrite=overwrite)
    if as_json:
        result: dict[str, Any] = {"calibration": str(place), "unit": calibration.unit, "of": calibration.of}
        result |= {"date": calibration.date, "residual": calibration.residual}
        result["loads"] = [{"load": a, "unit": b, "made": c} for a, b, c in calibration.loads]
        say(json.dumps(result))
        return
    say(f"{calibration.described()}: written to {place}")
    for number, (true, of, value) in enumerate(calibration.loads, start=1):
        say(f"  load {number}: {true:g} {of}, calibrated {value:.4g} {of}")
    if calibration.loads and calibration.residual is None:
        say("  no residual: no more loads than unknowns, so the fit is exact; further loads show how good it is")


@dataclass(frozen=True)
class _Read:
    """The readings, those at rest, and the floor above rest from which a taxel counts as loaded."""

    frames: Frames
    rest: NDArray[np.float64] | None
    floor: float


def _read(recording: Recording, tare: str | None) -> _Read:
    from taxel.recording.pressure import readings  # noqa: PLC0415

    values = readings(recording, tare_of(tare, recording))
    if values is None:
        raise ProblemError(f"{recording.path}: holds events without intensities, so there is nothing to calibrate")
    frames, rest, floor = values
    if rest.source == "none" and recording.has_events:
        raise ProblemError(f"{recording.path}: the rest of its taxels is not known, as no half second is quiet; --tare")
    known = rest.source not in ("unit", "none")
    return _Read(frames, rest.values.reshape(recording.array.shape) if known else None, floor)


def _load(
    frames: Frames,
    place: str,
    load: float,
    unit: str,
    stretch: tuple[float | None, float | None],
    taxel: tuple[int, int] | None,
) -> Load:
    from taxel.calibration import Load  # noqa: PLC0415

    first, last = (None if s is None else s * 1e6 for s in stretch)
    loaded = frames.between(float("-inf") if first is None else first, float("inf") if last is None else last)
    if not len(loaded):
        raise ProblemError(f"{place}: nothing was recorded{_span(*stretch)}")
    return Load(loaded, load, unit, taxel)


def _span(start: float | None, stop: float | None) -> str:
    """Return a stretch of time, s, as the end of a sentence; None is the recording's own beginning or end."""
    if stop is None:
        return "" if start is None else f" from {start} s on"
    return f" before {stop} s" if start is None else f" from {start} to {stop} s"


def _loads(path: Path, frames: Frames) -> list[Load]:
    """Read a table of loads."""
    from taxel.formats import text  # noqa: PLC0415

    loads = []
    for row in text.table(path, ["load", "unit", "from_s", "to_s"]):
        line = int(row["line"])

        def value(name: str, row: dict[str, str] = row, line: int = line) -> float:
            return text.number(row[name], path, line, name)

        place = f"{path.name}, line {line}"
        if row["unit"].strip() not in {"N", "kPa"}:
            raise FormatError(f"{place}: unit is {row['unit']!r}; must be N or kPa")
        taxel = None
        if row.get("x", "").strip() or row.get("y", "").strip():
            x, y = value("x"), value("y")
            if x != int(x) or y != int(y):
                raise FormatError(f"{place}: taxel at row {y:g}, column {x:g}; must be whole numbers")
            taxel = (int(x), int(y))
        stretch = (value("from_s"), value("to_s"))
        loads.append(_load(frames, place, value("load"), row["unit"].strip(), stretch, taxel))
    if not loads:
        raise FormatError(f"{path.name}: no load in it")
    return loads


def _points(path: Path, array: Array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read a table of readings and values, for all taxels or, with columns x and y, for each that exists."""
    from taxel.formats import text  # noqa: PLC0415

    rows = text.table(path, ["reading", "value"])
    pairs = text.numbers([[row["reading"], row["value"]] for row in rows], path, 2, ["reading", "value"])
    if not rows or "x" not in rows[0] or "y" not in rows[0]:
        return pairs[:, 0], pairs[:, 1]
    places = text.numbers([[row["x"], row["y"]] for row in rows], path, 2, ["x", "y"])
    exists = np.ones(array.shape, bool) if array.exists is None else array.exists
    values = np.unique(pairs[:, 1])
    # Taxels that do not exist get rising values, which are never used.
    every = np.where(exists, np.nan, np.arange(1.0, len(values) + 1)[:, None, None])
    for k, ((x, y), (reading, value)) in enumerate(zip(places, pairs, strict=True), start=2):
        if x != int(x) or y != int(y) or not (0 <= x < array.columns and 0 <= y < array.rows):
            raise FormatError(
                f"{path.name}, line {k}: taxel at row {y:g}, column {x:g}; the array has {array.rows} x {array.columns}"
            )
        every[np.searchsorted(values, value), int(y), int(x)] = reading
    missing = np.argwhere(np.isnan(every))
    if len(missing):
        point, y, x = missing[0]
        raise FormatError(
            f"{path.name}: no reading of row {y}, column {x} under {values[point]:g}; each taxel needs each value"
        )
    return every, values
