"""The base class of all encoders, and the encoding of a stream."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

from taxel import _core
from taxel._base.arguments import instance, integer, several, shown
from taxel._base.arguments import text as checked_text
from taxel._base.errors import refused
from taxel._base.parameters import Value
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.spikes import Kind, SpikeTrains
from taxel.tare import Tare


class Encoder(Value):
    """Turn events or frames into spike trains; the common part of all encoders.

    An encoder holds its parameters as attributes and has no other state. Two encoders are equal if their parameters
    are.

    Examples
    --------
    >>> from taxel.encode import ChangeEvents
    >>> encoder = Encoder.from_json('{"name": "change_events", "bits": 3}')
    >>> encoder == ChangeEvents(bits=3)
    True
    """

    name: ClassVar[str]
    _by_name: ClassVar[dict[str, type[Encoder]]] = {}
    #: Whether channels have no such trains, as it counts taxels beside each other or needs their places.
    _needs_neighbours: bool = False

    def __init_subclass__(cls) -> None:
        if "name" in vars(cls):
            cls._kind = cls.name
            Encoder._by_name[cls.name] = cls

    def _plain(self) -> dict[str, Any]:
        return {"name": self.name} | super()._plain()

    def to_json(self) -> str:
        """Return the encoder as JSON: an object with its name and all parameters.

        Returns
        -------
        str

        Raises
        ------
        ProblemError : an invalid parameter

        Examples
        --------
        >>> from taxel.encode import FA1
        >>> Encoder.from_json(FA1(bits=2).to_json()) == FA1(bits=2)
        True
        """
        return _core.check_encoder(self._json())

    @staticmethod
    def from_json(text: str) -> Encoder:
        """Return the encoder that the JSON describes; an omitted parameter has its default.

        Parameters
        ----------
        text : str
            A JSON object with "name" and any parameters, as `to_json` returns it.

        Returns
        -------
        Encoder

        Raises
        ------
        ProblemError : not JSON, an unknown name or parameter, or an invalid value

        Examples
        --------
        >>> Encoder.from_json('{"name": "fa1", "bits": 2}').bits
        2
        """
        if not isinstance(text, str):
            raise refused("encoder", f" is {shown(text)}: must be JSON text")
        return Encoder._of(json.loads(_core.check_encoder(checked_text("encoder", text))))

    @staticmethod
    def _of(values: Mapping[str, Any]) -> Encoder:
        """Return the encoder of checked JSON values."""
        return Encoder._by_name[values["name"]]._from_values({k: v for k, v in values.items() if k != "name"})

    def _each(self) -> list[Encoder]:
        """Return the encoders that it is made of: itself, or the parts of a composite in the order of their trains."""
        return [self]

    def trains(self, array: Array) -> int:
        """Return the number of trains that the encoder returns for an array; a signed train counts once.

        Parameters
        ----------
        array : Array

        Returns
        -------
        int, trains

        Raises
        ------
        ProblemError : not an array, or an invalid parameter

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> LevelCrossing([5.0, 10.0]).trains(Array(4, 4))
        32
        """
        return _core.encoder_about(self._json(), instance("array", array, Array))[0]

    @property
    def kind(self) -> Kind:
        """The meaning of its spikes' values, as in `SpikeTrains`: "unsigned", "signed" or "graded"."""
        return _core.encoder_about(self._json(), Array(1, 1))[1]  # type: ignore[return-value]

    @property
    def signed(self) -> bool:
        """Whether spikes carry a signed value, so that each train is two inputs of a neuron, ON and OFF."""
        return self.kind == "signed"

    @property
    def latency_ms(self) -> float:
        """The delay between touch and spike that the encoder's rule causes, ms."""
        return _core.encoder_about(self._json(), Array(1, 1))[2]

    def with_tare(self, tare: Tare) -> Self:
        """Return the same encoder with this tare; an encoder or part without the parameter `tare` is unchanged.

        Parameters
        ----------
        tare : Tare
            The taxels' rest.

        Returns
        -------
        Encoder
            A copy; this encoder is not changed.

        Raises
        ------
        ProblemError : not a tare

        Examples
        --------
        >>> from taxel.encode import ContactArea, FA1
        >>> tare = Tare.take(Frames([[[50.0, 52.0]], [[50.0, 52.0]]], [0, 1000], unit="ticks"))
        >>> ContactArea().with_tare(tare).tare == tare, FA1().with_tare(tare) == FA1()
        (True, True)
        """
        instance("tare", tare, Tare)
        return self

    def encode(self, x: Events | Frames | Recorded) -> SpikeTrains:
        """Return the spikes of a whole recording; a tare in seconds is measured at its beginning.

        Parameters
        ----------
        x : Events, Frames or Recording
            Events need intensities, which are read as held values. An event up to 0.1 s behind an earlier event in the
            sequence (reordered datagrams) is assigned the later time, as in a stream. Channels are the existing taxels,
            in the order of their index.

        Returns
        -------
        SpikeTrains
            The window begins at the first stamp; it ends the latency (and, for events, one period) after the last one,
            and the last values are held until then.

        Raises
        ------
        ProblemError : another object, events without intensities, or one more than 0.1 s behind another
            (names it; `Events.sorted` puts them in order); a parameter `tare` that is None, another array's, or more
            than half of the recording

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> LevelCrossing([10.0]).encode(Frames([[[0.0]], [[12.0]]], [0, 1000]))
        SpikeTrains(1 train, 1 spike, signed, 0 to 1 ms)
        """
        x = recorded(x)
        return SpikeTrains._of_own(**_core.encode(self._json(), x if isinstance(x, Events) else frames_of(x)))

    def fit(self, recordings: object = None, targets: object = None) -> Self:  # noqa: ARG002  scikit-learn's call
        """Return the encoder itself, which learns nothing; a scikit-learn pipeline calls `fit` of each step.

        Parameters
        ----------
        recordings, targets : object
            Not used.

        Returns
        -------
        Encoder
        """
        return self

    def transform(self, recordings: Sequence[Events | Frames | Recorded]) -> list[SpikeTrains]:
        """Return the spikes of several recordings as learners expect them: signed trains split into ON and OFF.

        Parameters
        ----------
        recordings : sequence of Events, Frames or Recording

        Returns
        -------
        list of SpikeTrains
            One for each recording, in ms from time 0 of the recording.

        Raises
        ------
        ProblemError : not a sequence of recordings, or as `encode`

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> LevelCrossing([10.0]).transform([Frames([[[0.0]], [[12.0]]], [0, 1000])])
        [SpikeTrains(2 trains, 1 spike, 0 to 1 ms)]
        """
        encoded = [self.encode(recording) for recording in several("recordings", recordings)]
        return [trains.split_by_sign() if trains.signed else trains for trains in encoded]

    def stream(self, array: Array | None = None) -> EncoderStream:
        """Return an encoder of pieces, whose spikes equal those of the whole recording however it is cut.

        Parameters
        ----------
        array : Array, optional
            The sensor; default: that of the first piece.

        Returns
        -------
        EncoderStream

        Raises
        ------
        ProblemError : not an array, or an invalid parameter

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> LevelCrossing([10.0]).stream().push(Frames([[[0.0]], [[12.0]]], [0, 1000]))
        SpikeTrains(1 train, 1 spike, signed, 0 to 1 ms)
        """
        return EncoderStream(self, array)


class EncoderStream:
    """Encode events or frames piece by piece; `Encoder.stream` returns one.

    Every call returns the spikes that it made final; their window begins at the end of the window before. A stamp of
    events is complete when a later stamp arrives, or after `advance` or `finish`.

    Parameters
    ----------
    encoder : Encoder
        Later changes of its parameters have no effect.
    array : Array, optional
        The sensor; default: that of the first piece.

    Raises
    ------
    ProblemError : not an encoder, not an array, or an invalid parameter

    Examples
    --------
    >>> from taxel.encode import LevelCrossing
    >>> stream = LevelCrossing([10.0]).stream(Array(1, 1))
    >>> stream.push(Frames([[[0.0]], [[12.0]]], [0, 1000]))
    SpikeTrains(1 train, 1 spike, signed, 0 to 1 ms)
    """

    def __init__(self, encoder: Encoder, array: Array | None = None) -> None:
        self.encoder = encoder
        self._parameters = instance("encoder", encoder, Encoder)._json()
        self._core: _core.EncoderStream | None = None
        if array is not None:
            self._begin(array)

    def _begin(self, array: Array) -> _core.EncoderStream:
        if self._core is None:
            self._core = _core.EncoderStream(self._parameters, instance("array", array, Array))
        return self._core

    @property
    def late(self) -> int:
        """The number of events more than 0.1 s behind the stream's time, which are assigned the stream's time."""
        return 0 if self._core is None else self._core.late

    def push(self, x: Events | Frames) -> SpikeTrains:
        """Encode the next events or frames; a stream accepts either events or frames, never both.

        An event behind the stream's time is assigned the stream's time.

        Parameters
        ----------
        x : Events or Frames
            The next piece.

        Returns
        -------
        SpikeTrains
            The spikes that became final, in ms from time 0 of the stream.

        Raises
        ------
        ProblemError : neither events nor frames, another array, events without intensities, or frames out of order

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> stream = LevelCrossing([10.0]).stream()
        >>> stream.push(Frames([[[0.0]]], [0])).times, stream.push(Frames([[[12.0]]], [1000])).times
        (array([], dtype=float64), array([1.]))
        """
        sensed = x if isinstance(x, Events) else frames_of(x)
        return SpikeTrains._of_own(**self._begin(sensed.array).push(sensed))

    def advance(self, t_us: int) -> SpikeTrains:
        """Advance the stream's time: after this call no event before `t_us` is pushed.

        Parameters
        ----------
        t_us : int, us
            Exclusive; a time before the stream's changes nothing.

        Returns
        -------
        SpikeTrains
            The spikes that became final.

        Raises
        ------
        ProblemError : not a whole number, or a number above 2**60

        Examples
        --------
        >>> from taxel.encode import LevelCrossing
        >>> stream = LevelCrossing([10.0]).stream()
        >>> values = Events([0, 500], [0, 0], [0, 0], [True, True], array=Array(1, 1), intensity=[5, 12])
        >>> len(stream.push(values).times), stream.advance(2000).times
        (0, array([0.5]))
        """
        t = integer("t_us", t_us, -(2**60), 2**60)
        return self._spikes(None if self._core is None else self._core.advance(t))

    def finish(self) -> SpikeTrains:
        """End the stream; the last values are held for the encoder's latency, so that all spikes are returned.

        Returns
        -------
        SpikeTrains
            The rest of the spikes.

        Examples
        --------
        >>> from taxel.encode import ThresholdIzhikevich
        >>> stream = ThresholdIzhikevich([0.4]).stream()
        >>> frames = Frames([[[0.0]], [[1.0]], [[1.0]]], [0, 10_000, 20_000], unit="V")
        >>> len(stream.push(frames).times), stream.finish().times
        (0, array([25.8]))
        """
        return self._spikes(None if self._core is None else self._core.finish())

    def _spikes(self, parts: _core._Spikes | None) -> SpikeTrains:
        return SpikeTrains.from_lists([]) if parts is None else SpikeTrains._of_own(**parts)


def frames_of(x: object) -> Frames:
    """Return `x` if it is frames; raise a ProblemError otherwise."""
    if not isinstance(x, Frames):
        raise ProblemError(f"{type(x).__name__} cannot be encoded: must be taxel.Events or taxel.Frames")
    return x
