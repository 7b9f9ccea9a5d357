"""Events: changes at taxels, with their times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import column, fields, instance, nth, rows, say_if_missed, shown, window
from taxel._base.columns import FrozenColumns, frozen, frozen_column
from taxel._base.drawing import draw
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.array import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Events"]

#: The columns and their types; the last three are None where no event has them.
_COLUMNS: dict[str, type[np.generic]] = {
    "t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.bool_, "intensity": np.uint16, "present": np.bool_,
    "repaired": np.bool_,
}  # fmt: skip


class Event(NamedTuple):
    """One change at a taxel.

    Attributes
    ----------
    t : int, us
    x, y : int
        Column and row.
    p : bool
        Polarity: more pressure (true) or less.
    intensity : int, ticks, or None
        The held value that arrived with the change, if any.
    repaired : bool
        Whether it was derived from a state of wire version 2 after a loss: the change happened some time before `t`.
    """

    t: int
    x: int
    y: int
    p: bool
    intensity: int | None
    repaired: bool = False


class Events(FrozenColumns):
    """Changes at taxels, in the order of their arrival.

    Parameters
    ----------
    t : int64, shape (events,), us
        Unwrapped time.
    x, y : uint16, shape (events,), taxels
        Column and row.
    p : bool, shape (events,)
        Polarity: more pressure (true) or less.
    array : Array
        The sensor; every event must be on it.
    intensity : uint16, shape (events,), ticks, optional
        The held value that arrived with each change (1/300 us of the board's counter).
    present : bool, shape (events,), optional
        Which events have an intensity; default: all.
    repaired : bool, shape (events,), optional
        Which events were derived from a state of wire version 2 that differed from the held value: their change
        happened some time before `t`. None if there is no such event.
    markers : sequence of (t us, start), optional
        The board's markers of the start (true) and stop (false) of a recording.

    Raises
    ------
    ProblemError : columns of unequal length, or an event outside the array (names the event)

    Notes
    -----
    Columns are read-only: a caller's arrays are copied once, unless they are read-only themselves. Every reader can
    therefore use them in place.

    Examples
    --------
    >>> events = Events([0, 192], [3, 4], [5, 5], [True, False], array=Array(8, 8))
    >>> events
    Events(2 events, 0 to 192 us, 8 x 8 taxels, no intensities)
    >>> len(events.between(0, 100))
    1
    >>> events[0]
    Event(t=0, x=3, y=5, p=True, intensity=None, repaired=False)
    """

    _COMPARED: ClassVar[tuple[str, ...]] = ("array", "markers", *_COLUMNS)

    def __init__(
        self,
        t: ArrayLike,
        x: ArrayLike,
        y: ArrayLike,
        p: ArrayLike,
        *,
        array: Array,
        intensity: ArrayLike | None = None,
        present: ArrayLike | None = None,
        repaired: ArrayLike | None = None,
        markers: Sequence[tuple[int, bool]] = (),
    ) -> None:
        self.array = instance("array", array, Array)
        self.t: NDArray[np.int64] = frozen_column("t", t, np.int64, "us")
        self.x: NDArray[np.uint16] = frozen_column("x", x, np.uint16)
        self.y: NDArray[np.uint16] = frozen_column("y", y, np.uint16)
        self.p: NDArray[np.bool_] = frozen_column("p", p, np.bool_)
        self.intensity: NDArray[np.uint16] | None = None
        self.present: NDArray[np.bool_] | None = None
        if intensity is not None:
            self.intensity = frozen_column("intensity", intensity, np.uint16)
            all_of_them = np.ones(len(self.intensity), np.bool_)
            self.present = frozen(all_of_them) if present is None else frozen_column("present", present, np.bool_)
            if len(self.present) == len(self.intensity) and self.intensity[~self.present].any():
                # An absent intensity is stored as 0, so that equal events have equal columns.
                self.intensity = frozen(np.where(self.present, self.intensity, np.uint16(0)))
        elif present is not None:
            raise ProblemError("present is given without intensity: give both or neither")
        self.repaired = _where_any(None if repaired is None else frozen_column("repaired", repaired, np.bool_))
        self.markers = _markers(markers)
        _core.check_events(self)

    def __len__(self) -> int:
        return len(self.t)

    @property
    def duration_us(self) -> int:
        """The time from the first event to the last, us; 0 without events."""
        return int(self.t.max() - self.t.min()) if len(self) else 0

    def between(self, start: float, stop: float) -> Events:
        """Return the events of ``start <= t < stop`` (us), with the markers of that time.

        Parameters
        ----------
        start, stop : float, us

        Raises
        ------
        ProblemError : a start after the stop, or a time that is not a number

        Examples
        --------
        >>> events = Events([0, 192], [3, 4], [5, 5], [True, False], array=Array(8, 8))
        >>> events.between(100, 200).t
        array([192])
        """
        start, stop = window("us", start, stop)
        say_if_missed("event", self.t, start, stop)
        selected = self[(self.t >= start) & (self.t < stop)]
        selected.markers = tuple(m for m in self.markers if start <= m[0] < stop)
        return selected

    def region(self, x: slice, y: slice) -> Events:
        """Return the events of a rectangle of columns `x` and rows `y` as those of a smaller array, as of `Frames`.

        Parameters
        ----------
        x, y : slice
            Columns and rows, without a step.

        Raises
        ------
        ProblemError : not slices of whole numbers, a slice with a step, or no taxel

        Examples
        --------
        >>> events = Events([0, 192], [3, 4], [5, 5], [True, False], array=Array(8, 8))
        >>> events.region(slice(4, 8), slice(None)).x
        array([0], dtype=uint16)
        """
        (left, right), (top, bottom) = self.array.region(x, y)
        inside = self[(self.x >= left) & (self.x < right) & (self.y >= top) & (self.y < bottom)]
        places = {"x": inside.x - np.uint16(left), "y": inside.y - np.uint16(top)}
        return self._unchecked(self.array._part(x, y), self.markers, **inside._columns | places)

    def sorted(self) -> Events:
        """Return the same events and markers in order of time; those with equal times keep their order.

        Encoders and readouts need a recording in order of time; they tolerate events up to 0.1 s late (reordered
        datagrams).
        """
        ordered = self[np.argsort(self.t, kind="stable")]
        ordered.markers = tuple(sorted(self.markers, key=lambda marker: marker[0]))
        return ordered

    def __iter__(self) -> Iterator[Event]:
        ticks = np.full(len(self), None)
        if self.intensity is not None:
            ticks[self.present] = self.intensity[self.present]
        repaired = np.zeros(len(self), np.bool_) if self.repaired is None else self.repaired
        return map(Event, *(column.tolist() for column in (self.t, self.x, self.y, self.p, ticks, repaired)))

    @overload
    def __getitem__(self, chosen: int) -> Event: ...
    @overload
    def __getitem__(self, chosen: slice | ArrayLike) -> Events: ...
    def __getitem__(self, chosen: int | slice | ArrayLike) -> Event | Events:
        """Return one event by its number, or the chosen events (slice, mask or numbers) with the markers of their time.

        That time begins with the first chosen event and ends before the event that follows the last one; it has no end
        if no event follows, and no beginning if the very first event is chosen. Adjacent slices therefore hold each
        marker once.
        """
        if isinstance(chosen, int | np.integer) and not isinstance(chosen, bool):
            n = nth("event", chosen, len(self))
            return next(iter(self[n : n + 1]))
        indices = chosen if isinstance(chosen, slice) else rows("events", chosen, len(self))
        try:
            if isinstance(indices, slice) and indices.step not in (None, 1):
                # The compiled part reads contiguous columns.
                indices = np.arange(len(self))[indices]
            columns = {name: column[indices] for name, column in self._columns.items()}
        except (TypeError, ValueError) as error:
            raise refused("events", f"[{shown(chosen)}]: {error}") from None
        return self._unchecked(self.array, self._markers_of(indices), **columns)

    def _markers_of(self, indices: slice | NDArray[Any]) -> tuple[tuple[int, bool], ...]:
        """Return the markers of the time of chosen events."""
        if not self.markers or not len(self):
            return self.markers
        chosen = np.arange(len(self))[indices]
        if not len(chosen):
            return ()
        first, last = int(chosen.min()), int(chosen.max())
        start = self.t[first] if first > 0 else -np.inf
        stop = self.t[last + 1] if last + 1 < len(self) else np.inf
        return tuple(marker for marker in self.markers if start <= marker[0] < stop)

    def __add__(self, other: Events) -> Events:
        """Return the events and markers of both in order of time, those of the first before the other's at equal times.

        If only one of them has intensities, those of the other are marked as absent.

        Raises
        ------
        ProblemError : events of another array
        """
        if not isinstance(other, Events):
            return NotImplemented
        if not self.array.fits(other.array):
            raise ProblemError(
                f"events of {self.array!r} and of {other.array!r}: only events of one array can be merged"
            )
        return self._joined((self, other)).sorted()

    @classmethod
    def _joined(cls, tables: Sequence[Events]) -> Events:
        """Return the events and markers of tables of one array, those of the first before those of the next."""
        each = [table._columns for table in tables]
        columns = {
            name: np.concatenate([one.get(name, np.zeros(len(one["t"]), _COLUMNS[name])) for one in each])
            for name in dict.fromkeys(name for one in each for name in one)
        }
        markers = [marker for table in tables for marker in table.markers]
        return cls._unchecked(tables[0].array, markers, **columns)

    def _moved(self, times: Callable[[NDArray[np.int64]], NDArray[np.int64]]) -> Events:
        """Return the same events and markers by another clock."""
        at = times(np.array([t for t, _ in self.markers], np.int64)).tolist()
        markers = tuple(zip(at, (start for _, start in self.markers), strict=True))
        return self._unchecked(self.array, markers, **self._columns | {"t": times(self.t)})

    def _on(self, array: Array) -> Events:
        """Return the same events on another description of their sensor."""
        same = self[:]
        same.array = array
        return same

    def to_numpy(self) -> NDArray[np.void]:
        """Return a record for each event: ``t x y p``, with ``intensity present`` and ``repaired`` if there are any."""
        return self._records(self._columns)

    @classmethod
    def from_numpy(cls, records: NDArray[np.void], array: Array) -> Events:
        """Build events from records with the fields ``t x y p``, and optionally ``intensity present repaired``.

        Parameters
        ----------
        records : structured array, shape (events,), with the units of the columns
        array : Array

        Raises
        ------
        ProblemError : a field is missing (names it)

        Examples
        --------
        >>> events = Events([0, 192], [3, 4], [5, 5], [True, False], array=Array(8, 8))
        >>> Events.from_numpy(events.to_numpy(), Array(8, 8)) == events
        True
        """
        names = fields(records, ("t", "x", "y", "p"))
        extra: dict[str, Any] = {n: records[n] for n in ("intensity", "present", "repaired") if n in names}
        return cls(records["t"], records["x"], records["y"], records["p"], array=array, **extra)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the number of events of each taxel: rises in one colour, falls in another."""
        return draw("event_picture", self, ax)  # type: ignore[no-any-return]

    @property
    def _columns(self) -> dict[str, NDArray[Any]]:
        """The columns by name, without those that no event has."""
        return {name: column for name in _COLUMNS if (column := getattr(self, name)) is not None}

    @classmethod
    def _unchecked(cls, array: Array, markers: Sequence[tuple[int, bool]], **columns: NDArray[Any] | None) -> Events:
        """Build events from columns that the compiled part or another `Events` has already checked."""
        events = cls.__new__(cls)
        events.array, events.markers = array, tuple(markers)
        for name in _COLUMNS:
            column = columns.get(name)
            setattr(events, name, None if column is None else frozen(column))
        events.repaired = _where_any(events.repaired)
        return events

    def __repr__(self) -> str:
        time = f"{int(self.t.min())} to {int(self.t.max())} us" if len(self) else "no time"
        count = None if self.present is None else int(self.present.sum())
        intensities = "no intensities" if count is None else counted(count, "intensity", "intensities")
        marks = "" if self.repaired is None else f", {int(self.repaired.sum())} repaired"
        marks += f", {counted(len(self.markers), 'marker')}" if self.markers else ""
        size = f"{self.array.rows} x {self.array.columns} taxels"
        return f"Events({counted(len(self), 'event')}, {time}, {size}, {intensities}{marks})"


def _markers(markers: Sequence[tuple[int, bool]]) -> tuple[tuple[int, bool], ...]:
    try:
        pairs = [(at, start) for at, start in markers]
        t = column("markers", [at for at, _ in pairs], np.int64)
        starts = column("markers", [start for _, start in pairs], np.bool_)
    except (TypeError, ValueError):
        raise refused(
            "markers", f" is {shown(markers)}: must be pairs of a time (us) and start (True) or stop"
        ) from None
    return tuple(zip(t.tolist(), starts.tolist(), strict=True))


def _where_any(repaired: NDArray[np.bool_] | None) -> NDArray[np.bool_] | None:
    """Return the mask, or None if it marks no event, so that equal events have equal columns."""
    return None if repaired is None or not repaired.any() else repaired
