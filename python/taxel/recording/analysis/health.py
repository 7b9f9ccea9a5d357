"""Detection of dead, stuck and noisy taxels in a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.drawing import draw
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded
from taxel.recorded import recorded as held_by
from taxel.recording.analysis.rest import FORCE_UNITS, NOISE_FLOOR, extremes, ticks_by_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Reading: a taxel is dead, or stuck, if its place was touched at least this number of times (`_core`, *touch counts*)
#: and it never changed meanwhile, if it has this number of neighbours: beyond the edge of an insole nothing presses ...
TOUCHED_FROM, NEIGHBOURS_FROM = 3, 5
#: ... It is noisy if it changed by itself in at least this number of bins of 50 ms, which are at least this share of
#: those in which it changed, and at most this share of its changes continued in the direction of the change before: a
#: touch continues, noise turns back.
NOISY_FROM, NOISY_SHARE, NOISY_ON = 10, 0.5, 0.45
#: A taxel that was not touched enough works if it had at least this number of events, or was once pressed itself.
WORKS_FROM = 10

#: Rows of five counts of touches of each taxel, as the core gives them.
TouchCounts = NDArray[np.uint32]


@dataclass(frozen=True, eq=False, repr=False)
class Health:
    """Which taxels are dead, stuck or noisy.

    Parameters
    ----------
    array : Array
    activity : int64, shape (rows, columns)
        Number of events (or changes of the frame) at each taxel.
    dead, stuck, noisy : bool, shape (rows, columns)
    untested : bool, shape (rows, columns)
        Taxels that were not touched enough to say whether they work.

    Examples
    --------
    >>> from taxel.frames import Frames
    >>> health(Frames([[[0.0, 5.0]], [[0.0, 7.0]], [[0.0, 5.0]]], [0, 10_000, 20_000]))
    Health(2 taxels: 0 dead, 0 stuck, 0 noisy, 2 not touched enough to say whether they work)
    """

    array: Array
    activity: NDArray[np.int64]
    dead: NDArray[np.bool_]
    stuck: NDArray[np.bool_]
    noisy: NDArray[np.bool_]
    untested: NDArray[np.bool_]

    def named(self) -> dict[str, list[tuple[int, int]]]:
        """Return column and row (x, y) of the taxels that are dead, stuck and noisy."""
        masks = {"dead": self.dead, "stuck": self.stuck, "noisy": self.noisy}
        return {name: [(int(x), int(y)) for y, x in np.argwhere(mask)] for name, mask in masks.items()}

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the activity of each taxel, with those marked that are dead, stuck or noisy."""
        return draw("health_map", self, ax)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(places)} {name}" for name, places in self.named().items())
        untested = int(np.count_nonzero(self.untested))
        return (
            f"Health({counted(self.array.taxels, 'taxel')}: {counts}"
            + f", {untested} not touched enough to say whether they work" * bool(untested)
            + ")"
        )


def health(recorded: Events | Frames | Recorded) -> Health:
    """Return which taxels are dead, stuck or noisy, each compared with its neighbours.

    A recording cannot show whether taxels work in a region that was never touched: a taxel is named dead or stuck only
    if its neighbours were touched three times or more. A taxel that was touched less and did nothing is *untested*.
    States of wire version 2 (`Events.repaired`) and the values held at the beginning count as held values, but not as
    changes of the taxel. Without neighbours, as in one channel, no taxel is named.

    Parameters
    ----------
    recorded : Events, Frames or Recording
        In frames each change of a value counts as an event.

    Returns
    -------
    Health

    Raises
    ------
    ProblemError : another object

    Notes
    -----
    *Reading* (the thesis defines none). A place is touched while three in four of its up to 8 neighbours are 8 ticks
    above their rest, until all but one in four are back; in frames, whatever their unit, 150 ticks are the range of the
    values. Dead: three touches or more and no change in any of them, with 5 neighbours or more, and no value above the
    least of the array, of frames by more than 3 ticks, is known. Stuck: the same, at another value. Noisy: in 10 bins
    of 50 ms or more, half of all in which it changes, it has 3 changes or more, and more than 8 times those of all but
    one of the 24 taxels around it; and at most 45 % of its changes go on in the direction of the one before. Frames of
    less than 60 Hz show no noise.

    Examples
    --------
    >>> touch = np.array([0, 40, 80, 40, 0])[:, None, None] * np.ones((3, 3))
    >>> values = np.concatenate([touch] * 3) + 50
    >>> values[:, 1, 1] = 0
    >>> health(Frames(values, np.arange(15) * 100_000, unit="ticks"))
    Health(9 taxels: 1 dead, 0 stuck, 0 noisy)
    """
    # A missing value is no reading that could show what a taxel does.
    table = held_by(recorded, hold=False)
    if isinstance(table, Events):
        return _of_events(table)
    if not isinstance(table, Frames):
        raise refused("recorded", f" is {shown(recorded)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
    activity, moved = (grid.astype(np.int64).reshape(table.array.shape) for grid in _core.changes_of_frames(table))
    # The values of frames count from the least one.
    (lowest, most), scale = extremes(table), ticks_by_unit(table)
    least, ticks = np.fmin.reduce(lowest, axis=None, initial=np.inf), table
    # Values at both ends of single precision are infinitely far apart.
    with np.errstate(over="ignore"):
        if np.isfinite(least):
            values = table.values - least
            ticks = Frames(frozen(np.multiply(values, scale, out=values)), table.t, array=table.array)
        above = np.multiply(most - least, scale) > NOISE_FLOOR
    touches = _core.touches_of_frames(ticks, 0.0 if table.unit in FORCE_UNITS else np.nan)
    return judge(table.array, activity, moved, touches, above)


def _of_events(events: Events) -> Health:
    """Judge by events; one that a state repaired counts for the held value only."""
    array = events.array
    index, size = array.index(events.x, events.y).astype(np.int64), array.rows * array.columns
    sent = np.ones(len(events), bool) if events.repaired is None else ~events.repaired
    order = np.argsort(index[sent], kind="stable")
    taxel, rises = index[sent][order], events.p[sent][order]
    again = taxel[1:][(taxel[1:] == taxel[:-1]) & (rises[1:] == rises[:-1])]
    activity, moved = (np.bincount(taxels, minlength=size).reshape(array.shape) for taxels in (taxel, again))
    above = np.zeros(size, bool)
    if events.intensity is not None and events.present is not None:
        above[index[events.present & (events.intensity > 0)]] = True
    touches = _core.touches_of_events(events.sorted())
    return judge(array, activity, moved, touches, above.reshape(array.shape))


def judge(
    array: Array, activity: NDArray[np.int64], moved: NDArray[np.int64], touches: TouchCounts, above: NDArray[np.bool_]
) -> Health:
    """Return the health of taxels by the rules of `health`.

    Parameters
    ----------
    array : Array
    activity, moved : int64, shape (rows, columns)
        Number of events of each taxel, and of those in the direction of the one before.
    touches : uint32
        As the core counts them, five numbers per taxel.
    above : bool, shape (rows, columns)
        Whether the taxel is known to have read more than the least value.
    """
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    touched, missed, pressed, changed, by_itself = touches.reshape(-1, 5).T.reshape(5, *array.shape)
    enough = exists & (touched >= TOUCHED_FROM) & (_neighbours(exists) >= NEIGHBOURS_FROM)
    still = enough & (missed == touched)
    noisy = exists & (by_itself >= NOISY_FROM) & (by_itself >= NOISY_SHARE * changed) & (moved <= NOISY_ON * activity)
    # A channel has no neighbours that would show what it should do.
    noisy &= (min(array.shape) > 1) & ~still
    untested = exists & ~noisy & ~enough & (pressed == 0) & (activity < WORKS_FROM)
    return Health(array, activity, still & ~above, still & above, noisy, untested)


def _neighbours(mask: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Return how many of the up to 8 neighbours of each taxel a mask has."""
    from scipy.ndimage import convolve  # noqa: PLC0415  loads slowly

    found: NDArray[np.int8] = convolve(mask.astype(np.int8), np.ones((3, 3), np.int8), mode="constant")
    return found - mask
