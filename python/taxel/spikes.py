"""Spike times by train, ms, and their conversion from and to us, the unit of the wire and of events."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import checked_path, column, floats, instance, nth, number, rows, several, shown, window
from taxel._base.arrays import read_arrays
from taxel._base.columns import FrozenColumns, frozen, frozen_column
from taxel._base.drawing import draw
from taxel._base.errors import refused, unreadable
from taxel._base.files import write_whole
from taxel._base.messages import counted, first_line
from taxel._core import ProblemError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["SpikeTrains", "to_ms", "to_us"]

Kind = Literal["unsigned", "signed", "graded"]
_KINDS: tuple[Kind, ...] = get_args(Kind)
#: A time or several, in the unit of either side.
_Time = TypeVar("_Time", float, NDArray[Any])


class SpikeTrains(FrozenColumns):
    """Spike times by train, with the window in which spikes were recorded.

    Parameters
    ----------
    times : float64, shape (spikes,), ms
        All times, train after train, ascending in each.
    offsets : int64, shape (trains + 1,), 0 or more
        Index of each train's first spike in `times`; the last entry is the number of spikes.
    start, stop : float, ms
        The window: a train without spikes was silent in it.
    values : float32, shape (spikes,), optional
        A value for each spike: polarity or bits of signed trains, the factor of the weight of graded trains.
    kind : "unsigned", "signed" or "graded", optional
        Meaning of the values, the same for all trains. Signed trains are split by sign before a neuron reads them. The
        values of graded trains multiply the weight; they are finite, of either sign, and never 0, which would be no
        spike. Default: signed if there are `values`, else unsigned.

    Raises
    ------
    ProblemError : times not finite, not ascending or outside the window (names train and spike); values that are not
        finite or not those of the kind, or a graded value of 0 (names it)

    Notes
    -----
    `times`, `offsets` and `values` are read-only: a caller's arrays are copied once, unless they are read-only
    themselves.

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[1.0, 5.0], [], [3.0]], stop=10.0)
    >>> trains
    SpikeTrains(3 trains, 3 spikes, 0 to 10 ms)
    >>> trains[0]
    array([1., 5.])
    >>> SpikeTrains([1.0, 5.0], [0, 2], 0.0, 10.0, [0.5, -2.0], kind="graded")
    SpikeTrains(1 train, 2 spikes, graded, 0 to 10 ms)
    """

    _COMPARED: ClassVar[tuple[str, ...]] = ("kind", "values", "start", "stop", "offsets", "times")

    def __init__(
        self,
        times: ArrayLike,
        offsets: ArrayLike,
        start: float,
        stop: float,
        values: ArrayLike | None = None,
        *,
        kind: Kind | None = None,
    ) -> None:
        self.times: NDArray[np.float64] = frozen_column("times", times, np.float64)
        self.offsets: NDArray[np.int64] = frozen_column("offsets", offsets, np.int64)
        self.values: NDArray[np.float32] | None = (
            None if values is None else frozen_column("values", values, np.float32)
        )
        self.kind: Kind = _kind(kind, self.values)
        self.start, self.stop = number("start", start), number("stop", stop)
        _core.check_spikes(self)

    @classmethod
    def from_lists(
        cls,
        times: Sequence[ArrayLike],
        start: float = 0.0,
        stop: float | None = None,
        values: Sequence[ArrayLike] | None = None,
        *,
        kind: Kind | None = None,
    ) -> SpikeTrains:
        """Build spike trains from a list of times for each train.

        Parameters
        ----------
        times : sequence of float sequences, ms
            Ascending in each train; a train may be empty.
        start : float, ms
        stop : float, ms, optional
            Default: the time of the last spike.
        values : sequence of float sequences, a polarity or bits, or a factor of the weight, a spike, optional
        kind : "unsigned", "signed" or "graded", optional
            As in `SpikeTrains`.

        Returns
        -------
        SpikeTrains

        Raises
        ------
        ProblemError : invalid times or values (names train and spike)

        Examples
        --------
        >>> SpikeTrains.from_lists([[1.0, 5.0], []], stop=10.0)
        SpikeTrains(2 trains, 2 spikes, 0 to 10 ms)
        """
        flat, counts = _by_train("times", times, np.float64)
        valued = None
        if values is not None:
            valued, lengths = _by_train("values", values, np.float32)
            if lengths != counts:
                raise refused("values", ": must have the lengths of the trains, one value per spike")
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        if stop is None:
            # Values that are not finite are refused below, with their positions.
            stop = float(max(number("start", start), np.max(flat[np.isfinite(flat)], initial=-np.inf)))
        return cls._of_own(flat, offsets, start, stop, valued, kind)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __iter__(self) -> Iterator[NDArray[np.float64]]:
        return (self[n] for n in range(len(self)))

    def __getitem__(self, train: int) -> NDArray[np.float64]:
        """Return the times of one train, ms."""
        if isinstance(train, bool) or not isinstance(train, int | np.integer):
            raise refused("trains", f"[{shown(train)}]: choose one train by its number, several by select")
        n = nth("train", train, len(self))
        return self.times[self.offsets[n] : self.offsets[n + 1]]

    @property
    def counts(self) -> NDArray[np.int64]:
        """Spikes by train."""
        return np.diff(self.offsets)

    @property
    def signed(self) -> bool:
        """Whether the values are polarities or bits: each train is two inputs of a neuron, ON and OFF."""
        return self.kind == "signed"

    @classmethod
    def side_by_side(cls, parts: Sequence[SpikeTrains]) -> SpikeTrains:
        """Return the trains of all parts as the inputs of one neuron: first those of part 0, then those of part 1.

        Signed trains are split by sign first. If a part is graded, all trains are graded, and the spikes of the other
        parts have the value 1.

        Parameters
        ----------
        parts : sequence of SpikeTrains, one or more

        Returns
        -------
        SpikeTrains
            Unsigned or graded; the window holds the windows of all parts.

        Raises
        ------
        ProblemError : no part, or a part that is not spike trains

        Examples
        --------
        >>> touch = SpikeTrains.from_lists([[1.0]], stop=9.0)
        >>> area = SpikeTrains.from_lists([[2.0], [3.0]], stop=9.0, values=[[0.5], [2.5]], kind="graded")
        >>> both = SpikeTrains.side_by_side([touch, area])
        >>> both, both.values
        (SpikeTrains(3 trains, 3 spikes, graded, 0 to 9 ms), array([1. , 0.5, 2.5], dtype=float32))
        """
        each = [instance(f"parts[{n}]", part, SpikeTrains) for n, part in enumerate(several("parts", parts))]
        if not each:
            raise refused("parts", " is empty: must have one train or more")
        each = [trains.split_by_sign() if trains.signed else trains for trains in each]
        graded = any(trains.kind == "graded" for trains in each)
        return cls._of_own(
            np.concatenate([trains.times for trains in each]),
            np.concatenate([[0], np.cumsum(np.concatenate([trains.counts for trains in each]))]).astype(np.int64),
            min(trains.start for trains in each),
            max(trains.stop for trains in each),
            np.concatenate([trains._ones_without() for trains in each]) if graded else None,
            "graded" if graded else "unsigned",
        )

    def split_by_sign(self) -> SpikeTrains:
        """Return all ON trains (value above 0), then all OFF trains; unsigned trains are returned unchanged.

        Raises
        ------
        ProblemError : graded trains, whose values multiply the weight
        """
        return self._of_own(**_core.split_by_sign(self))

    def between(self, start: float, stop: float) -> SpikeTrains:
        """Return the spikes of ``start <= t < stop``, with that window; times stay as they are.

        Parameters
        ----------
        start, stop : float, ms

        Returns
        -------
        SpikeTrains

        Raises
        ------
        ProblemError : an invalid window

        Examples
        --------
        >>> SpikeTrains.from_lists([[1.0, 5.0], [3.0]], stop=10.0).between(2.0, 5.0)
        SpikeTrains(2 trains, 1 spike, 2 to 5 ms)
        """
        start, stop = window("ms", start, stop)
        inside = (self.times >= start) & (self.times < stop)
        offsets = np.concatenate([[0], np.cumsum(inside)])[self.offsets]
        values = None if self.values is None else self.values[inside]
        return self._of_own(self.times[inside], offsets, start, stop, values, self.kind)

    def select(self, trains: ArrayLike) -> SpikeTrains:
        """Return the named trains, in the order given.

        Parameters
        ----------
        trains : int of shape (n,), or bool of shape (trains,)
            Numbers of trains, which count from the end if they are negative, or a mask over all of them.

        Returns
        -------
        SpikeTrains

        Raises
        ------
        ProblemError : a number outside the trains

        Examples
        --------
        >>> list(SpikeTrains.from_lists([[1.0], [2.0], [3.0]], stop=10.0).select([2, 0]))
        [array([3.]), array([1.])]
        """
        numbers = np.arange(len(self))[rows("trains", trains, len(self))].tolist()
        every = self._values()
        values = None if every is None else [every[n] for n in numbers]
        return SpikeTrains.from_lists([self[n] for n in numbers], self.start, self.stop, values, kind=self.kind)

    def delayed(self, delays_ms: ArrayLike) -> SpikeTrains:
        """Return every train once at each delay, so that a learner can choose among the delays.

        Parameters
        ----------
        delays_ms : float64, shape (delays,), ms, 0 or more, ascending

        Returns
        -------
        SpikeTrains
            First all trains at the first delay, then all at the second: train `n` at delay `d` is number
            ``d * len(trains) + n``, so ``weights.reshape(delays, trains)`` has the weights by delay and train. The
            window ends later by the longest delay.

        Raises
        ------
        ProblemError : delays that are negative, not finite or do not ascend

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[1.0], [4.0]], stop=5.0)
        >>> list(trains.delayed([0.0, 2.5]))
        [array([1.]), array([4.]), array([3.5]), array([6.5])]
        """
        delays = floats("delays_ms", delays_ms)
        wrong = np.flatnonzero(~(np.isfinite(delays) & (delays >= 0)))
        if len(wrong):
            raise refused("delays_ms", f"[{wrong[0]}] is {delays[wrong[0]]}: must be 0 or more and finite")
        if not len(delays) or (np.diff(delays) <= 0).any():
            raise refused("delays_ms", ": must ascend, one delay or more")
        times = np.add.outer(delays, self.times).reshape(-1)
        offsets = np.add.outer(np.arange(len(delays)) * len(self.times), self.offsets[:-1]).reshape(-1)
        values = None if self.values is None else np.tile(self.values, len(delays))
        ends = np.append(offsets, len(times))
        return self._of_own(times, ends, self.start, self.stop + delays[-1], values, self.kind)

    def lasting(self, stop: float) -> SpikeTrains:
        """Return the same spikes in a window that ends at `stop`.

        Parameters
        ----------
        stop : float, ms, the last spike or later

        Returns
        -------
        SpikeTrains

        Raises
        ------
        ProblemError : a spike after `stop` (names train and spike)

        Examples
        --------
        >>> SpikeTrains.from_lists([[1.0]]).lasting(5.0)
        SpikeTrains(1 train, 1 spike, 0 to 5 ms)
        """
        return SpikeTrains(self.times, self.offsets, self.start, stop, self.values, kind=self.kind)

    def _ones_without(self) -> NDArray[np.float32]:
        """Return the values, 1 a spike of unsigned trains."""
        return np.ones(len(self.times), np.float32) if self.values is None else self.values

    def _ungraded(self, reader: str) -> SpikeTrains:
        """Return the trains; refuse graded ones on behalf of `reader`, which reads no values."""
        if self.kind == "graded":
            raise ProblemError(f"{reader} takes no graded trains: their spikes have values, which it does not read")
        return self

    def to_numpy(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return times (ms) and train numbers of all spikes, by train."""
        return self.times.copy(), np.repeat(np.arange(len(self)), self.counts)

    def to_neo(self) -> list[Any]:
        """Return a ``neo.SpikeTrain`` for each train; values become the array annotation ``value``.

        Trains that are graded have the annotation ``value_kind``, "graded".

        Raises
        ------
        ImportError : neo is not installed (``pip install 'taxel[neo]'``)
        """
        from neo import SpikeTrain  # noqa: PLC0415  heavy

        trains, every = [], self._values()
        for n in range(len(self)):
            notes: dict[str, Any] = {"value_kind": self.kind} if self.kind == "graded" else {}
            if every is not None:
                notes["array_annotations"] = {"value": every[n]}
            trains.append(SpikeTrain(self[n], units="ms", t_start=self.start, t_stop=self.stop, **notes))
        return trains

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write the trains to a .npz (``times offsets start stop``, ``values`` if any); return its path.

        Graded trains have a further entry, ``kind``.

        Parameters
        ----------
        path : path
        overwrite : bool

        Returns
        -------
        pathlib.Path

        Raises
        ------
        ProblemError : an invalid path
        FileExistsError : the file is there already and `overwrite` is false
        """
        columns: dict[str, Any] = {"times": self.times, "offsets": self.offsets, "start": self.start, "stop": self.stop}
        if self.values is not None:
            columns["values"] = self.values
        if self.kind == "graded":
            columns["kind"] = np.array(self.kind)
        return write_whole(path, lambda file: np.savez_compressed(file, **columns), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> SpikeTrains:
        """Read the trains from the file that `save` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        SpikeTrains

        Raises
        ------
        FormatError : another file (names it)
        FileNotFoundError : no such file

        Examples
        --------
        >>> import tempfile
        >>> place = SpikeTrains.from_lists([[1.0, 5.0]]).save(Path(tempfile.mkdtemp()) / "trains.npz")
        >>> SpikeTrains.load(place).times
        array([1., 5.])
        """
        file = checked_path("path", path)
        arrays = read_arrays(file, ("times", "offsets", "start", "stop", "values", "kind"))
        try:
            kind = arrays["kind"].item() if "kind" in arrays else None
            start, stop = arrays["start"].item(), arrays["stop"].item()
            return cls(arrays["times"], arrays["offsets"], start, stop, arrays.get("values"), kind=kind)
        except KeyError as missing:
            raise unreadable(f"contains no spike trains, because the array {missing} is missing", file) from None
        except (ValueError, ProblemError) as error:
            raise unreadable(f"contains no spike trains: {first_line(error)}", file) from None

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the raster: time (ms) to the right, trains upwards, OFF spikes and values below 0 in another colour."""
        return draw("raster", self, ax)  # type: ignore[no-any-return]

    def _values(self) -> list[NDArray[np.float32]] | None:
        """Return the values train by train."""
        return None if self.values is None else np.split(self.values, self.offsets[1:-1])

    @classmethod
    def _of_own(
        cls,
        times: NDArray[np.float64],
        offsets: NDArray[np.int64],
        start: float,
        stop: float,
        values: NDArray[np.float32] | None,
        kind: Kind | None,
    ) -> SpikeTrains:
        """Build spike trains from new arrays of our own."""
        return cls(frozen(times), frozen(offsets), start, stop, None if values is None else frozen(values), kind=kind)

    def __repr__(self) -> str:
        kind = "" if self.kind == "unsigned" else f", {self.kind}"
        size = f"{counted(len(self), 'train')}, {counted(len(self.times), 'spike')}"
        return f"SpikeTrains({size}{kind}, {self.start:g} to {self.stop:g} ms)"


def _by_train(name: str, lists: Sequence[ArrayLike], dtype: type[Any]) -> tuple[NDArray[Any], list[int]]:
    """Return all entries, train after train, and how many each train has."""
    entries = several(name, lists)
    if not entries:
        return np.empty(0, dtype), []
    try:
        # All trains are converted at once: a thousand trains of one spike cost little more than one train of a
        # thousand.
        arrays = [np.asarray(entry, object) for entry in entries]
        return column(name, np.concatenate(arrays), dtype), [len(array) for array in arrays]
    except (ProblemError, TypeError, ValueError):
        # They are converted one by one, so that the error names the train.
        each = [np.atleast_1d(np.asarray(entry, object)) for entry in entries]
        columns = [column(f"{name}[{n}]", array, dtype) for n, array in enumerate(each)]
        return np.concatenate(columns), [len(values) for values in columns]


def _kind(kind: object, values: NDArray[np.float32] | None) -> Kind:
    """Return the kind; by default that of trains with or without values."""
    if kind is None:
        return "unsigned" if values is None else "signed"
    if not isinstance(kind, str) or kind not in _KINDS:
        raise refused("kind", f" is {shown(kind)}: must be one of {', '.join(_KINDS)}")
    return kind


def to_ms(us: _Time) -> _Time:
    """Convert times of the wire, us, to the unit of neurons, ms."""
    return us / 1000.0


def to_us(ms: _Time) -> _Time:
    """Convert times of neurons, ms, to the unit of the wire, us, without rounding."""
    return ms * 1000.0
