"""The base of `Readout` and `PlainRule`, which make detections and are saved as files, and their stream."""

from __future__ import annotations

import json
from abc import abstractmethod
from typing import Any, Self

from taxel import _core
from taxel._base.arguments import instance, integer, number, parameters, shown
from taxel._base.arguments import text as checked_text
from taxel._base.errors import refused
from taxel._base.saved import Saved
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.board import noise_floor
from taxel.detections import Detections
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import unit_of
from taxel.recording.analysis.rest import FORCE_UNITS, floor_at_rest
from taxel.tare import Tare, check_absorb
from taxel.wire import FRAME_US


class _Detector(Saved):
    """Base of a readout and a plain rule: both have a file and a stream."""

    _text: str
    _parts: dict[str, Any]

    @staticmethod
    @abstractmethod
    def _check(text: str) -> str:
        """Check the text of its file, and return it with every default filled in."""

    @property
    @abstractmethod
    def array(self) -> Array | None:
        """The sensor, or None where any will do."""

    @property
    @abstractmethod
    def _needs_tare(self) -> bool:
        """Whether it reads no recording without a tare."""

    @abstractmethod
    def _accepts(self, array: Array) -> bool:
        """Whether it can detect in what a sensor sends."""

    @property
    @abstractmethod
    def labels(self) -> tuple[str, ...]:
        """The labels that it detects."""

    @property
    def unit(self) -> str | None:
        """The unit of the values that it was trained on ("ticks" of a board's events), or None where any will do."""
        unit = self._parts.get("unit")
        return None if unit is None else str(unit)

    def _check_unit(self, unit: str) -> None:
        """Refuse values in another unit than it was trained on, as its weights and thresholds are of that unit."""
        if self.unit not in (None, unit):
            how = ", as a calibration gives (Recording.calibrated)" if self.unit in FORCE_UNITS else ""
            raise ProblemError(
                f"values are in {unit}, but the {self._WHAT} was trained on {self.unit}: "
                f"give values in {self.unit}{how}, or train a {self._WHAT} on recordings in {unit}"
            )

    def _with(self, **parts: Any) -> Self:
        """Return it with other parts of its file."""
        return self._from_text(parameters(self._parts | parts))

    def _for(self, source: object, tare: Tare | None) -> Self:
        """Return it with the noise floors of a source and its tare, where those of training are lower.

        Up to a board's noise floor, a taxel may stay above its rest. The noise of counts of events grows with their
        number, which light and the sensor's thresholds change from file to file.
        """
        least = noise_floor(source)
        if tare is not None and self.unit is not None and are_counts(self.unit):
            least = floor_at_rest(tare.noise)
        return self._with_floor(least)

    def absorbing(self, absorb_s: float | None) -> Self:
        """Return it with another time after which a load that stays is rest, in frames, whose rest follows drift.

        Parameters
        ----------
        absorb_s : float, s, from 1 to 1800, or 0, or None
            0: the rest stays as it was measured. None: as it is.

        Raises
        ------
        ProblemError : a time out of range; no noise floor is known, as of a readout that was not trained by taxel
        """
        check_absorb(absorb_s)
        if absorb_s is None:
            return self
        parts = self._parts
        floors = [part.get("noise_floor") for part in (parts.get("rest"), parts.get("training"), parts) if part]
        floor = next((floor for floor in floors if floor is not None), None)
        if floor is None:
            raise refused("absorb_s", f" is given, but the {self._WHAT} states no noise floor: must be left out")
        return self._with(rest={"noise_floor": floor, "absorb_s": absorb_s})

    def _with_floor(self, least: float) -> Self:
        """Return it with noise floors of so much at least."""
        parts = raised(self._parts, least)
        return self if parts == self._parts else self._from_text(parameters(parts))

    @classmethod
    def _from_text(cls, text: str) -> Self:
        detector = cls.__new__(cls)
        detector._hold(cls._check(text))
        return detector

    def _hold(self, text: str) -> None:
        """Hold the text of its file, which was checked."""
        self._text = text
        self._parts = json.loads(text)

    def to_json(self) -> str:
        """Return the text of its file."""
        return self._text

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the one that `to_json` wrote.

        Parameters
        ----------
        text : str

        Raises
        ------
        FormatError : another kind of file, another version, or parts that are invalid
        """
        if not isinstance(text, str):
            raise refused("text", f" is {shown(text)}: must be the text of a {cls._WHAT}")
        return cls._from_text(checked_text("text", text))

    def stream(
        self,
        array: Array | None = None,
        *,
        frame_us: float = FRAME_US,
        tare: Tare | None = None,
        wire_version: int = 1,
    ) -> ReadoutStream:
        """Begin to receive piece by piece: the same detections as of the whole, wherever the input is cut.

        Parameters
        ----------
        array : Array, optional
            The sensor; its own where it is left out, or else that of the first piece.
        frame_us : float, us
            How long a frame of the board (or of the input) lasts; 192 is the board at reset.
        tare : Tare, optional
            The taxels' rest, where the encoder needs one and has none.
        wire_version : int, from 1 to 2
            Version of the wire that stamped the events: 1 counts 100 us (a stamp may be before its frame), 2 counts us.

        Raises
        ------
        ProblemError : another array than it was trained on, or a tare that is missing
        """
        return ReadoutStream(self, array, frame_us=frame_us, tare=tare, wire_version=wire_version)


class ReadoutStream:
    """Read out events or frames piece by piece, as `Readout.stream` and `PlainRule.stream` begin it.

    Every call returns the detections that became certain by it.

    Parameters
    ----------
    readout : Readout or PlainRule
    array : Array, optional
        The sensor; the readout's own where it is left out, or else that of the first piece.
    frame_us : float, us
        How long a frame of the board (or of the input) lasts; 192 is the board at reset.
    tare : Tare, optional
        The taxels' rest, where the encoder needs one and has none.
    wire_version : int, from 1 to 2
        Version of the wire that stamped the events: 1 counts 100 us (a stamp may be before its frame), 2 counts us.

    Raises
    ------
    ProblemError : another array than the readout was trained on, or a tare that is missing

    Examples
    --------
    >>> from taxel import Array, Frames, Neuron, Readout
    >>> from taxel.encode import LevelCrossing
    >>> readout = Readout(LevelCrossing([10.0]), {"contact": (Neuron(tau=2.0), [1.0, 0.0])})
    >>> stream = readout.stream(Array(1, 1), frame_us=10_000)
    >>> stream.push(Frames([[[0.0]], [[12.0]]], [0, 10_000]))
    Detections(none)
    >>> stream.advance(20_000)
    Detections(1: contact 1; 10979 to 10979 us)
    """

    def __init__(
        self,
        readout: _Detector,
        array: Array | None = None,
        *,
        frame_us: float = FRAME_US,
        tare: Tare | None = None,
        wire_version: int = 1,
    ) -> None:
        self._detector = detector("readout", readout)
        self._frame_us = number("frame_us", frame_us)
        self._rest, self._tare = tare, tare_text(tare)
        self._version = integer("wire_version", wire_version, 1, 2)
        self._core: _core.ReadoutStream | None = None
        array = readout.array if array is None else array
        if array is not None:
            self._begin(array)

    def _begin(self, array: Array) -> _core.ReadoutStream:
        if self._core is None:
            parts = instance("array", array, Array)
            self._core = _core.ReadoutStream(
                self._detector._for(None, self._rest).to_json(), parts, self._frame_us, self._version, self._tare
            )
        return self._core

    def push(self, x: Events | Frames) -> Detections:
        """Take the next events or frames; one stream takes either, never both.

        An event that is earlier than what came before counts as coming now, and is counted as `late`.

        Parameters
        ----------
        x : Events or Frames

        Returns
        -------
        Detections
            Those that became certain by it.

        Raises
        ------
        ProblemError : neither, another array's, another unit than it was trained on, events without intensities where
            the encoder reads them, frames out of order
        """
        if isinstance(x, Events | Frames):
            self._detector._check_unit(unit_of(x))
        if isinstance(x, Events):
            return Detections._from_parts(self._begin(x.array).push_events(x))
        if isinstance(x, Frames):
            return Detections._from_parts(self._begin(x.array).push_frames(x))
        raise refused("x", f" is {shown(x)}: must be a taxel.Events or taxel.Frames")

    def advance(self, t_us: int) -> Detections:
        """Promise that nothing will come any more before a time; an earlier time changes nothing.

        Parameters
        ----------
        t_us : int, us
            By the board's clock.

        Returns
        -------
        Detections
            Those that became certain by it.

        Raises
        ------
        ProblemError : no whole number of us
        """
        t = integer("t_us", t_us, -(2**52), 2**52)
        return Detections([], [], []) if self._core is None else Detections._from_parts(self._core.advance(t))

    @property
    def late(self) -> int:
        """How many events came later than others with a later time, or later than time was moved on."""
        return 0 if self._core is None else self._core.late

    @property
    def potentials(self) -> dict[str, float]:
        """Each neuron's potential now, mV; of a plain rule none."""
        return {} if self._core is None else dict(self._core.potentials)


def raised(part: Any, least: float) -> Any:
    """Return a part of a detector's file, or an encoder's, with noise floors of so much at least."""
    if not isinstance(part, dict):
        return part
    return {
        name: max(value, least) if name == "noise_floor" else value if name == "training" else raised(value, least)
        for name, value in part.items()
    }


def detector(name: str, value: object) -> _Detector:
    """Return a readout or a plain rule; refuse any other value."""
    if not isinstance(value, _Detector):
        raise refused(name, f" is {shown(value)}: must be a taxel.Readout or taxel.detect.PlainRule")
    return value


def tare_text(tare: Tare | None) -> str | None:
    """Return a tare as text."""
    return None if tare is None else instance("tare", tare, Tare).to_json()
