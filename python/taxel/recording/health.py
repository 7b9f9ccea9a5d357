"""Which taxels are dead, stuck or noisy, as far as a recording can show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded
from taxel.recorded import recorded as held_by

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Health", "Told", "health", "judged"]

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
        from taxel.plot import health_map  # noqa: PLC0415  matplotlib loads slowly

        return health_map(self, ax)

    def _repr_html_(self) -> str:
        from taxel.plot import html  # noqa: PLC0415  matplotlib loads slowly

        return html(self)

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(found)} {name}" for name, found in self.named().items())
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
        return judged(held.array, _told_of_events(held))
    if not isinstance(held, Frames):
        raise ProblemError(f"recorded is {shown(recorded)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
    flat = held.values.reshape(len(held), held.array.rows * held.array.columns)
    # What is no number goes no way.
    ways = (flat[1:] > flat[:-1]).astype(np.int8) - (flat[1:] < flat[:-1])
    turn, taxel = np.nonzero(ways)
    activity, moved = _ways(taxel, ways[turn, taxel], held.array)
    # A taxel of pictures that never changes is dead or stuck: its value tells which.
    found = judged(held.array, Told(activity, moved, activity + 1))
    if not len(held):
        return found
    loaded = held.values[0] > held.values.min()
    return Health(held.array, activity, found.dead & ~loaded, found.dead & loaded, found.noisy)


class Told(NamedTuple):
    """What each taxel did, and what is known to be held; int64, shape (rows, columns)."""

    activity: NDArray[np.int64]
    """Events."""
    moved: NDArray[np.int64]
    """Events that go the way of the taxel's event before."""
    values: NDArray[np.int64] | None = None
    """How many different intensities its events showed: 0, 1, or 2 and more; None where events have none."""
    least: NDArray[np.int64] | None = None
    """The least that it is known to have held, ticks; -1 where it was not heard of."""
    greatest: NDArray[np.int64] | None = None
    """The greatest, likewise."""


def judged(array: Array, told: Told) -> Health:
    """Tell it from what each taxel did, by the rules of `health`."""
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    activity = told.activity
    silent = exists & (activity == 0)
    among = exists & (_around(np.where(exists, activity, np.nan)) >= DEAD_BELOW)
    moved = _around(np.where(exists, told.moved, np.nan)) >= MOVED_FROM
    quiet = np.count_nonzero(among & (activity > 0) & (activity < DEAD_BELOW))
    alone = quiet <= QUIET_SHARE * np.count_nonzero(among & silent)
    loud = alone and 2 * np.count_nonzero(among) > np.count_nonzero(exists)
    stuck, known = np.zeros(array.shape, bool), np.full(array.shape, -1)
    dead = silent & among & (moved | loud)
    if told.least is not None and told.greatest is not None:
        known = told.greatest
        at_rest = _around(np.where(exists & (told.least >= 0), told.least, np.nan))
        dead |= silent & (known == 0) & (at_rest >= max(REST_FROM, REST_SHARE * known.max(initial=0)))
    if told.values is not None:
        varied = _around(np.where(exists & (activity > 0), told.values, np.nan)) > 1
        stuck = exists & (activity >= STUCK_FROM) & (told.values == 1) & varied
    stuck |= dead & (known > 0)
    beside = _around(np.where(exists, activity, np.nan), 2, NOISY_SHARE)
    noisy = exists & (activity >= NOISY_FROM) & (activity > NOISY_TIMES * beside)
    return Health(array, activity, dead & ~stuck, stuck, noisy)


def _told_of_events(events: Events) -> Told:
    """Return what events say of each taxel; those that a state told say only what it holds."""
    own = np.ones(len(events), bool) if events.repaired is None else ~events.repaired
    index = events.array.index(events.x, events.y).astype(np.int64)
    activity, moved = _ways(index[own], np.where(events.p[own], 1, -1), events.array)
    if events.intensity is None or events.present is None:
        return Told(activity, moved)
    shape, size = events.array.shape, events.array.rows * events.array.columns
    pairs = np.unique(index[events.present & own] * 65_536 + events.intensity[events.present & own].astype(np.int64))
    values = np.bincount(pairs // 65_536, minlength=size).reshape(shape)
    ticks = events.intensity[events.present].astype(np.int64)
    least, greatest = np.full(size, 65_536), np.full(size, -1)
    np.minimum.at(least, index[events.present], ticks)
    np.maximum.at(greatest, index[events.present], ticks)
    least[greatest < 0] = -1
    return Told(activity, moved, values, least.reshape(shape), greatest.reshape(shape))


def _ways(index: NDArray[np.int64], way: NDArray[Any], array: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how many changes each taxel has, and how many of them go the way of the one before."""
    order = np.argsort(index, kind="stable")
    taxel, way = index[order], way[order]
    on = taxel[1:][(taxel[1:] == taxel[:-1]) & (way[1:] == way[:-1])]
    size = array.rows * array.columns
    counts = (np.bincount(of, minlength=size).reshape(array.shape) for of in (taxel, on))
    activity, moved = counts
    return activity, moved


def _around(grid: NDArray[Any], reach: int = 1, share: float = 0.5) -> NDArray[np.float64]:
    """Return a quantile (the median) of the neighbours of each taxel so far away; NaN (an empty place) does not count.

    0 where there are none.
    """
    padded = np.pad(np.asarray(grid, np.float64), reach, constant_values=np.nan)
    rows, columns = grid.shape
    places = [(i, j) for i in range(2 * reach + 1) for j in range(2 * reach + 1) if (i, j) != (reach, reach)]
    # Sorted, what does not count is last. numpy.nanquantile does the same a hundred times slower, a taxel at a time.
    stack = np.sort(np.stack([padded[i : i + rows, j : j + columns] for i, j in places]), axis=0)
    last = np.count_nonzero(~np.isnan(stack), axis=0) - 1
    place = share * np.maximum(last, 0)
    below = np.floor(place).astype(np.intp)
    above = np.minimum(below + 1, np.maximum(last, 0))
    low, high = (np.take_along_axis(stack, at[np.newaxis], axis=0)[0] for at in (below, above))
    return np.where(last < 0, 0.0, low + (place - below) * (high - low))
