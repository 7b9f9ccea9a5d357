"""What all encoders have in common."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from taxel import _core
from taxel._base.arguments import instance, several, shown
from taxel._base.arguments import text as checked_text
from taxel._base.parameters import Value
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.spikes import SpikeTrains
from taxel.tare import Tare

__all__ = ["Encoder", "EncoderStream"]


class Encoder(Value):
    """Turn events or frames into spike trains; the common part of all encoders.

    An encoder holds its parameters under their own names and nothing else. Two are equal where their parameters are.

    Examples
    --------
    >>> from taxel.encode import ChangeEvents
    >>> encoder = Encoder.from_json('{"name": "change_events", "bits": 3}')
    >>> encoder == ChangeEvents(bits=3)
    True
    """

    name: ClassVar[str]
    _by_name: ClassVar[dict[str, type[Encoder]]] = {}

    def __init_subclass__(cls) -> None:
        if "name" in vars(cls):
            cls._kind = cls.name
            Encoder._by_name[cls.name] = cls

    def _plain(self) -> dict[str, Any]:
        return {"name": self.name} | super()._plain()

    def to_json(self) -> str:
        """Return the encoder as JSON: an object with its name and all parameters."""
        return _core.check_encoder(self._json())

    @staticmethod
    def from_json(text: str) -> Encoder:
        """Return the encoder that the JSON names; what is left out has its default.

        Raises
        ------
        ProblemError : an unknown name or parameter, or a value that makes no sense
        """
        if not isinstance(text, str):
            raise ProblemError(f"encoder is {shown(text)}: must be JSON text")
        values = json.loads(_core.check_encoder(checked_text("encoder", text)))
        return Encoder._by_name[values.pop("name")]._from_values(values)

    def trains(self, array: Array) -> int:
        """Return the number of spike trains that the encoder makes of an array; signed ones count once."""
        return _core.encoder_about(self._json(), instance("array", array, Array)._parts())[0]

    @property
    def signed(self) -> bool:
        """Whether spikes carry a signed value, so that a neuron receives each train as two inputs, ON and OFF."""
        return _core.encoder_about(self._json(), Array(1, 1)._parts())[1]

    @property
    def latency_ms(self) -> float:
        """How much later than the touch itself a spike comes, ms: what the encoder's own rule costs."""
        return _core.encoder_about(self._json(), Array(1, 1)._parts())[2]

    def with_tare(self, tare: Tare) -> Self:
        """Return the same encoder with this tare; one that reads none stays as it is."""
        instance("tare", tare, Tare)
        return self

    def encode(self, x: Events | Frames | Recorded) -> SpikeTrains:
        """Return the spikes of a whole recording.

        Parameters
        ----------
        x : Events, Frames or Recording
            Events need their intensities: they are read as held values. One up to 0.1 s behind another (datagrams that
            overtook each other) counts as of that later time, as in a stream. Channels are the existing taxels, in the
            order of their index.

        Returns
        -------
        SpikeTrains
            The window begins with the first stamp; it ends the latency (and, of events, one period) after the last,
            with the last values held until then.

        Raises
        ------
        ProblemError : none of these, events without intensities, or one more than 0.1 s behind another
            (names it; `Events.sorted` puts them in order)
        """
        x = recorded(x)
        if isinstance(x, Events):
            return SpikeTrains._from_parts(_core.encode_events(self._json(), x._parts()))
        return SpikeTrains._from_parts(_core.encode_frames(self._json(), _frames(x)._parts()))

    def fit(self, recordings: object = None, targets: object = None) -> Self:  # noqa: ARG002  scikit-learn's call
        """Do nothing: an encoder learns nothing; so that it stands in a pipeline of scikit-learn's."""
        return self

    def transform(self, recordings: Sequence[Events | Frames | Recorded]) -> list[SpikeTrains]:
        """Return the spikes of several recordings as learners take them: signed trains split into ON and OFF.

        Parameters
        ----------
        recordings : sequence of Events, Frames or Recording

        Returns
        -------
        list of SpikeTrains
            One a recording, in ms from where its time counts.

        Raises
        ------
        ProblemError : as `encode`
        """
        encoded = [self.encode(one) for one in several("recordings", recordings)]
        return [trains.split_by_sign() if trains.signed else trains for trains in encoded]

    def stream(self, array: Array | None = None) -> EncoderStream:
        """Begin to encode pieces: the same spikes as of the whole, wherever it is cut.

        Parameters
        ----------
        array : Array, optional
            The sensor; that of the first piece where it is left out.
        """
        return EncoderStream(self, array)


class EncoderStream:
    """Encode events or frames piece by piece, as `Encoder.stream` begins it.

    Every call returns the spikes that became certain by it, with the window from where the last call ended. A stamp of
    events is over when a later one comes, `advance` moves time on or `finish` ends it.

    Examples
    --------
    >>> from taxel.encode import LevelCrossing
    >>> stream = LevelCrossing([10.0]).stream(Array(1, 1))
    >>> stream.push(Frames([[[0.0]], [[12.0]]], [0, 1000]))
    SpikeTrains(1 trains, 1 spikes, signed, 0 to 1 ms)
    """

    def __init__(self, encoder: Encoder, array: Array | None = None) -> None:
        self.encoder = encoder
        self._parameters = instance("encoder", encoder, Encoder)._json()
        self._core: _core.EncoderStream | None = None
        if array is not None:
            self._begin(array)

    def _begin(self, array: Array) -> _core.EncoderStream:
        if self._core is None:
            self._core = _core.EncoderStream(self._parameters, instance("array", array, Array)._parts())
        return self._core

    @property
    def late(self) -> int:
        """How many events came more than 0.1 s behind the time come to, and were taken as of that time."""
        return 0 if self._core is None else self._core.late

    def push(self, x: Events | Frames) -> SpikeTrains:
        """Take the next events or frames; one stream takes either, never both.

        An event behind the time come to counts as of that time.

        Raises
        ------
        ProblemError : neither, another array's, events without intensities, or frames out of order
        """
        if isinstance(x, Events):
            return SpikeTrains._from_parts(self._begin(x.array).push_events(x._parts()))
        frames = _frames(x)
        return SpikeTrains._from_parts(self._begin(frames.array).push_frames(frames._parts()))

    def advance(self, t_us: int) -> SpikeTrains:
        """Say that nothing will come any more before `t_us` (exclusive); an earlier time changes nothing."""
        if isinstance(t_us, bool) or not isinstance(t_us, int | np.integer) or not -(2**60) <= t_us <= 2**60:
            raise ProblemError(f"t_us is {shown(t_us)}: must be a whole number of us")
        return self._told(None if self._core is None else self._core.advance(int(t_us)))

    def finish(self) -> SpikeTrains:
        """Say that nothing more will come; the last values are held for the latency, so that all spikes come out."""
        return self._told(None if self._core is None else self._core.finish())

    def _told(self, parts: tuple[Any, ...] | None) -> SpikeTrains:
        return SpikeTrains.from_lists([]) if parts is None else SpikeTrains._from_parts(parts)


def _frames(x: object) -> Frames:
    if not isinstance(x, Frames):
        raise ProblemError(f"{type(x).__name__}: encoders take taxel.Events or taxel.Frames")
    return x
