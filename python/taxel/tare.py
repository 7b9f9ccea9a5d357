"""The readings of unloaded taxels, of one board on one day."""

from __future__ import annotations

import json
import os
import re
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import finite, instance, integer, number, shown
from taxel._base.arguments import text as checked_text
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped
from taxel._base.saved import Saved
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded

__all__ = ["GivenTare", "Tare", "check_tare", "seconds_of"]

#: How another file of taxel begins, which says what it is.
_OTHER = re.compile(r'\s*\{\s*"format":\s*"([\w ]+)"')


class Tare(Saved):
    """The rest of each taxel: the time-weighted mean of its held values over an unloaded interval, and its noise.

    Made by `Tare.take`, `Tare.load` or `Tare.from_json`. Measure it with the board's noise floor at 0; otherwise a rest
    is no more precise than the noise floor.

    Attributes
    ----------
    array : Array
    rest : float64, shape (rows, columns), in the sensor's unit
        NaN for a taxel without any event.
    noise : float64, shape (rows, columns), in the sensor's unit
        The time-weighted standard deviation of each taxel's held values over the interval; NaN for a taxel without any
        event.
    start_us, stop_us : int, us
        The interval.
    note : str
        Board and day of the measurement.

    Raises
    ------
    ProblemError : the class is called; use `take`, `load` or `from_json`

    Examples
    --------
    >>> frames = Frames([[[50.0]], [[53.0]], [[53.0]]], [0, 1000, 3000], unit="ticks")
    >>> tare = Tare.take(frames)
    >>> tare
    Tare(1 of 1 taxel, 0 to 3000 us)
    >>> tare.rest
    array([[52.]])
    >>> tare.noise.round(3)
    array([[1.414]])
    """

    _WHAT = "tare"

    array: Array
    rest: NDArray[np.float64]
    noise: NDArray[np.float64]
    start_us: int
    stop_us: int
    note: str
    _text: str

    def __init__(self) -> None:
        raise ProblemError("Tare: measure one by Tare.take, or load one by Tare.load")

    @classmethod
    def take(
        cls, x: Events | Frames | Recorded, *, start_us: int | None = None, stop_us: int | None = None, note: str = ""
    ) -> Tare:
        """Return the time-weighted mean of each taxel's held values.

        Parameters
        ----------
        x : Events, Frames or Recording
            Events need their intensities.
        start_us, stop_us : int, us, optional
            The unloaded interval, its end exclusive; default: from the first stamp to the last. Values of events
            before the interval are held at its start.
        note : str
            Board and day of the measurement.

        Raises
        ------
        ProblemError : events without intensities, or an interval without an event
        """
        note = checked_text("note", note)
        window = (
            None if start_us is None else integer("start_us", start_us),
            None if stop_us is None else integer("stop_us", stop_us),
        )
        given, x = x, recorded(x)
        if not isinstance(x, Events | Frames):
            raise refused("x", f" is {shown(x)}: must be a taxel.Events or taxel.Frames")
        if not len(x.t):
            noun, why = ("event" if isinstance(x, Events) else "frame"), getattr(given, "_why_empty", str)()
            raise refused("tare", f": there is no {noun}{why}")
        if window[1] is not None and x.t.min() >= window[1]:
            raise ProblemError(
                f"tare to {stop_us} us: no events are before this time; the events are from {x.t.min()} to "
                f"{x.t.max()} us"
            )
        return cls.from_json(_core.take_tare(x, *window, note))

    def off(self, frames: Frames) -> Frames:
        """Return frames with each taxel's rest subtracted: 0 if it reads less, or if its rest is unknown.

        Parameters
        ----------
        frames : Frames

        Raises
        ------
        ProblemError : frames of an array of another shape
        """
        instance("frames", frames, Frames)
        if not self.array.fits(frames.array):
            (rows, columns), (of_rows, of_columns) = frames.array.shape, self.array.shape
            others = " in which other taxels exist" if frames.array.shape == self.array.shape else ""
            expected = f"{of_rows} x {of_columns}{others}"
            raise ProblemError(f"frames of {rows} x {columns} taxels, but the tare is of {expected}")
        self.array._warn_apart(frames.array, "the frames")
        return frames._above(np.where(np.isnan(self.rest), np.inf, self.rest))

    @classmethod
    def from_json(cls, text: str) -> Tare:
        """Return the tare that `to_json` wrote.

        Parameters
        ----------
        text : str

        Raises
        ------
        FormatError : the text is not a tare
        ProblemError : a tare whose parts contradict each other
        """
        if not isinstance(text, str):
            raise refused("tare", f" is {shown(text)}: must be JSON text")
        if stranger := _OTHER.match(text):
            raise FormatError(f"is a {stranger[1]}, not a tare: must be a file that Tare.save wrote")
        tare = cls.__new__(cls)
        tare._text = _core.check_tare(checked_text("tare", text))
        values: dict[str, Any] = json.loads(tare._text)
        tare.array = Array._from_geometry(values["array"])
        tare.rest = _of_taxels(values["rest"], tare.array)
        tare.noise = _of_taxels(values["noise"], tare.array)
        tare.start_us, tare.stop_us, tare.note = values["start_us"], values["stop_us"], values["note"]
        return tare

    def _with(self, array: Array | None = None, **parts: NDArray[np.float64]) -> Tare:
        """Return the tare with other values by taxel, NaN where there is none, and of another array."""
        changed: dict[str, Any] = {} if array is None else {"array": array._geometry()}
        for name, values in parts.items():
            changed[name] = [None if np.isnan(value) else value for value in values.reshape(-1).tolist()]
        return self.from_json(json.dumps(json.loads(self._text) | changed))

    @classmethod
    def _of(cls, array: Array, rest: NDArray[np.float64], note: str) -> Tare:
        """Return a tare whose rest was not measured here, and whose noise is not known."""
        nothing = Frames(np.zeros((2, *array.shape)), [0, 1], array=array)
        return cls.take(nothing, note=note)._with(rest=rest, noise=np.full(array.shape, np.nan))

    def to_json(self) -> str:
        """Return the tare as JSON."""
        return self._text

    def __repr__(self) -> str:
        known = int(np.count_nonzero(~np.isnan(self.rest)))
        note = f", {self.note}" if self.note else ""
        return escaped(
            f"Tare({known} of {counted(self.array.taxels, 'taxel')}, {self.start_us} to {self.stop_us} us{note})"
        )


def _of_taxels(values: list[float | None], array: Array) -> NDArray[np.float64]:
    """Return values by taxel, NaN where there is none, which cannot be changed."""
    rest = np.array([np.nan if value is None else value for value in values], dtype=float).reshape(array.shape)
    rest.setflags(write=False)
    return rest


#: A tare, the file of one, a recording at rest, or how many seconds at the beginning of a recording are at rest.
GivenTare: TypeAlias = Tare | str | os.PathLike[str] | float


def seconds_of(tare: GivenTare) -> float | None:
    """Return the seconds that a given tare says; None of a tare or a file."""
    if isinstance(tare, Tare | os.PathLike):
        return None
    if not isinstance(tare, str):
        return number("tare", tare)
    try:
        return float(tare)
    except ValueError:
        return None


def check_tare(tare: GivenTare | None) -> None:
    """Refuse what is neither a tare nor a path nor seconds above 0."""
    seconds = None if tare is None else seconds_of(tare)
    if seconds is not None and not 0 < seconds < np.inf:
        raise refused("tare", f" is {tare}: must be seconds above 0, or a file")


def check_absorb(absorb_s: float | None) -> None:
    """Refuse a time after which a load is rest that is neither 0 nor a number of seconds from 1 to half an hour."""
    if absorb_s is not None and finite("absorb_s", absorb_s, least=0.0, most=1800.0) != 0.0:
        finite("absorb_s", absorb_s, least=1.0)
