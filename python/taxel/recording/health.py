"""Which taxels are dead, stuck or noisy, as far as a recording can show it."""

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

#: Reading: a taxel is called dead where it was silent while its neighbours spoke so often (median of them), and went on
#: the way that they went before so often: a touch does that, but noise at a floor goes up and down in turn ...
DEAD_BELOW, MOVED_FROM = 10, 3
#: ... or where it is known to hold 0 while its neighbours (median) never held less than so many ticks, and than such a
#: share of the largest value of the array ...
REST_FROM, REST_SHARE = 10, 0.2
#: ... or where most of the array is so loud that hardly a taxel spoke less: of those among speaking neighbours, as many
#: as such a share of the silent ones ...
QUIET_SHARE = 0.1
#: ... stuck where it spoke so often at least and showed one value only ...
STUCK_FROM = 3
#: ... noisy where it spoke so many times as often as four in five of the 24 taxels around it, and so often at least.
NOISY_TIMES, NOISY_FROM, NOISY_SHARE = 8.0, 20, 0.8

#: Taxels whose neighbours are looked at at once.
_AT_ONCE = 1 << 17


@dataclass(frozen=True, eq=False, repr=False)
class Health:
    """Hold which taxels are dead, stuck or noisy.

    Parameters
    ----------
    array : Array
    activity : int64, shape (rows, columns)
        Events (or changes of the picture) at each taxel.
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
    """Tell which taxels are dead, stuck or noisy, each against its neighbours.

    A recording in which a place was never touched cannot show whether its taxels live: a taxel counts as dead only
    where most of its neighbours were moved, or where it is known to hold 0 and they never do. What a state of wire
    version 2 told (`Events.repaired`), and what was held as a recording began, says what a taxel holds; it is the
    board's word, so it does not count as the taxel's own.

    Parameters
    ----------
    recorded : Events, Frames or Recording
        Of pictures each change of a value counts as an event.

    Returns
    -------
    Health

    Raises
    ------
    ProblemError : none of these

    Notes
    -----
    *Reading* (the thesis defines none): dead, silent while the median of its up to 8 neighbours has 10 events or more,
    of which 3 or more go the way that the taxel's last one went; or silent and known to hold 0, while the median of
    what its neighbours held at least is 10 ticks or more and a fifth of the array's largest value. Noise at a noise
    floor makes events that go up and down in turn, so that a live taxel may be silent for long where others speak; it
    tells of a death only where it is so loud that, over half of the array or more, at most a tenth as many spoke 1 to 9
    times as were silent.
    Stuck, 3 events or more with one and the same intensity in all, while its neighbours show more than one; or silent
    as a dead one, but known to hold something. Noisy, 20 events or more and 8 times what four in five of the up to 24
    taxels around it have.

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
    # What is no number goes no way.
    ways = (flat[1:] > flat[:-1]).astype(np.int8) - (flat[1:] < flat[:-1])
    turn, taxel = np.nonzero(ways)
    activity, moved = _ways(taxel, ways[turn, taxel], held.array)
    # A taxel of pictures that never changes is dead or stuck: its value tells which.
    result = judged(held.array, TaxelStatistics(activity, moved, activity + 1))
    if not len(held):
        return result
    loaded = held.values[0] > held.values.min()
    return Health(held.array, activity, result.dead & ~loaded, result.dead & loaded, result.noisy)


class TaxelStatistics(NamedTuple):
    """What each taxel did, and what is known to be held; whole numbers, shape (rows, columns)."""

    activity: NDArray[np.int64]
    """Events."""
    moved: NDArray[np.int64]
    """Events that go the way of the taxel's event before."""
    values: NDArray[np.signedinteger] | None = None
    """How many different intensities its events showed: 0, 1, or 2 and more; None where events have none."""
    least: NDArray[np.signedinteger] | None = None
    """The least value that it is known to have held, ticks; -1 of a taxel without any event."""
    greatest: NDArray[np.signedinteger] | None = None
    """The greatest, likewise."""


def judged(array: Array, statistics: TaxelStatistics) -> Health:
    """Tell it from what each taxel did, by the rules of `health`."""
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    activity = statistics.activity
    silent = exists & (activity == 0)
    # A median reaches a bound only beside a taxel that does: all others need not be looked at.
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
    """Return how many changes each taxel has, and how many of them go the way of the one before."""
    order = np.argsort(index, kind="stable")
    taxel, way = index[order], way[order]
    on = taxel[1:][(taxel[1:] == taxel[:-1]) & (way[1:] == way[:-1])]
    size = array.rows * array.columns
    counts = (np.bincount(of, minlength=size).reshape(array.shape) for of in (taxel, on))
    activity, moved = counts
    return activity, moved


def _beside(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which taxels have one of a mask among their up to 8 neighbours."""
    rows, columns = mask.shape
    padded = np.pad(mask, 1)
    reached = np.zeros(mask.shape, bool)
    for i, j in _offsets(1):
        reached |= padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
    return reached


def _reaches(
    grid: NDArray[Any], counts: NDArray[np.bool_], where: NDArray[np.bool_], bound: float, *, above: bool = False
) -> NDArray[np.bool_]:
    """Tell at which of some taxels the median of the neighbours that count is at least a bound, or above it."""
    reached = np.zeros(grid.shape, bool)
    places = np.flatnonzero(where)
    medians = _around(grid, counts, places)
    reached.reshape(-1)[places] = medians > bound if above else medians >= bound
    return reached


def _around(
    grid: NDArray[Any], counts: NDArray[np.bool_], places: NDArray[np.int64], reach: int = 1, share: float = 0.5
) -> NDArray[np.float64]:
    """Return a quantile (the median) of the neighbours that count, for taxels by index; 0 where none counts.

    numpy.nanquantile does the same a hundred times slower, a taxel at a time.
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
        # Sorted, what does not count is last.
        stack.sort(axis=0)
        last = np.count_nonzero(~np.isnan(stack), axis=0) - 1
        place = share * np.maximum(last, 0)
        below = np.floor(place).astype(np.intp)
        over = np.minimum(below + 1, np.maximum(last, 0))
        low, high = (np.take_along_axis(stack, at[np.newaxis], axis=0)[0] for at in (below, over))
        quantiles[first : first + _AT_ONCE] = np.where(last < 0, 0.0, low + (place - below) * (high - low))
    return quantiles


def _offsets(reach: int) -> list[tuple[int, int]]:
    """Return how far rows and columns of the neighbours so far away lie off."""
    steps = range(-reach, reach + 1)
    return [(i, j) for i in steps for j in steps if (i, j) != (0, 0)]
