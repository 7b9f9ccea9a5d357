"""Frames of the whole array over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import finite, instance, integer, say_if_missed, shown, text, window
from taxel._base.columns import FrozenColumns, frozen, frozen_column, frozen_numbers
from taxel._base.drawing import draw
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.regions import Region

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

__all__ = ["Frames"]

Values: TypeAlias = NDArray[np.float64]
#: The force in N of a pressure of 1 on 1 mm2, by its unit.
_NEWTON = {"kPa": 1e-3, "N/cm2": 1e-2}
#: The largest size of frames made from events: 4 GiB.
MOST_VALUES = 2**30


class Frames(FrozenColumns):
    """Frames of the whole array over time.

    Parameters
    ----------
    values : float32, shape (n, rows, columns)
        Finite, or NaN where a value is missing.
    t : int64, shape (n,), us
        Ascending.
    unit : str
        Unit of the values: "ticks", "N", "kPa", "counts" ...
    array : Array, optional
        The sensor; default: made from the shape.

    Raises
    ------
    ProblemError : shapes that do not fit, an infinite value, or times that do not ascend (names the frame)

    Notes
    -----
    `values` and `t` are read-only: a caller's arrays are copied once, unless they are read-only themselves.

    Examples
    --------
    >>> frames = Frames(np.zeros((3, 8, 8)), [0, 192, 384], unit="ticks")
    >>> frames
    Frames(3 frames of 8 x 8 taxels, 0 to 384 us, ticks)
    """

    _COMPARED: ClassVar[tuple[str, ...]] = ("array", "unit", "t", "values")

    def __init__(self, values: ArrayLike, t: ArrayLike, *, unit: str = "counts", array: Array | None = None) -> None:
        self.values: NDArray[np.float32] = frozen_numbers("values", values, np.float32)
        # Values that are not copied are read-only: a part of other frames, or values that a reader has checked.
        if not (isinstance(values, np.ndarray) and np.may_share_memory(self.values, values)):
            _refuse_infinite("values", self.values)
        self.t: NDArray[np.int64] = frozen_column("t", t, np.int64, "us")
        if self.values.ndim != 3:
            found = counted(self.values.ndim, "dimension")
            raise refused("values", f" have {found}: must have three (n, rows, columns)")
        if len(self.t) != len(self.values):
            raise refused("t", f" has shape {self.t.shape}: must be ({len(self.values)},), one time per frame")
        back = np.flatnonzero(self.t[1:] <= self.t[:-1])
        if len(back):
            k = int(back[0])
            raise refused("t", f"[{k + 1}] is {self.t[k + 1]} us, not after t[{k}] = {self.t[k]} us")
        self.unit = text("unit", unit)
        if not unit:
            raise refused("unit", " is '': must be the unit of the values")
        self.array = Array(*self.values.shape[1:]) if array is None else instance("array", array, Array)
        if self.array.shape != self.values.shape[1:]:
            raise ProblemError(f"frames have shape {self.values.shape[1:]}: the array has {self.array.shape}")

    @classmethod
    def from_events(
        cls,
        events: Events,
        period_us: int,
        start: int | None = None,
        stop: int | None = None,
        *,
        held: ArrayLike | None = None,
    ) -> Frames:
        """Return the held intensities as frames, one every `period_us`.

        A frame at time t includes all events up to and at t. A taxel reads its value of `held`, or 0, until its first
        event.

        Parameters
        ----------
        events : Events
            With intensities.
        period_us : int, us, 1 or more
        start, stop : int, us, optional
            Time of the first frame, and the end (exclusive) of the frames; default: the time of the events.
        held : shape (rows, columns), ticks, optional
            The values of the taxels before the first event, if known.

        Raises
        ------
        ProblemError : events without intensities, a period below 1 us, or held values of another array

        Examples
        --------
        >>> from taxel.events import Events
        >>> events = Events([0, 150], [0, 1], [0, 0], [True, True], array=Array(1, 2), intensity=[5, 7])
        >>> Frames.from_events(events, 100, 0, 250).values[:, 0]
        array([[5., 0.],
               [5., 0.],
               [5., 7.]], dtype=float32)
        """
        instance("events", events, Events)
        if events.intensity is None or events.present is None:
            raise ProblemError("these events have no intensities, so no frames can be made from them")
        period, array = integer("period_us", period_us, 1), events.array
        first = int(events.t.min()) if len(events) else 0
        first = first if start is None else integer("start", start)
        end = int(events.t.max()) + 1 if len(events) else first
        end = end if stop is None else integer("stop", stop)
        count = max(0, -((first - end) // period))
        if count * array.rows * array.columns > MOST_VALUES:
            raise ProblemError(
                f"{count} frames from {first} to {end} us: at most {MOST_VALUES} values are made at once; take a "
                f"shorter stretch or a period longer than {period} us"
            )
        t = np.arange(count, dtype=np.int64) * period + first
        begins = None if held is None else frozen_numbers("held", held, np.float32)
        if begins is not None and begins.shape != array.shape:
            raise refused("held", f" has shape {begins.shape}: must be {array.shape}, that of the array")
        if begins is not None:
            _refuse_infinite("held", begins)
        values = _core.HeldValues(events, None, None if begins is None else begins.reshape(-1)).at(t)
        return cls(frozen(values).reshape(len(t), *array.shape), frozen(t), unit="ticks", array=array)

    @cached_property
    def _found(self) -> dict[str, Any]:
        """Results of costly functions of these values, which never change (`taxel.recording.analysis.rest`)."""
        return {}

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, chosen: slice) -> Frames:
        """Return consecutive frames."""
        if not isinstance(chosen, slice):
            raise ProblemError(f"frames[{shown(chosen)}]: choose frames by a slice")
        try:
            return Frames(self.values[chosen], self.t[chosen], unit=self.unit, array=self.array)
        except (TypeError, ValueError) as error:
            raise ProblemError(f"frames[{shown(chosen)}]: {error}") from None

    def between(self, start: float, stop: float) -> Frames:
        """Return the frames of ``start <= t < stop`` (us).

        Parameters
        ----------
        start, stop : float, us

        Raises
        ------
        ProblemError : a start after the stop, or a time that is not a number

        Examples
        --------
        >>> len(Frames([[[1.0]], [[2.0]]], [0, 100]).between(50, 150))
        1
        """
        start, stop = window("us", start, stop)
        say_if_missed("frame", self.t, start, stop)
        first, last = np.searchsorted(self.t, [start, stop])
        return self[int(first) : int(last)]

    @overload
    def region(self, x: slice, y: slice | None = None) -> Frames: ...
    @overload
    def region(self, x: Region, *, above: float = 0.0, range_end: float | None = None) -> dict[str, Values]: ...
    def region(
        self, x: slice | Region, y: slice | None = None, *, above: float = 0.0, range_end: float | None = None
    ) -> Frames | dict[str, Values]:
        """Return the frames of a rectangle of columns `x` and rows `y`, as a smaller array; or what loads a region.

        Parameters
        ----------
        x : slice or Region
            Columns, without a step; or a region.
        y : slice, optional
            Rows, without a step; default: all. A region has its own.
        above : float, in the frames' unit
            Of a region: a taxel with a greater value is loaded.
        range_end : float, in the frames' unit, optional
            Of a region: the value at which the range of a taxel ends.

        Returns
        -------
        Frames, or of a region dict from str to float64, shape (n,)
            By name and unit: ``force_N`` (else ``sum_UNIT``), of the loaded taxels, each by the share of its area that
            is inside; ``mean_UNIT``, over their area; ``peak_UNIT``, the largest value of a taxel whose middle is
            inside; ``area_mm2`` (else ``area_taxels``); ``centre_x_UNIT`` and ``centre_y_UNIT``, not of channels;
            ``at_range_end_taxels``. NaN in frames without a loaded taxel, but for sums, areas and numbers.

        Raises
        ------
        ProblemError : not slices of whole numbers, a slice with a step, or a rectangle or region without a taxel

        Examples
        --------
        >>> Frames([[[1.0, 2.0]]], [0]).region(slice(1, 2), slice(None)).values
        array([[[2.]]], dtype=float32)
        >>> frames = Frames([[[100.0, 200.0]]], [0], unit="kPa", array=Array(1, 2, pitch_mm=10.0))
        >>> frames.region(Region.rectangle("half", -5, -5, 10, 5))["force_N"]
        array([20.])
        """
        if isinstance(x, Region):
            return self._loads(x, above, range_end)
        y = slice(None) if y is None else y
        columns, rows = self.array.region(x, y)
        array, values = self.array._part(x, y), self.values[:, slice(*rows), slice(*columns)]
        return Frames(values, self.t, unit=self.unit, array=array)

    def _loads(self, region: Region, above: float, range_end: float | None) -> dict[str, Values]:
        """Return what loads a region (`region`)."""
        array = self.array
        shares, inside = region.shares(array), region.centred(array)
        rows, columns = (slice(k.min(), k.max() + 1) for k in np.nonzero(shares))
        shares, inside = shares[rows, columns], inside[rows, columns]
        values = self.values[:, rows, columns]
        loaded = self._loaded(above)[:, rows, columns]
        areas = array.area_mm2
        area = np.ones(shares.shape) if areas is None else areas[rows, columns]
        there = np.einsum("nij,ij->n", loaded, shares * area)
        weights = np.where(loaded, values, 0.0) * shares
        force = self._in_n
        load = np.einsum("nij,ij->n", weights, area if force else np.ones(area.shape))
        over_area = np.einsum("nij,ij->n", weights, area)
        peak = np.where(loaded & inside, values, -np.inf).max(axis=(1, 2))
        unit = self.unit
        found = {
            "force_N" if force else f"sum_{unit}": load * (force or 1.0),
            f"mean_{unit}": np.divide(over_area, there, out=np.full(len(self), np.nan), where=there > 0),
            f"peak_{unit}": np.where(np.isfinite(peak), peak, np.nan),
            "area_taxels" if areas is None else "area_mm2": there,
        }
        if array.centre_unit is not None:
            centre = _centre(weights, np.stack(array.positions())[:, rows, columns])
            found |= {f"centre_{name}_{array.centre_unit}": centre[:, k] for k, name in enumerate("xy")}
        if range_end is not None:
            at_end = (values >= finite("range_end", range_end)) & inside
            found["at_range_end_taxels"] = np.count_nonzero(at_end, axis=(1, 2)).astype(np.float64)
        return found

    @property
    def _in_n(self) -> float | None:
        """The force in N of a value of 1 on 1 mm2; None where the force is not known."""
        return None if self.array.area_mm2 is None else _NEWTON.get(self.unit)

    def force(self) -> Values | None:
        """Return the force of each frame, N, shape (n,); None where neither unit nor areas tell it.

        Examples
        --------
        >>> Frames([[[100.0, 200.0]]], [0], unit="kPa", array=Array(1, 2, pitch_mm=10.0)).force()
        array([30.])
        """
        if self.unit == "N":
            return self.total()
        areas, factor = self.array.area_mm2, self._in_n
        if areas is None or factor is None:
            return None
        return np.asarray(np.einsum("nij,ij->n", self.values, areas, dtype=np.float64) * factor)

    def maximum(self) -> NDArray[np.float32]:
        """Return the largest value of each taxel, shape (rows, columns): the maximum picture; NaN without a value.

        Raises
        ------
        ProblemError : no frame

        Examples
        --------
        >>> Frames([[[1.0, 2.0]], [[3.0, 0.0]]], [0, 100]).maximum()
        array([[3., 2.]], dtype=float32)
        """
        if not len(self):
            raise ProblemError("no frame has no maximum picture")
        return np.asarray(np.fmax.reduce(self.values, axis=0))

    def centre_path(self, share: float = 0.02) -> Values:
        """Return the path of the centre of pressure: `centre`, NaN while the sum is at most a share of its largest.

        Parameters
        ----------
        share : float, 0 to 1
            With few taxels loaded, as when a foot leaves the ground, the centre jumps.

        Returns
        -------
        float64, shape (n, 2), in the array's `centre_unit`

        Raises
        ------
        ProblemError : channels, which have no centre; a share outside 0 to 1

        Examples
        --------
        >>> Frames([[[0.0, 1.0]], [[90.0, 10.0]]], [0, 100], array=Array(1, 2, pitch_mm=5.0)).centre_path()[:, 0]
        array([nan, 0.5])
        """
        least = finite("share", share, least=0.0, most=1.0)
        total = self.total()
        counts = total > least * np.nanmax(total, initial=0.0)
        return np.where(counts[:, None], self.centre(), np.nan)

    @classmethod
    def _joined(cls, tables: Sequence[Frames]) -> Frames:
        """Return the frames of one sensor and unit in order of time."""
        t = np.concatenate([table.t for table in tables])
        order = np.argsort(t, kind="stable")
        if len(twice := np.flatnonzero(np.diff(t[order]) == 0)):
            raise ProblemError(f"two frames are at {t[order][twice[0]]} us: put one recording after another by a gap")
        values = np.concatenate([table.values for table in tables])[order]
        return cls(frozen(values), t[order], unit=tables[0].unit, array=tables[0].array)

    def _moved(self, times: Callable[[NDArray[np.int64]], NDArray[np.int64]]) -> Frames:
        """Return the same frames by another clock; equal times are moved apart by 1 us."""
        t, steps = times(self.t), np.arange(len(self))
        apart = np.maximum.accumulate(t - steps) + steps if len(t) else t
        return Frames(self.values, apart, unit=self.unit, array=self.array)

    def _on(self, array: Array) -> Frames:
        """Return the same frames on another description of their sensor, of as many taxels."""
        return Frames(self.values.reshape(-1, *array.shape), self.t, unit=self.unit, array=array)

    def _resampled(self, period_us: int) -> Frames:
        """Return the last frame at each multiple of a period after the first."""
        if not len(self):
            return self
        t = np.arange(self.t[0], self.t[-1] + 1, period_us, dtype=np.int64)
        at = np.searchsorted(self.t, t, side="right") - 1
        return Frames(self.values[at], t, unit=self.unit, array=self.array)

    @cached_property
    def missing(self) -> int:
        """The number of missing values (NaN)."""
        # The least value is NaN if any is, and takes no memory to find.
        if not self.values.size or not np.isnan(self.values.min()):
            return 0
        return int(np.count_nonzero(np.isnan(self.values)))

    def held(self) -> Frames:
        """Return the frames with each missing value (NaN) filled by the last one that the taxel read.

        A missing value means no change, as with a board that sends only changes. Before its first value a taxel reads
        that value; a taxel without any value reads 0. Encoders, trainings, readouts and tares of a `Recording` do this
        themselves, with a warning that counts the values. For `Frames`, call this method first.

        Returns
        -------
        Frames
            The same, if no value is missing.

        Examples
        --------
        >>> frames = Frames([[[np.nan, 1.0]], [[5.0, np.nan]], [[np.nan, 3.0]]], [0, 100, 200])
        >>> frames.missing, frames.held().values[:, 0].tolist()
        (3, [[5.0, 1.0], [5.0, 1.0], [5.0, 3.0]])
        """
        return self._held if self.missing else self

    @cached_property
    def _held(self) -> Frames:
        values = self.values.reshape(len(self), -1).copy()
        for taxel in np.flatnonzero(np.isnan(values).any(axis=0)):
            known = np.flatnonzero(~np.isnan(values[:, taxel]))
            # The place of the last known value up to each frame; before the first one that one's.
            last = np.searchsorted(known, np.arange(len(self)), side="right") - 1
            values[:, taxel] = values[known[np.maximum(last, 0)], taxel] if len(known) else 0
        return Frames(frozen(values.reshape(self.values.shape)), self.t, unit=self.unit, array=self.array)

    def area(self, above: float = 0.0) -> NDArray[np.float64]:
        """Return the contact area of each frame, mm2: that of each taxel that reads more than `above`.

        Parameters
        ----------
        above : float, in the frames' unit
            A taxel counts as loaded if its value is greater. If taxels at rest do not read 0, subtract their rest first
            (`Tare.off`).

        Returns
        -------
        float64, shape (n,), mm2

        Raises
        ------
        ProblemError : a level that is not a number, or taxels whose area is not known (`loaded` counts them)

        Examples
        --------
        >>> frames = Frames([[[0.0, 2.0, 6.0]]], [0], unit="N", array=Array(1, 3, pitch_mm=10.0))
        >>> frames.area(), frames.peak(), frames.total(), frames.centre()
        (array([200.]), array([6.]), array([8.]), array([[17.5,  0. ]]))
        """
        areas = self.array.area_mm2
        if areas is None:
            raise ProblemError(
                f"area needs mm2, but the area of a taxel of {self.array!r} is not known; loaded() counts taxels"
            )
        return np.asarray(np.where(self._loaded(above), areas, 0.0).sum(axis=(1, 2)))

    def loaded(self, above: float = 0.0) -> NDArray[np.int64]:
        """Return the number of taxels of each frame that read more than `above`.

        Parameters
        ----------
        above : float, in the frames' unit
            As of `area`.

        Returns
        -------
        int64, shape (n,)

        Raises
        ------
        ProblemError : a level that is not a number

        Examples
        --------
        >>> Frames([[[0.0, 2.0, 6.0]]], [0]).loaded()
        array([2])
        """
        return np.asarray(np.count_nonzero(self._loaded(above), axis=(1, 2)), np.int64)

    def peak(self) -> NDArray[np.float64]:
        """Return the largest value of each frame, in the frames' unit; shape (n,)."""
        return np.asarray(self.values.max(axis=(1, 2)), np.float64)

    def total(self) -> NDArray[np.float64]:
        """Return the sum over taxels of each frame, in the frames' unit; shape (n,)."""
        return np.asarray(self.values.sum(axis=(1, 2), dtype=np.float64))

    def centre(self, above: float = 0.0) -> NDArray[np.float64]:
        """Return the centre of pressure of each frame, in the array's `centre_unit`: mm if they are known.

        Parameters
        ----------
        above : float, in the frames' unit, 0 or more
            Only taxels with a greater value count, each weighted by its value.

        Returns
        -------
        float64, shape (n, 2), mm
            x to the right and y downwards from the middle of the taxel in the first column and row; NaN if no taxel
            counts. On a grid of unknown pitch it is in columns and rows ("taxels"); with places, in their unit and from
            their origin.

        Raises
        ------
        ProblemError : a level below 0, or channels, which have no centre

        Examples
        --------
        >>> Frames([[[0.0, 2.0], [0.0, 2.0]]], [0]).centre()
        array([[1. , 0.5]])
        """
        if finite("above", above) < 0:
            raise refused("above", f" is {shown(above)}: must be 0 or more, because values are weights")
        weights = np.where(self._loaded(above), self.values, 0.0)
        return _centre(weights, np.stack(self.array.positions()))

    def _above(self, rest: NDArray[np.float64]) -> Frames:
        """Return the frames above the rest of each taxel; an unknown rest is infinite."""
        above = _core.above_rest(np.ascontiguousarray(self.values).reshape(-1), np.ascontiguousarray(rest).reshape(-1))
        return Frames(above.reshape(self.values.shape), self.t, unit=self.unit, array=self.array)

    def _loaded(self, above: float) -> NDArray[np.bool_]:
        return np.asarray(self.values > np.float64(finite("above", above)))

    def to_pandas(self) -> pd.DataFrame:
        """Return a pandas.DataFrame: a row for each frame, by its time (``t_us``), and a column for each taxel.

        A column has the name of its taxel, or, without one, its column and row, as in a .csv.

        Examples
        --------
        >>> Frames([[[1.0, 2.0]], [[3.0, 4.0]]], [0, 1000]).to_pandas()
              x0y0  x1y0
        t_us
        0      1.0   2.0
        1000   3.0   4.0
        """
        import pandas as pd  # noqa: PLC0415  takes long

        array = self.array
        y, x = np.nonzero(np.ones(array.shape, np.bool_) if array.exists is None else array.exists)
        names = np.array(array.names or [""] * (array.rows * array.columns), object).reshape(array.shape)
        columns = [name or f"x{column}y{row}" for name, column, row in zip(names[y, x], x, y, strict=True)]
        return pd.DataFrame(self.values[:, y, x], pd.Index(self.t, name="t_us"), columns)

    def plot(self, at: int | None = None, ax: Axes | None = None) -> Axes:
        """Draw the pressure map at `at` us, or of the frame with the largest sum."""
        return draw("pressure_map", self, at, ax)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        time = f"{self.t[0]} to {self.t[-1]} us" if len(self) else "no time"
        size = f"{self.array.rows} x {self.array.columns} taxels"
        return escaped(f"Frames({counted(len(self), 'frame')} of {size}, {time}, {self.unit})")


def _centre(weights: NDArray[np.floating], positions: Values) -> Values:
    """Return the centre of the weights of each frame, shape (n, 2); NaN without any."""
    total = weights.sum(axis=(1, 2), dtype=np.float64)[:, None]
    moments = np.einsum("nij,kij->nk", weights, positions, dtype=np.float64)
    return np.asarray(np.divide(moments, total, out=np.full(moments.shape, np.nan), where=total > 0))


def _refuse_infinite(name: str, values: NDArray[np.float32]) -> None:
    """Refuse readings that are infinite; NaN is a missing one."""
    if np.isinf(values).any():
        position = ", ".join(map(str, np.argwhere(np.isinf(values))[0].tolist()))
        raise refused(name, f"[{position}] is infinite: must be finite, or NaN where it is missing")
