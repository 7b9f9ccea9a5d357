"""Detection of dead, stuck and noisy taxels in a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.drawing import draw
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded
from taxel.recorded import recorded as held_by

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Health", "TaxelStatistics", "health", "judged"]

#: Reading: a taxel is dead if it had no event while the median of its neighbours had at least this number of events,
#: and at least this number in the direction of their event before. A touch causes such events; noise at the noise floor
#: alternates ...
DEAD_BELOW, MOVED_FROM = 10, 3
#: ... or if it is known to hold 0 while the least value of its neighbours (median) was at least this number of ticks
#: and this share of the largest value of the array ...
REST_FROM, REST_SHARE = 10, 0.2
#: ... or if most of the array is so noisy that hardly any taxel had few events: among taxels with active neighbours, at
#: most this share of the number of silent ones ...
QUIET_SHARE = 0.1
#: ... It is stuck if it had at least this number of events, all with one value ...
STUCK_FROM = 3
#: ... It is noisy if it had this many times the events of four in five of the 24 taxels around it, and at least this
#: number.
NOISY_TIMES, NOISY_FROM, NOISY_SHARE = 8.0, 20, 0.8

#: Number of taxels whose neighbours are computed at once.
_AT_ONCE = 1 << 17


@dataclass(frozen=True, eq=False, repr=False)
class Health:
    """Hold which taxels are dead, stuck or noisy.

    Parameters
    ----------
    array : Array
    activity : int64, shape (rows, columns)
        Number of events (or changes of the picture) at each taxel.
    dead, stuck, noisy : bool, shape (rows, columns)
    """

    array: Array
    activity: NDArray[np.int64]
    dead: NDArray[np.bool_]
    stuck: NDArray[np.bool_]
    noisy: NDArray[np.bool_]

    def named(self) -> dict[str, list[tuple[int, int]]]:
        """Return column and row (x, y) of the taxels that are dead, stuck and noisy."""
        masks = {"dead": self.dead, "stuck": self.stuck, "noisy": self.noisy}
        return {name: [(int(x), int(y)) for y, x in np.argwhere(mask)] for name, mask in masks.items()}

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the activity of each taxel, with those marked that are dead, stuck or noisy."""
        return draw("health_map", self, ax)  # type: ignore[no-any-return]

    def _repr_html_(self) -> str:
        return draw("html", self)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(places)} {name}" for name, places in self.named().items())
        return f"Health({self.array.taxels} taxels: {counts})"


def health(recorded: Events | Frames | Recorded) -> Health:
    """Return which taxels are dead, stuck or noisy, each compared with its neighbours.

    A recording cannot show whether taxels work in a region that was never touched: a taxel counts as dead only if most
    of its neighbours had events, or if it is known to hold 0 and they never do. States of wire version 2
    (`Events.repaired`) and the values held at the beginning count as held values, but not as events of the taxel.

    Parameters
    ----------
    recorded : Events, Frames or Recording
        In pictures each change of a value counts as an event.

    Returns
    -------
    Health

    Raises
    ------
    ProblemError : none of these

    Notes
    -----
    *Reading* (the thesis defines none). Dead: no event, while the median of its up to 8 neighbours has 10 events or
    more, of which 3 or more have the polarity of the same taxel's event before; or no event and known to hold 0, while
    the median of the least values of its neighbours is 10 ticks or more and a fifth of the array's largest value. Noise
    at the noise floor causes events of alternating polarity, so that a working taxel may have none for long while
    others do; it shows a dead taxel only if it is so strong that, over half of the array or more, the taxels with 1 to
    9 events are at most a tenth as many as the silent ones. Stuck: 3 events or more, all with one intensity, while its
    neighbours show more than one; or silent like a dead one, but known to hold a value other than 0. Noisy: 20 events
    or more, and 8 times as many as four in five of the up to 24 taxels around it.

    Examples
    --------
    >>> t = np.repeat(np.arange(0, 20_000, 1000), 9)
    >>> x, y = np.tile(np.tile(np.arange(3), 3), 20), np.tile(np.repeat(np.arange(3), 3), 20)
    >>> but_one = (x != 1) | (y != 1)
    >>> events = Events(t[but_one], x[but_one], y[but_one], t[but_one] % 4000 > 1000, array=Array(3, 3))
    >>> health(events)
    Health(9 taxels: 1 dead, 0 stuck, 0 noisy)
    """
    held = held_by(recorded)
    if isinstance(held, Events):
        return judged(held.array, _statistics_of_events(held))
    if not isinstance(held, Frames):
        raise ProblemError(f"recorded is {shown(recorded)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
    flat = held.values.reshape(len(held), held.array.rows * held.array.columns)
    # A NaN has no direction of change.
    ways = (flat[1:] > flat[:-1]).astype(np.int8) - (flat[1:] < flat[:-1])
    turn, taxel = np.nonzero(ways)
    activity, moved = _ways(taxel, ways[turn, taxel], held.array)
    # In pictures a taxel that never changes is dead or stuck, depending on its value.
    result = judged(held.array, TaxelStatistics(activity, moved, activity + 1))
    if not len(held):
        return result
    loaded = held.values[0] > held.values.min()
    return Health(held.array, activity, result.dead & ~loaded, result.dead & loaded, result.noisy)


class TaxelStatistics(NamedTuple):
    """Statistics of each taxel's events and held values; whole numbers, shape (rows, columns)."""

    activity: NDArray[np.int64]
    """Number of events."""
    moved: NDArray[np.int64]
    """Number of events with the polarity of the taxel's event before."""
    values: NDArray[np.signedinteger] | None = None
    """Number of different intensities of its events: 0, 1, or 2 for more; None if events have none."""
    least: NDArray[np.signedinteger] | None = None
    """The least value that it is known to have held, ticks; -1 for a taxel without any event."""
    greatest: NDArray[np.signedinteger] | None = None
    """The greatest value that it is known to have held, ticks; -1 for a taxel without any event."""


def judged(array: Array, statistics: TaxelStatistics) -> Health:
    """Return the health of taxels with these statistics, by the rules of `health`."""
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    activity = statistics.activity
    silent = exists & (activity == 0)
    # A median reaches a bound only if a neighbour reaches it, so all other taxels are skipped.
    among = _reaches(activity, exists, _beside(exists & (activity >= DEAD_BELOW)) & exists, DEAD_BELOW)
    moved = _reaches(statistics.moved, exists, silent & among, MOVED_FROM)
    quiet = np.count_nonzero(among & (activity > 0) & (activity < DEAD_BELOW))
    alone = quiet <= QUIET_SHARE * np.count_nonzero(among & silent)
    loud = alone and 2 * np.count_nonzero(among) > np.count_nonzero(exists)
    dead = silent & among & (moved | loud)
    stuck = np.zeros(array.shape, bool)
    if statistics.least is not None and statistics.greatest is not None:
        least = max(REST_FROM, REST_SHARE * int(statistics.greatest.max(initial=0)))
        known = exists & (statistics.least >= 0)
        at_zero = silent & (statistics.greatest == 0) & _beside(known & (statistics.least >= least))
        dead |= _reaches(statistics.least, known, at_zero, least)
        stuck = dead & (statistics.greatest > 0)
    if statistics.values is not None:
        still = exists & (activity >= STUCK_FROM) & (statistics.values == 1)
        stuck |= _reaches(statistics.values, exists & (activity > 0), still, 1, above=True)
    noisy = exists & (activity >= NOISY_FROM)
    places = np.flatnonzero(noisy)
    often = NOISY_TIMES * _around(activity, exists, places, 2, NOISY_SHARE)
    noisy.reshape(-1)[places] = activity.reshape(-1)[places] > often
    return Health(array, activity, dead & ~stuck, stuck, noisy)


def _statistics_of_events(events: Events) -> TaxelStatistics:
    """Return the statistics of each taxel; an event that a state repaired counts for the held value only."""
    own = np.ones(len(events), bool) if events.repaired is None else ~events.repaired
    index = events.array.index(events.x, events.y).astype(np.int64)
    activity, moved = _ways(index[own], np.where(events.p[own], 1, -1), events.array)
    if events.intensity is None or events.present is None:
        return TaxelStatistics(activity, moved)
    shape, size = events.array.shape, events.array.rows * events.array.columns
    pairs = np.unique(index[events.present & own] * 65_536 + events.intensity[events.present & own].astype(np.int64))
    values = np.bincount(pairs // 65_536, minlength=size).astype(np.int32)
    ticks = events.intensity[events.present].astype(np.int32)
    least, greatest = np.full(size, 65_536, np.int32), np.full(size, -1, np.int32)
    np.minimum.at(least, index[events.present], ticks)
    np.maximum.at(greatest, index[events.present], ticks)
    least[greatest < 0] = -1
    return TaxelStatistics(activity, moved, values.reshape(shape), least.reshape(shape), greatest.reshape(shape))


def _ways(index: NDArray[np.int64], way: NDArray[Any], array: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how many changes each taxel has, and how many of them have the direction of the one before."""
    order = np.argsort(index, kind="stable")
    taxel, way = index[order], way[order]
    on = taxel[1:][(taxel[1:] == taxel[:-1]) & (way[1:] == way[:-1])]
    size = array.rows * array.columns
    counts = (np.bincount(of, minlength=size).reshape(array.shape) for of in (taxel, on))
    activity, moved = counts
    return activity, moved


def _beside(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which taxels have a taxel of a mask among their up to 8 neighbours."""
    rows, columns = mask.shape
    padded = np.pad(mask, 1)
    reached = np.zeros(mask.shape, bool)
    for i, j in _offsets(1):
        reached |= padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
    return reached


def _reaches(
    grid: NDArray[Any], counts: NDArray[np.bool_], where: NDArray[np.bool_], bound: float, *, above: bool = False
) -> NDArray[np.bool_]:
    """Return for which taxels the median of the neighbours that count is at least a bound, or above it."""
    reached = np.zeros(grid.shape, bool)
    places = np.flatnonzero(where)
    medians = _around(grid, counts, places)
    reached.reshape(-1)[places] = medians > bound if above else medians >= bound
    return reached


def _around(
    grid: NDArray[Any], counts: NDArray[np.bool_], places: NDArray[np.int64], reach: int = 1, share: float = 0.5
) -> NDArray[np.float64]:
    """Return a quantile (the median) of the neighbours that count, for taxels by index; 0 if none counts.

    numpy.nanquantile does the same for one taxel at a time and is a hundred times slower.
    """
    rows, columns = grid.shape
    quantiles = np.empty(len(places))
    for first in range(0, len(places), _AT_ONCE):
        y, x = np.divmod(places[first : first + _AT_ONCE], columns)
        stack = np.full((len(_offsets(reach)), len(y)), np.nan)
        for row, (i, j) in zip(stack, _offsets(reach), strict=True):
            inside = (y + i >= 0) & (y + i < rows) & (x + j >= 0) & (x + j < columns)
            at = (np.where(inside, y + i, 0), np.where(inside, x + j, 0))
            use = inside & counts[at]
            row[use] = grid[at][use]
        # Neighbours that do not count are NaN, which is sorted last.
        stack.sort(axis=0)
        last = np.count_nonzero(~np.isnan(stack), axis=0) - 1
        place = share * np.maximum(last, 0)
        below = np.floor(place).astype(np.intp)
        over = np.minimum(below + 1, np.maximum(last, 0))
        low, high = (np.take_along_axis(stack, at[np.newaxis], axis=0)[0] for at in (below, over))
        quantiles[first : first + _AT_ONCE] = np.where(last < 0, 0.0, low + (place - below) * (high - low))
    return quantiles


def _offsets(reach: int) -> list[tuple[int, int]]:
    """Return the row and column offsets of all neighbours within a distance."""
    steps = range(-reach, reach + 1)
    return [(i, j) for i in steps for j in steps if (i, j) != (0, 0)]
