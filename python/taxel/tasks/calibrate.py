"""Calibrate readings (ticks, counts) to N or kPa by known loads or a table."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path, finite, instance, several, shown
from taxel._base.arguments import text as checked_text
from taxel._base.errors import helped, unreadable
from taxel._base.header_table import HeaderTable, text_of
from taxel._base.messages import collected
from taxel._base.times import beginning_us
from taxel._core import FormatError, ProblemError
from taxel.calibration import Calibration, Load
from taxel.calibration._loads import UNITS
from taxel.frames import Frames
from taxel.options import CalibrateOptions, GivenTare
from taxel.recording import Recording
from taxel.recording.analysis.pressure import readings
from taxel.recording.analysis.rest import rest


@dataclass(frozen=True)
class KnownLoad:
    """Hold a load that was on the sensor for a while.

    Parameters
    ----------
    load : float, above 0
    unit : {"N", "kPa"}
        Force in all, or the same pressure at every taxel.
    from_s, to_s : float, s, optional
        From when to when, by the board's time, or from the recording's beginning where times count from 1970; default:
        from the beginning, to the end.
    taxel : (int, int), optional
        Column and row of the only taxel that bears it.
    place : str
        Where it is stated, for errors.

    Raises
    ------
    ProblemError : times or a load that are none

    Examples
    --------
    >>> KnownLoad(9.81, from_s=2, to_s=4).unit
    'N'
    """

    load: float
    unit: str = "N"
    from_s: float | None = None
    to_s: float | None = None
    taxel: tuple[int, int] | None = None
    place: str = "load"

    def __post_init__(self) -> None:
        """Refuse times that are none; the load is checked where it is fitted."""
        checked_text("place", self.place)
        for name in ("from_s", "to_s"):
            if getattr(self, name) is not None:
                finite(name, getattr(self, name))


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Hold a calibration.

    Attributes
    ----------
    calibration : Calibration
        Saved by its `save`.
    warnings : tuple of str
    """

    calibration: Calibration
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return what it calibrates, and how well it meets the loads, as plain values for JSON."""
        calibration = self.calibration
        result: dict[str, Any] = {
            "unit": calibration.unit,
            "of": calibration.reading_unit,
            "date": calibration.date,
            "residual": calibration.residual,
        }
        loads = [{"load": load, "unit": unit, "made": total} for load, unit, total in calibration.loads]
        return result | {"loads": loads, "warnings": list(self.warnings)}


def calibrate(
    recording: Recording,
    loads: str | os.PathLike[str] | Sequence[KnownLoad] = (),
    options: CalibrateOptions | None = None,
) -> Calibrated:
    """Calibrate readings (ticks, counts) to N or kPa.

    ``taxel calibrate`` calls this function.

    Parameters
    ----------
    recording : Recording
        Of the sensor, with the loads on it if there are any.
    loads : path or sequence of KnownLoad
        A .csv load,unit,from_s,to_s[,x,y], or the loads.
    options : CalibrateOptions, optional

    Raises
    ------
    ProblemError : nothing to calibrate by, options that contradict each other, nothing recorded under a load
    FormatError : a file that is not a table

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> import taxel
    >>> values = np.full((200, 2, 2), 50.0)
    >>> values[100:] += 30.0
    >>> frames = taxel.Frames(values, 10_000 * np.arange(200), unit="counts", array=taxel.Array(2, 2, 5.0))
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "weight.npz"
    >>> _ = taxel.convert(frames, place)
    >>> made = calibrate(taxel.open(place), [KnownLoad(12.0, from_s=1.2, to_s=1.8)], CalibrateOptions(exponent=1.0))
    >>> made.calibration.reading_unit, made.calibration.unit, [round(one["made"], 6) for one in made.to_dict()["loads"]]
    ('counts', 'N', [12.0])
    """
    instance("recording", recording, Recording)
    options = CalibrateOptions() if options is None else instance("options", options, CalibrateOptions)
    table = isinstance(loads, str | os.PathLike)
    known = read_loads(checked_path("loads", loads)) if table else several("loads", loads)
    if not known and options.table is None:
        raise helped(ProblemError("table and loads are missing, so there is nothing to calibrate by"), "loads", "give")
    if not known and (options.each or options.exponent is not None):
        raise helped(ProblemError("each and exponent are only for a fit to loads"), "loads", "give")
    with collected() as warnings:
        made = _calibrated(recording, [instance("loads", load, KnownLoad) for load in known], options)
    return replace(Calibrated(made), warnings=tuple(warnings))


def _calibrated(recording: Recording, known: Sequence[KnownLoad], options: CalibrateOptions) -> Calibration:
    frames, at_rest, floor = _read(recording, options.tare)
    how: dict[str, Any] = {"unit": options.unit, "rest": at_rest, "floor": floor}
    how |= {"date": options.date, "note": options.note}
    calibration: Calibration | None = None
    if options.table is not None:
        points = _points(Path(options.table))
        calibration = Calibration.table(recording.array, *points, reading_unit=frames.unit, **how)
    measured = [_load(frames, load) for load in known]
    if measured:
        calibration = Calibration.fit(measured, start=calibration, exponent=options.exponent, each=options.each, **how)
    assert calibration is not None  # one of the two is given
    return calibration


def _read(recording: Recording, tare: GivenTare | None) -> tuple[Frames, NDArray[np.float64] | None, float]:
    """Return the readings, those at rest, and the floor above rest from which a taxel counts as loaded."""
    values = readings(recording, None if tare is None else rest(recording, tare))
    if values is None:
        raise ProblemError(f"{recording.path}: contains events without intensities, so there is nothing to calibrate")
    frames, taken, floor = values
    if frames.unit in UNITS:
        raise ProblemError(f"{recording.path}: is in {frames.unit} already; only ticks or counts are calibrated")
    if recording.has_events:
        taken._needed(recording)
    return frames, None if taken.tare is None or taken.source == "unit" else taken.tare.rest, floor


def _load(frames: Frames, known: KnownLoad) -> Load:
    begin_us = beginning_us(frames.t)
    first, last = (None if s is None else begin_us + s * 1e6 for s in (known.from_s, known.to_s))
    loaded = frames.between(float("-inf") if first is None else first, float("inf") if last is None else last)
    if not len(loaded):
        raise ProblemError(f"{known.place}: nothing was recorded{_span(known.from_s, known.to_s)}")
    return Load(loaded, known.load, known.unit, known.taxel)


def _span(start: float | None, stop: float | None) -> str:
    """Return a stretch of time, s, as the end of a sentence; None is the recording's own beginning or end."""
    if stop is None:
        return "" if start is None else f" from {start} s to the end"
    return f" before {stop} s" if start is None else f" from {start} to {stop} s"


def read_loads(path: str | os.PathLike[str]) -> list[KnownLoad]:
    """Read a table of loads, load,unit,from_s,to_s and, for a load on a single taxel, x,y.

    Parameters
    ----------
    path : path

    Returns
    -------
    list of KnownLoad

    Raises
    ------
    FormatError : a file that is not a table (names the line)
    """
    path, loads = Path(checked_path("path", path)), []
    for line, row in _rows(path, ["load", "unit", "from_s", "to_s"]):

        def value(name: str, row: dict[str, str] = row, line: int = line) -> float:
            return _number(path, line, name, row[name])

        location = f"{path.name}, line {line}"
        if row["unit"].strip() not in {"N", "kPa"}:
            raise FormatError(f"{location}: unit is {row['unit']!r}; must be N or kPa")
        taxel = None
        if row.get("x", "").strip() or row.get("y", "").strip():
            x, y = value("x"), value("y")
            if x != int(x) or y != int(y):
                raise FormatError(f"{location}: taxel at row {y:g}, column {x:g}; must be whole numbers")
            taxel = (int(x), int(y))
        unit, stretch = row["unit"].strip(), (value("from_s"), value("to_s"))
        loads.append(KnownLoad(value("load"), unit, *stretch, taxel, location))
    if not loads:
        raise FormatError(f"{path.name}: contains no load")
    return loads


def _rows(path: Path, columns: Sequence[str]) -> list[tuple[int, dict[str, str]]]:
    """Return the line and the cells of each row of a table, which must have these columns."""
    table = HeaderTable.read(path.name, text_of(path))
    table.has(columns)
    return list(table)


def _number(path: Path, line: int, name: str, cell: str) -> float:
    try:
        return finite(name, float(cell))
    except (ValueError, ProblemError):
        raise unreadable(f"{name} is {shown(cell)}; must be a number", path.name, line=line) from None


def _points(path: Path) -> tuple[list[float], list[float]]:
    """Read a table of readings and values."""
    rows = _rows(path, ["reading", "value"])
    readings, values = ([_number(path, line, name, row[name]) for line, row in rows] for name in ("reading", "value"))
    return readings, values
