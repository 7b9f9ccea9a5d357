"""Conversion of a sensor's readings to N or kPa, for one array on one day."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from datetime import date as day
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import checked_path, finite, flag, instance, mapping, number, numbers, several, shown
from taxel._base.arguments import text as checked_text
from taxel._base.columns import frozen
from taxel._base.documents import of_json
from taxel._base.errors import refused
from taxel._base.files import beside, named
from taxel._base.messages import counted, escaped, first_line
from taxel._base.saved import Saved
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.calibration._curves import Curve, Values, curve_of, power, table
from taxel.calibration._loads import UNITS, Load, Measured, best_exponent, gains, same
from taxel.frames import Frames
from taxel.tare import Tare

__all__ = ["Calibration", "Load"]


class Calibration(Saved):
    """Convert readings to N on each taxel, or kPa at each taxel, for one array on one day.

    Made by `Calibration.table`, `Calibration.fit`, `Calibration.load` or `Calibration.from_json`.
    A value is ``gain * curve(reading, rest)``, 0 where a taxel does not read more than `floor` above its rest.

    taxel finds the calibration of ``walk.mcap`` if it is saved beside it as ``walk.calibration.json``, or, for all
    recordings of the folder, as ``calibration.json``.

    Attributes
    ----------
    array : Array
        The sensor; frames of a sensor with other rows, columns or taxels are refused.
    unit : {"N", "kPa"}
    reading_unit : str
        Unit of the readings: "ticks" of a board, "counts" of a file.
    gain : float64, shape (rows, columns)
    rest : float64, shape (rows, columns), or None
        Readings of the taxels without a load; NaN where it is not known, and such taxels give 0.
    floor : float, in readings
        The noise floor: a reading that is no more than this above rest is not a load.
    date : str
        The day, for example 2026-11-21.
    residual : float or None
        Root mean square of the fit's errors, each as a share of its known load; None if there were no more loads than
        unknowns, so that the fit is exact.
    loads : tuple of (float, str, float)
        The loads of a fit: each load, its unit, and the load that the calibration computes from the frames under it.
    note : str

    Raises
    ------
    ProblemError : the class is called; use `table`, `fit`, `load` or `from_json`

    Examples
    --------
    >>> array = Array(1, 2, pitch_mm=10.0, name="two")
    >>> light = Load(Frames([[[20.0, 10.0]]], [0], array=array), 3.0)
    >>> calibration = Calibration.fit([light], exponent=1.0, date="2026-11-21")
    >>> calibration
    Calibration(counts to N, power 1, fit to 1 load, 2026-11-21, of two: 1 x 2 taxels)
    >>> calibration.apply(Frames([[[40.0, 0.0]]], [0], array=array)).values
    array([[[4., 0.]]], dtype=float32)
    """

    _WHAT = "calibration"

    array: Array
    unit: str
    reading_unit: str
    gain: NDArray[np.float64]
    rest: NDArray[np.float64] | None
    floor: float
    date: str
    residual: float | None
    loads: tuple[tuple[float, str, float], ...]
    note: str
    _curve: Curve

    def __init__(self) -> None:
        raise ProblemError("Calibration: make one by Calibration.table or .fit, or load one by Calibration.load")

    @classmethod
    def _made(cls, array: Array, curve: Curve, unit: str, reading_unit: str, how: Mapping[str, Any]) -> Calibration:
        """Build a calibration from its parts, and check them."""
        calibration = cls.__new__(cls)
        calibration.array, calibration._curve = instance("array", array, Array), curve
        calibration.unit, calibration.reading_unit = (
            checked_text("unit", unit, UNITS),
            checked_text("reading_unit", reading_unit),
        )
        if not reading_unit or reading_unit in UNITS:
            raise refused("reading_unit", f" is {reading_unit!r}: must be the unit of the readings: ticks, counts")
        calibration.gain = _by_taxel("gain", how.get("gain", 1.0), array)
        if not (np.isfinite(calibration.gain) & (calibration.gain > 0)).all():
            raise refused("gain", ": must be above 0 and finite at every taxel")
        rest = how.get("rest")
        if isinstance(rest, Tare):
            same(array, rest.array, "the tare")
            rest = rest.rest
        calibration.rest = None if rest is None else _by_taxel("rest", rest, array)
        calibration.floor = finite("floor", how.get("floor", 0.0), least=0.0)
        calibration.date = _iso(how.get("date"))
        residual = how.get("residual")
        calibration.residual = None if residual is None else finite("residual", residual, least=0.0)
        calibration.loads = tuple(how.get("loads", ()))
        calibration.note = checked_text("note", how.get("note", ""))
        return calibration

    @classmethod
    def table(
        cls,
        array: Array,
        readings: ArrayLike,
        values: ArrayLike,
        *,
        unit: str,
        reading_unit: str = "counts",
        rest: Tare | ArrayLike | None = None,
        floor: float = 0.0,
        date: str | None = None,
        note: str = "",
    ) -> Calibration:
        """Interpolate linearly between known points, the same for all taxels.

        Parameters
        ----------
        array : Array
        readings : float64, shape (points,), above rest, rising
        values : float64, shape (points,), in `unit`, rising
            A first point (0, 0) is added. Above the last point the last value is used.
        unit : {"N", "kPa"}
        reading_unit : str
            Unit of the readings.
        rest : Tare or float64, shape (rows, columns), in the unit `reading_unit`, optional
            Default: 0.
        floor : float, in the unit `reading_unit`, 0 or more
        date : str, optional
            Default: today.
        note : str

        Raises
        ------
        ProblemError : points that do not rise, or a tare of another array

        Examples
        --------
        >>> table = Calibration.table(Array(1, 1), [10.0, 30.0], [1.0, 5.0], unit="kPa", date="2026-11-21")
        >>> table.apply(Frames([[[5.0]], [[20.0]], [[99.0]]], [0, 1, 2])).values.ravel()
        array([0.5, 3. , 5. ], dtype=float32)
        """
        how = {"rest": rest, "floor": floor, "date": date, "note": note}
        return cls._made(array, table(readings, values), unit, reading_unit, how)

    @classmethod
    def fit(
        cls,
        loads: Sequence[Load],
        *,
        unit: str = "N",
        start: Calibration | None = None,
        exponent: float | None = None,
        each: bool = False,
        rest: Tare | ArrayLike | None = None,
        floor: float = 0.0,
        date: str | None = None,
        note: str = "",
    ) -> Calibration:
        """Fit a calibration to known loads laid on the array.

        The gain is that with the least squares of relative error. If the loads differ, the exponent of the curve is
        fitted too; if another exponent fits as well, a warning names it.

        Parameters
        ----------
        loads : list of Load, one or more
            All of one array and in one unit of readings.
        unit : {"N", "kPa"}
            Unit of the calibration. To convert between N and kPa, the area of each taxel must be known.
        start : Calibration, optional
            The calibration whose curve is fitted; else a power of the reading.
        exponent : float, above 0, optional
            Exponent of the value as a function of the reading, if it is not to be fitted. Default: fitted; if all loads
            are alike, 1.
        each : bool
            A separate gain for each taxel that a load determines: uniform pressure (kPa), or a load on one
            taxel. The other taxels keep the common gain.
        rest : Tare or float64, shape (rows, columns), in the unit of the readings, optional
            Default: the rest of `start`, or 0.
        floor : float, in the unit of the readings, 0 or more
        date : str, optional
            Default: today.
        note : str

        Raises
        ------
        ProblemError : no load, loads of several arrays or units, a load under which nothing is read

        Examples
        --------
        >>> weight = Load(Frames([[[20.0]], [[20.0]]], [0, 1000]), 5.0)
        >>> fitted = Calibration.fit([weight], date="2026-11-21")
        >>> fitted.apply(Frames([[[40.0]]], [0])).values.ravel()
        array([10.], dtype=float32)
        """
        checked_text("unit", unit, UNITS)
        measured = [instance("loads", load, Load) for load in several("loads", loads)]
        if not measured:
            raise refused("loads", " is empty: must contain at least one load")
        array, reading_unit = instance("frames", measured[0].frames, Frames).array, measured[0].frames.unit
        curve = Curve()
        if start is not None:
            instance("start", start, Calibration)
            same(array, start.array, "start")
            if (start.reading_unit, start.unit) != (reading_unit, unit):
                raise ProblemError(
                    f"start converts {start.reading_unit} to {start.unit}: must convert {reading_unit} to {unit}"
                )
            curve, rest = start._curve, start.rest if rest is None else rest
        fitted = cls._made(array, curve, unit, reading_unit, {"rest": rest, "floor": floor, "date": date, "note": note})
        units, at_rest = (reading_unit, unit), fitted._rest(None)
        known = [Measured.of(load, k, array, units, at_rest, fitted.floor) for k, load in enumerate(measured, start=1)]
        is_fitted = exponent is None and curve.points is None and len({load.load for load in measured}) > 1
        if exponent is not None:
            if curve.points is not None:
                raise refused("exponent", ": a table has no exponent; only the gain of a table is fitted")
            curve = power(exponent)
        elif is_fitted:
            curve = Curve(best_exponent(known))
        fitted._curve = curve
        fitted.gain, gain = gains(array, curve, known, each=flag("each", each))
        missed = np.concatenate([load.errors(curve, fitted.gain) for load in known])
        unknown = 1 + is_fitted + (int(np.count_nonzero(fitted.gain[array._there()] != gain)) if each else 0)
        fitted.residual = float(np.sqrt(np.mean(missed**2))) if len(missed) > unknown else None
        fitted.loads = tuple(
            (load.load, load.unit, load.load * of.share(curve, fitted.gain))
            for load, of in zip(measured, known, strict=True)
        )
        return fitted

    def apply(self, frames: Frames, rest: Tare | ArrayLike | None = None) -> Frames:
        """Return frames in N or kPa; taxels that do not read more than the floor above rest give 0.

        Parameters
        ----------
        frames : Frames
            Readings as the sensor gives them, with their rest.
        rest : Tare or float64, a number or the array's shape, optional
            Today's rest, finite; default: the rest of the calibration.

        Returns
        -------
        Frames, in the calibration's unit

        Raises
        ------
        ProblemError : frames of another array, or in another unit; a rest that is not finite
        """
        same(self.array, instance("frames", frames, Frames).array, "the frames", frames.unit, self.reading_unit)
        return Frames(self._values(frames.values, self._rest(rest)), frames.t, unit=self.unit, array=frames.array)

    def _rest(self, rest: Tare | ArrayLike | None) -> Values:
        if isinstance(rest, Tare):
            same(self.array, rest.array, "the tare")
            rest = rest.rest
        elif rest is not None and np.isnan(numbers("rest", rest, np.float64)).any():
            raise refused("rest", " contains NaN: must be finite; if the rest of a taxel is unknown, give a Tare")
        if rest is not None:
            return _by_taxel("rest", rest, self.array)
        if self.rest is not None:
            return self.rest
        return np.zeros(self.array.shape)

    def _values(self, readings: NDArray[Any], rest: Values) -> NDArray[np.float32]:
        above = np.asarray(readings, np.float64) - rest
        values = np.where((above > self.floor) & self.array._there(), self.gain * self._curve.values(above), 0.0)
        # As frames hold them.
        return np.minimum(values, np.finfo(np.float32).max).astype(np.float32)

    def _region(self, columns: slice, rows: slice) -> Calibration:
        """Return the calibration of a rectangle of the array."""
        (left, right), (top, bottom) = self.array.region(columns, rows)
        small = self.array._part(columns, rows)
        rest = None if self.rest is None else self.rest[top:bottom, left:right]
        gain = self.gain[top:bottom, left:right]
        unchanged = {name: getattr(self, name) for name in ("floor", "date", "residual", "loads", "note")}
        return self._made(small, self._curve, self.unit, self.reading_unit, {**unchanged, "gain": gain, "rest": rest})

    def to_json(self) -> str:
        """Return the calibration as JSON that people can read."""
        even = bool((self.gain == self.gain[0, 0]).all())
        document: dict[str, Any] = {
            "taxel": "calibration",
            "unit": self.unit,
            "of": self.reading_unit,
            "date": self.date,
            "residual": self.residual,
            "loads": [{"load": load, "unit": unit, "made": made} for load, unit, made in self.loads],
            "note": self.note,
            "curve": self._curve.to_dict(),
            "floor": self.floor,
            "array": self.array._geometry(),
            "gain": float(self.gain[0, 0]) if even else self.gain.tolist(),
            "rest": None
            if self.rest is None
            else [[None if np.isnan(r) else r for r in row] for row in self.rest.tolist()],
        }
        lines = (f" {json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in document.items())
        return "{\n" + ",\n".join(lines) + "\n}\n"

    @classmethod
    def from_json(cls, text: str) -> Calibration:
        """Return the calibration that `to_json` wrote.

        Parameters
        ----------
        text : str

        Raises
        ------
        FormatError : not a calibration (names the entry)
        """
        if not isinstance(text, str):
            raise refused("calibration", f" is {shown(text)}: must be JSON text")
        entry = "the whole"
        try:
            document = mapping("calibration", of_json(None, text))
            if document.get("taxel") != "calibration":
                raise ProblemError('must be an object with "taxel": "calibration"')
            entry = "array"
            array = Array._from_geometry(mapping(entry, document[entry]))
            entry = "curve"
            unit = checked_text("unit", document["unit"], UNITS)
            curve = curve_of(mapping(entry, document[entry]))
            entry = "loads"
            loads = [
                (number("load", x["load"]), str(x["unit"]), number("made", x["made"])) for x in document.get(entry, ())
            ]
            entry = "rest"
            rest = document.get(entry)
            if rest is not None:
                rest = [[math.nan if r is None else r for r in row] for row in rest]
            entry = "values"
            names = ("gain", "floor", "date", "residual", "note")
            how = {name: document[name] for name in names if name in document} | {"rest": rest, "loads": loads}
            return cls._made(array, curve, unit, checked_text("of", document["of"]), how)
        except KeyError as error:
            raise FormatError(
                f"{entry}: {error.args[0]} is missing; the text must be as Calibration.save writes it"
            ) from None
        except (ValueError, TypeError, AttributeError, IndexError, OverflowError, ProblemError) as error:
            raise FormatError(f"{entry}: {first_line(error)}; the text must be as Calibration.save writes it") from None

    @staticmethod
    def beside(recording: str | os.PathLike[str]) -> Path | None:
        """Return the file of the calibration beside a recording; None if there is none.

        Parameters
        ----------
        recording : path

        Raises
        ------
        ProblemError : not a path

        Examples
        --------
        >>> Calibration.beside("a recording that is not there.mcap") is None
        True
        """
        recording_path = Path(checked_path("recording", recording))
        by_name = f"{named(recording_path).stem}.calibration.json"
        return next(
            (file for name in (by_name, "calibration.json") if (file := beside(recording_path, name)).is_file()), None
        )

    def described(self) -> str:
        """Return a line with the curve, the day and the residual."""
        points, count = self._curve.points, len(self.loads)
        parts = [f"power {self._curve.exponent:.3g}" if points is None else f"table of {len(points[1])}"]
        parts += [f"fit to {counted(count, 'load')}"] * bool(count)
        parts += [] if self.residual is None else [f"residual {100 * self.residual:.1f} %"]
        return ", ".join([f"{self.reading_unit} to {self.unit}", *parts, self.date])

    def __repr__(self) -> str:
        size = f"{self.array.name}: {self.array.rows} x {self.array.columns} taxels"
        return escaped(f"Calibration({self.described()}, of {size})")


def _by_taxel(name: str, value: Any, array: Array) -> Values:
    values = numbers(name, value, np.float64)
    if isinstance(value, bool):
        raise refused(name, f" is {value}: must be a number, or an array of shape {array.shape}")
    if values.shape not in ((), array.shape):
        raise refused(name, f" has shape {values.shape}: must be a number, or an array of shape {array.shape}")
    if np.isinf(values).any():
        raise refused(name, ": must be finite")
    return frozen(np.broadcast_to(values, array.shape).copy())


def _iso(value: object) -> str:
    if value is None:
        return day.today().isoformat()
    written = checked_text("date", value)
    try:
        return day.fromisoformat(written).isoformat()
    except ValueError:
        raise refused("date", f" is {shown(written)}: must be a day, for example 2026-11-21") from None
