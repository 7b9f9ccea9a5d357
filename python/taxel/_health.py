"""Which taxels are dead, stuck or noisy, as far as a recording can show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel._arguments import shown
from taxel._core import ProblemError
from taxel._recorded import Recorded
from taxel._recorded import recorded as held_by
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Health", "health", "judged"]

#: Reading: a taxel is called dead where it was silent while its neighbours spoke so often (median of them) ...
DEAD_BELOW = 10
#: ... stuck where it spoke so often at least and showed one value only ...
STUCK_FROM = 3
#: ... noisy where it spoke so many times as often as its neighbours (median), and so often at least.
NOISY_TIMES, NOISY_FROM = 8.0, 20


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
    """Tell which taxels are dead, stuck or noisy, each against its up to 8 neighbours.

    A recording in which a place was never touched cannot show whether its taxels live: a taxel counts as dead only
    where most of its neighbours spoke. What a state of wire version 2 told (`Events.repaired`) is the board's word, not
    the taxel's, and does not count.

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
    *Reading* (the thesis defines none): dead, silent while the median of its neighbours has 10 events or more; stuck,
    3 events or more with one and the same intensity in all, while its neighbours show more than one; noisy, 20 events
    or more and 8 times the median of its neighbours.

    Examples
    --------
    >>> t = np.repeat(np.arange(0, 20_000, 1000), 9)
    >>> x, y = np.tile(np.tile(np.arange(3), 3), 20), np.tile(np.repeat(np.arange(3), 3), 20)
    >>> but_one = (x != 1) | (y != 1)
    >>> events = Events(t[but_one], x[but_one], y[but_one], t[but_one] % 2000 > 0, array=Array(3, 3))
    >>> health(events)
    Health(9 taxels: 1 dead, 0 stuck, 0 noisy)
    """
    held = held_by(recorded)
    if isinstance(held, Events):
        own = np.ones(len(held), bool) if held.repaired is None else ~held.repaired
        activity = np.zeros(held.array.shape, np.int64)
        np.add.at(activity, (held.y[own], held.x[own]), 1)
        values = _values_of_events(held, own)
    elif isinstance(held, Frames):
        changes = held.values[1:] != held.values[:-1]
        activity = changes.sum(axis=0, dtype=np.int64).reshape(held.array.shape)
        # A taxel of pictures that never changes is dead or stuck: its value tells which.
        values = activity + 1
    else:
        raise ProblemError(f"recorded is {shown(recorded)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
    found = judged(held.array, activity, values)
    if isinstance(held, Frames) and len(held):
        loaded = held.values[0] > held.values.reshape(len(held), -1).min()
        return Health(held.array, activity, found.dead & ~loaded, found.dead & loaded, found.noisy)
    return found


def judged(array: Array, activity: NDArray[np.int64], values: NDArray[np.int64] | None) -> Health:
    """Tell it from what each taxel did, by the rules of `health`.

    Parameters
    ----------
    array : Array
    activity : int64, shape (rows, columns)
        Events at each taxel.
    values : int64, shape (rows, columns), optional
        How many different intensities each taxel showed: 0, 1, or 2 and more.

    Returns
    -------
    Health
    """
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    around = _median_around(np.where(exists, activity, np.nan))
    dead = exists & (activity == 0) & (around >= DEAD_BELOW)
    stuck = np.zeros(array.shape, bool)
    if values is not None:
        varied = _median_around(np.where(exists & (activity > 0), values, np.nan)) > 1
        stuck = exists & (activity >= STUCK_FROM) & (values == 1) & varied
    noisy = exists & (activity >= NOISY_FROM) & (activity > NOISY_TIMES * np.fmax(around, 0))
    return Health(array, activity, dead, stuck, noisy)


def _values_of_events(events: Events, own: NDArray[np.bool_]) -> NDArray[np.int64] | None:
    """Return how many different intensities each taxel showed in its own events."""
    if events.intensity is None or events.present is None:
        return None
    there = events.present & own
    index = events.array.index(events.x[there], events.y[there])
    pairs = np.unique(index * 65_536 + events.intensity[there].astype(np.int64))
    size = events.array.rows * events.array.columns
    return np.bincount(pairs // 65_536, minlength=size).reshape(events.array.shape)


def _median_around(grid: NDArray[Any]) -> NDArray[np.float64]:
    """Return the median of the up to 8 neighbours of each taxel; NaN (an empty place) does not count."""
    padded = np.pad(np.asarray(grid, np.float64), 1, constant_values=np.nan)
    rows, columns = grid.shape
    near = [padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3) if (i, j) != (1, 1)]
    stack = np.stack(near)
    alone = np.isnan(stack).all(axis=0)
    stack[:, alone] = 0.0
    return np.asarray(np.nanmedian(stack, axis=0))
