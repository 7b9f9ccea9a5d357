"""Detection of dead, stuck and noisy taxels in a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import shown
from taxel._base.columns import frozen
from taxel._base.drawing import draw
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._base.times import beginning_us
from taxel.array import Array
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import Recorded
from taxel.recorded import recorded as held_by
from taxel.recording.analysis.rest import FORCE_UNITS, flickering, ticks_by_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Reading: a taxel is dead, or stuck, if its place was touched at least this number of times (`_core`, *touch counts*)
#: and it never changed meanwhile, if it has this number of neighbours: beyond the edge of an insole nothing presses ...
TOUCHED_FROM, NEIGHBOURS_FROM = 3, 5
#: ... or if it is known to hold 0 while the least value of its neighbours (median) was at least this number of ticks
#: and this share of the largest value of the array ...
REST_FROM, REST_SHARE = 10, 0.2
#: ... or if it had no event while the median of its neighbours had at least this number, and most of the array is so
#: noisy that hardly any taxel had few events: among taxels with active neighbours, at most this share of the number of
#: silent ones ...
LOUD_FROM, QUIET_SHARE = 10, 0.1
#: ... It is stuck if it had at least this number of events, all with one value ...
STUCK_FROM = 3
#: ... or if it is known to hold the greatest value of the recording all the time while the values of its neighbours
#: (median) move by at least this number of ticks.
MOVES_FROM = 8
#: ... It is noisy if it changed by itself in at least this number of bins of 50 ms, which are at least this share of
#: those in which it changed, and at most this share of its changes continued in the direction of the change before: a
#: touch continues, noise turns back.
NOISY_FROM, NOISY_SHARE, NOISY_ON = 10, 0.5, 0.45

#: A taxel of frames is stuck too from some time on if it reads exactly one value for so long, us, and for this share of
#: the time from then to the end, at least so many ticks above its least value, while its neighbours (median), of
#: channels the others, are loaded by so many ticks more than their least and released again so many times.
HOLDS_US, HOLDS_SHARE, HOLDS_FROM = 3_000_000, 0.5, 8
#: A taxel that holds its rest is stuck if it has changed in that share of the frames before, in so many of them.
MOVED_SHARE, MOVED_FRAMES = 0.9, 20
#: At most so many frames are looked at for that.
_LOOKS = 2000
#: A row or column is bad as a whole if this share of its taxels is, of so many or more.
_LINE, _LINE_FROM = 0.9, 4

#: A pixel of a camera is noisy too, "hot", if it has at least this number of events, so many spreads (as of normal
#: noise) more than the median of all pixels, and so many times those of all but one of the 24 around it.
HOT_FROM, HOT_SPREADS, HOT_TIMES = 50, 10, 4
#: A taxel of frames is noisy too if the noise of its quieter stretches is at least so many times the median of all, and
#: so many times that of all but one of the 24 around it. Stretches have so many frames; a recording has at least, and
#: of it are looked at at most, so many. Readings in steps have a noise of half a step at least.
UNQUIET_FROM, UNQUIET_TIMES = 4.5, 3.0
_STRETCH, _STRETCHES, _QUIETER = 20, (10, 200), 0.1
#: The standard deviation of normal noise is this many times the median distance from its median.
_DEVIATION = 1.4826

#: A taxel that was not touched enough works if it had at least this number of events, or was once pressed itself.
WORKS_FROM = 10

#: Number of taxels whose neighbours are computed at once.
_AT_ONCE = 1 << 17
#: Row and column offsets of a taxel's neighbours.
_OFFSETS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
#: Frames have noise where most taxels change in this share of them.
_CHANGES = 0.2


class Held(NamedTuple):
    """A taxel of frames that sticks at one value after some time, while those around it are touched.

    Attributes
    ----------
    x, y : int
        Its column and row.
    value : float, in the sensor's unit
    t, until : int, us
        Since when, and until when.
    """

    x: int
    y: int
    value: float
    t: int
    until: int

    def text(self, frames: Events | Frames) -> str:
        """Return what it reads, and when, for people; `frames`: those that hold it."""
        assert isinstance(frames, Frames)
        name = f"{frames.array.names[self.x + self.y * frames.array.columns]}, " if frames.array.names else ""
        first, end = ((t - beginning_us(frames.t[:1])) / 1e6 for t in (self.t, self.until))
        when = f"{first:.1f} s to the end" if self.until == frames.t[-1] else f"{first:.1f} to {end:.1f} s"
        return f"{name}column {self.x}, row {self.y}, reads {self.value:g} {frames.unit} from {when}"


@dataclass(frozen=True, eq=False, repr=False)
class Health:
    """Hold which taxels are dead, stuck or noisy.

    Parameters
    ----------
    array : Array
    activity : int64, shape (rows, columns)
        Number of events (or changes of the frame) at each taxel.
    dead, stuck, noisy : bool, shape (rows, columns)
    untested : bool, shape (rows, columns)
        Taxels that were not touched enough to say whether they work.
    held : tuple of Held
        The stuck taxels of frames that worked before.

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
    held: tuple[Held, ...] = ()

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
        untested = int(np.count_nonzero(self.untested))
        return (
            f"Health({counted(self.array.taxels, 'taxel')}: {counts}"
            + f", {untested} not touched enough to say whether they work" * bool(untested)
            + ")"
        )


def unchanging_taxels(of_taxels: Health, source: Events | Frames) -> NDArray[np.bool_]:
    """Return which untested taxels of frames never change, while noise changes most: it does so in taxels that work."""
    is_noisy = isinstance(source, Frames) and np.median(of_taxels.activity) >= _CHANGES * len(source)
    return np.asarray(of_taxels.untested & (of_taxels.activity == 0) & is_noisy)


def whole_lines(masks: Mapping[str, NDArray[np.bool_]], array: Array) -> tuple[list[str], NDArray[np.bool_]]:
    """Return rows and columns of which nearly all taxels are bad, as texts, and the bad taxels in them.

    `masks`: which taxels are bad, by what they are, as "dead".
    """
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    bad, within, texts = exists & np.any([*masks.values()], axis=0), np.zeros(array.shape, bool), list[str]()
    for noun, axis in (("row", 1), ("column", 0)):
        counts, sizes = (np.count_nonzero(grid, axis=axis) for grid in (bad, exists))
        for k in np.flatnonzero((counts >= _LINE * sizes) & (sizes >= _LINE_FROM)).tolist():
            line = np.zeros(array.shape, bool)
            np.moveaxis(line, 0, 1 - axis)[k] = True
            words = " or ".join(name for name, mask in masks.items() if (mask & line).any())
            texts.append(f"{noun} {k}: {counts[k]} of its {sizes[k]} taxels are {words}")
            within |= line & bad
    return texts, within


def health(recorded: Events | Frames | Recorded) -> Health:
    """Return which taxels are dead, stuck or noisy, each compared with its neighbours.

    A recording cannot show whether taxels work in a region that was never touched: a taxel is named dead or stuck only
    if its neighbours were touched three times or more, or if it always reads the greatest value of all. A taxel that
    was touched less and did nothing is *untested*. States of wire version 2 (`Events.repaired`) and the values held at
    the beginning count as held values, but not as changes of the taxel. Without neighbours, as in one channel, no taxel
    is named.

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
    above their rest, until all but one in four are back; in frames 150 ticks are the range of the values. Dead: three
    touches or more and no change in any of them, with 5 neighbours or more; or no event and known to hold 0, while the
    median of the least values of its neighbours is 10 ticks or more and a fifth of the array's largest value; or no
    event in noise so strong that, over half of the array or more, the taxels with 1 to 9 events are at most a tenth as
    many as the silent ones. A taxel of counts of events is dead only without any event. Stuck: like a dead one, but
    known to hold a value other than 0; or 3 events or more, all with one intensity, while its neighbours show more than
    one; or known to hold the greatest value of the recording, and no other, while the values of its neighbours (median)
    move by 8 ticks or more, touched or not; or, in frames, one that reads exactly one value, 8 ticks or more above its
    least, for 3 s or more and half of the time from then to the end, while its neighbours (median; of channels the
    others) are loaded by 8 ticks and released three times or more. Noisy: in 10 bins of 50 ms or more, half of all in
    which it changes, it has 3 changes or more, and more than 8 times those of all but one of the 24 taxels around it;
    and at most 45 % of its changes go on in the direction of the one before. Of frames, too, one that jumps for less
    than two frames at a time, 10 times or more, more than half as far from its median as ever, while all but one of its
    neighbours move less than an eighth as much; and one whose noise from frame to frame, in the quieter tenth of
    stretches of 20 frames, is 4.5 times the median of all taxels or more, and more than 3 times that of all but one of
    the 24 around it. A pixel of a camera's events or counts is noisy too if it has 50 events or more, more than the
    median of all by 10 times their spread, and more than 4 times those of all but one of the 24 around it.

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
        result = judge(table.array, _statistics_of_events(table))
        # On a board at rest most taxels have no event, and a touch of one of them is no noise.
        of_camera = table.intensity is None and result.activity.size and np.median(result.activity) > 0
        return _with_hot(result, result.activity) if of_camera else result
    if not isinstance(table, Frames):
        raise refused("recorded", f" is {shown(recorded)}: must be a taxel.Recording, taxel.Events or taxel.Frames")
    activity, moved = (
        grid.astype(np.int64).reshape(table.array.shape) for grid in _core.changes_of_frames(table._parts())
    )
    # The values of frames count from the least one.
    scale, least = ticks_by_unit(table), np.fmin.reduce(table.values, axis=None, initial=np.inf)
    ticks = table
    if np.isfinite(least):
        # Values at both ends of single precision are infinitely far apart.
        with np.errstate(over="ignore"):
            values = table.values - least
            ticks = Frames(frozen(np.multiply(values, scale, out=values)), table.t, array=table.array)
    counts = _core.touches_of_frames(ticks._parts(), 0.0 if table.unit in FORCE_UNITS else np.nan)
    result = judge(table.array, TaxelStatistics(activity, moved, Touches.from_counts(*counts)), loud=False)
    if not len(table):
        return result
    # In frames a taxel that never changes is dead or stuck, depending on its value.
    loaded = table.values[0] > least
    noisy = result.noisy | flickering(table)
    if not are_counts(table.unit):
        noisy |= _unquiet(table) & (moved <= NOISY_ON * activity)
    dead, stuck = (grid & ~noisy for grid in (result.dead & ~loaded, result.stuck | result.dead & loaded))
    bounds = [extreme.reduce(ticks.values, axis=0) for extreme in (np.fmin, np.fmax)]
    at_top = _at_top(table.array, *bounds)
    dead, stuck, noisy = dead & ~at_top, stuck | at_top, noisy & ~at_top
    if are_counts(table.unit):
        # A touch may leave out a taxel that works: a pixel has an event only where brightness changes.
        dead &= ~table.values.any(axis=0)
    result = replace(result, untested=result.untested & ~at_top)
    result = replace(result, dead=dead, stuck=stuck, noisy=noisy, untested=result.untested & ~noisy)
    if not are_counts(table.unit):
        return _with_held(result, table, scale)
    return _with_hot(result, np.asarray(np.nansum(table.values, axis=0, dtype=np.float64)))


class Touches(NamedTuple):
    """Touches of each taxel that had a value, counted at it and at its neighbours, shape (taxels,)."""

    taxels: NDArray[np.uint32]
    """Their indices."""
    touches: NDArray[np.uint32]
    """Number of touches at the taxel's place, counted from its neighbours."""
    missed: NDArray[np.uint32]
    """Number of these touches in which the taxel did not change."""
    pressed: NDArray[np.uint32]
    """Number of bins in which the taxel was touched itself."""
    changed: NDArray[np.uint32]
    """Number of bins in which the taxel changed."""
    by_itself: NDArray[np.uint32]
    """Number of these bins in which hardly any neighbour of the taxel changed."""

    @classmethod
    def from_counts(cls, taxels: NDArray[np.uint32], counts: NDArray[np.uint32]) -> Touches:
        """Return what the core gives: the taxels, and rows of five counts one after the other."""
        return cls(taxels, *counts.reshape(-1, 5).T)


class TaxelStatistics(NamedTuple):
    """Statistics of each taxel's events and held values; whole numbers, shape (rows, columns) except touches."""

    activity: NDArray[np.int64]
    """Number of events."""
    moved: NDArray[np.int64]
    """Number of events that have the same polarity as the taxel's previous event."""
    touches: Touches
    values: NDArray[np.signedinteger] | None = None
    """Number of different intensities of the taxel's events: 0, 1, or 2 for more; None without intensities."""
    least: NDArray[np.signedinteger] | None = None
    """The least value that the taxel is known to have had, ticks; -1 for a taxel without any event."""
    greatest: NDArray[np.signedinteger] | None = None
    """The greatest value that the taxel is known to have had, ticks; -1 for a taxel without any event."""


def judge(array: Array, statistics: TaxelStatistics, *, loud: bool = True) -> Health:
    """Return the health of taxels with these statistics, by the rules of `health`; `loud`: that of noise too."""
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    activity, touches = statistics.activity, statistics.touches
    silent = exists & (activity == 0)

    def where(selected: NDArray[np.bool_]) -> NDArray[np.bool_]:
        grid = np.zeros(array.shape, bool)
        grid.reshape(-1)[touches.taxels[selected]] = True
        return grid

    enough = where(touches.touches >= TOUCHED_FROM) & (_neighbours(exists) >= NEIGHBOURS_FROM)
    dead = exists & enough & where(touches.missed == touches.touches)
    if loud:
        # A median reaches a bound only if a neighbour reaches it, so all other taxels are skipped.
        among = _reaches(activity, exists, (_neighbours(exists & (activity >= LOUD_FROM)) > 0) & exists, LOUD_FROM)
        quiet = np.count_nonzero(among & (activity > 0) & (activity < LOUD_FROM))
        alone = quiet <= QUIET_SHARE * np.count_nonzero(among & silent)
        if alone and 2 * np.count_nonzero(among) > np.count_nonzero(exists):
            dead |= silent & among
    stuck = np.zeros(array.shape, bool)
    if statistics.least is not None and statistics.greatest is not None:
        least = max(REST_FROM, REST_SHARE * int(statistics.greatest.max(initial=0)))
        known = exists & (statistics.least >= 0)
        at_zero = silent & (statistics.greatest == 0) & (_neighbours(known & (statistics.least >= least)) > 0)
        dead |= _reaches(statistics.least, known, at_zero, least)
        stuck = dead & (statistics.greatest > 0)
        stuck |= silent & known & _at_top(array, statistics.least, statistics.greatest)
    if statistics.values is not None:
        still = exists & (activity >= STUCK_FROM) & (statistics.values == 1)
        stuck |= _reaches(statistics.values, exists & (activity > 0), still, 1, above=True)
    noisy = exists & where((touches.by_itself >= NOISY_FROM) & (touches.by_itself >= NOISY_SHARE * touches.changed))
    noisy &= ~stuck & (statistics.moved <= NOISY_ON * activity)
    # A channel has no neighbours that would show what it should do.
    noisy &= min(array.shape) > 1
    dead &= ~stuck
    works = enough | where(touches.pressed > 0) | (activity >= WORKS_FROM)
    untested = exists & ~dead & ~stuck & ~noisy & ~works
    return Health(array, activity, dead, stuck, noisy, untested)


def _with_held(result: Health, frames: Frames, scale: float) -> Health:
    """Return the same with taxels as stuck that hold one value after some time; `scale`: ticks by the unit."""
    some = frames[:: 1 + len(frames) // _LOOKS]
    t, values = some.t, some.values.reshape(len(some), -1)
    begins, runs = np.zeros((2, values.shape[1]), np.int64)
    first, moves = begins.copy(), np.zeros_like(values, np.int64)
    # The longest run of equal values of each taxel.
    for k in range(1, len(some)):
        first = np.where(values[k] == values[k - 1], first, k)
        moves[k] = moves[k - 1] + (first == k)
        longer = k - first > runs
        begins, runs = np.where(longer, first, begins), np.maximum(runs, k - first)
    lasts_us = t[begins + runs] - t[begins]
    least = np.fmin.reduce(values, axis=0)
    held = values[begins, np.arange(values.shape[1])]
    moved = moves[begins, np.arange(values.shape[1])]
    were_noisy = (moved >= MOVED_FRAMES) & (moved >= MOVED_SHARE * begins)
    is_long = (lasts_us >= HOLDS_US) & (lasts_us >= HOLDS_SHARE * (t[-1] - t[begins]))
    array, found = frames.array, list[Held]()
    for k in np.flatnonzero(is_long & (were_noisy | ((held - least) * scale >= HOLDS_FROM))).tolist():
        y, x = divmod(k, array.columns)
        if result.noisy[y, x] or not _are_touched(
            values[begins[k] : begins[k] + runs[k] + 1], array.shape, k, least, scale
        ):
            continue
        # Only some frames were looked at; the value may begin before the first of these.
        series = frames.values[:, y, x]
        at = int(np.searchsorted(frames.t, t[begins[k]]))
        others = np.flatnonzero(series[:at] != held[k])
        begin = int(others[-1]) + 1 if len(others) else 0
        end = int(np.searchsorted(frames.t, t[begins[k] + runs[k]]))
        if (series[begin : end + 1] == held[k]).all():
            found.append(Held(x, y, float(held[k]), int(frames.t[begin]), int(frames.t[end])))
    stuck = result.stuck.copy()
    for each in found:
        stuck[each.y, each.x] = True
    return replace(result, stuck=stuck, dead=result.dead & ~stuck, untested=result.untested & ~stuck, held=tuple(found))


def _are_touched(
    values: NDArray[np.float32], shape: tuple[int, int], k: int, least: NDArray[np.float32], scale: float
) -> bool:
    """Return whether those around taxel k are loaded, and released, three times or more in some frames."""
    y, x = divmod(k, shape[1])
    around = np.zeros(shape, bool)
    reach = slice(None) if min(shape) == 1 else slice(max(0, x - 1), x + 2)
    around[max(0, y - 1) : y + 2, reach] = True
    around[y, x] = False
    others = around.reshape(-1)
    if not others.any():
        return False
    above = np.nan_to_num(np.median((values[:, others] - least[others]) * scale, axis=1))
    # Between both bounds a load goes on.
    states = np.where(above >= HOLDS_FROM, 1, np.where(above < HOLDS_FROM / 2, 0, -1))
    states = states[states >= 0]
    return bool(np.count_nonzero(np.diff(states) < 0) >= TOUCHED_FROM)


def _unquiet(frames: Frames) -> NDArray[np.bool_]:
    """Return which taxels have far more noise than all others where they are quietest, and than those around them."""
    found, count = np.zeros(frames.array.shape, bool), len(frames) // _STRETCH
    least, most = _STRETCHES
    if min(found.shape) == 1 or count < least:
        return found
    begins = _STRETCH * np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
    stretches = frames.values[begins[:, None] + np.arange(_STRETCH)]
    # Drift and touches that last are not in what changes from frame to frame.
    steps = np.abs(np.diff(stretches, axis=1)).astype(np.float64)
    noise = np.quantile(np.sqrt(np.mean(steps**2, axis=1) / 2), _QUIETER, axis=0)
    known = np.isfinite(noise)
    if not known.any():
        return found
    step = float(np.min(steps, where=steps > 0, initial=np.inf))
    # The lower of the two in the middle: one of four taxels may be noisy.
    median = max(float(np.quantile(noise[known], 0.5, method="lower")), step / 2)
    noise = np.where(known, noise, 0.0)
    for row, column in np.argwhere(noise >= UNQUIET_FROM * median).tolist():
        found[row, column] = noise[row, column] > UNQUIET_TIMES * _second_around(noise, row, column)
    return found


def _second_around(values: NDArray[Any], row: int, column: int) -> Any:
    """Return the second largest of the 24 values around a taxel, of which it is the largest, or more than that."""
    rows, columns = (slice(max(0, at - 2), at + 3) for at in (row, column))
    around = np.sort(values[rows, columns], axis=None)
    return around[-3] if len(around) > 2 else 0


def _with_hot(result: Health, counts: NDArray[Any]) -> Health:
    """Return the same with taxels as noisy that have far more events than all others, and than those around them."""
    exists = np.ones(counts.shape, bool) if result.array.exists is None else result.array.exists.reshape(counts.shape)
    if min(counts.shape) == 1:
        return result
    median = float(np.median(counts[exists]))
    spread = max(float(np.median(np.abs(counts[exists] - median))) * _DEVIATION, median**0.5)
    far = exists & (counts >= max(HOT_FROM, median + HOT_SPREADS * spread))
    counts, noisy = np.where(exists, counts, 0), result.noisy.copy()
    for row, column in np.argwhere(far).tolist():
        noisy[row, column] |= bool(counts[row, column] > HOT_TIMES * _second_around(counts, row, column))
    return replace(result, noisy=noisy, untested=result.untested & ~noisy, dead=result.dead & ~noisy)


def _at_top(array: Array, least: NDArray[Any], greatest: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which taxels always held the greatest value of the array, ticks, while their neighbours moved."""
    exists = np.ones(array.shape, bool) if array.exists is None else np.asarray(array.exists).reshape(array.shape)
    known = exists & np.isfinite(least) & np.isfinite(greatest)
    if min(array.shape) == 1 or not known.any():
        return np.zeros(array.shape, bool)
    top = known & (least == greatest[known].max())
    return _reaches(np.where(known, greatest - least, 0), known, top, MOVES_FROM)


def _statistics_of_events(events: Events) -> TaxelStatistics:
    """Return the statistics of each taxel; an event that a state repaired counts for the held value only."""
    sent = np.ones(len(events), bool) if events.repaired is None else ~events.repaired
    index = events.array.index(events.x, events.y).astype(np.int64)
    activity, moved = _ways(index[sent], np.where(events.p[sent], 1, -1), events.array)
    touches = Touches.from_counts(*_core.touches_of_events(events.sorted()._parts()))
    if events.intensity is None or events.present is None:
        return TaxelStatistics(activity, moved, touches)
    shape, size = events.array.shape, events.array.rows * events.array.columns
    pairs = np.unique(index[events.present & sent] * 65_536 + events.intensity[events.present & sent].astype(np.int64))
    values = np.bincount(pairs // 65_536, minlength=size).astype(np.int32)
    ticks = events.intensity[events.present].astype(np.int32)
    least, greatest = np.full(size, 65_536, np.int32), np.full(size, -1, np.int32)
    np.minimum.at(least, index[events.present], ticks)
    np.maximum.at(greatest, index[events.present], ticks)
    least[greatest < 0] = -1
    grids = (grid.reshape(shape) for grid in (values, least, greatest))
    return TaxelStatistics(activity, moved, touches, *grids)


def _ways(index: NDArray[np.int64], way: NDArray[Any], array: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return how many changes each taxel has, and how many of them have the direction of the one before."""
    order = np.argsort(index, kind="stable")
    taxel, way = index[order], way[order]
    again = taxel[1:][(taxel[1:] == taxel[:-1]) & (way[1:] == way[:-1])]
    size = array.rows * array.columns
    counts = (np.bincount(taxels, minlength=size).reshape(array.shape) for taxels in (taxel, again))
    activity, moved = counts
    return activity, moved


def _neighbours(mask: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return how many of the up to 8 neighbours of each taxel a mask has."""
    rows, columns = mask.shape
    padded = np.pad(mask, 1)
    number = np.zeros(mask.shape, np.uint8)
    for i, j in _OFFSETS:
        number += padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
    return number


def _reaches(
    grid: NDArray[Any], counts: NDArray[np.bool_], where: NDArray[np.bool_], bound: float, *, above: bool = False
) -> NDArray[np.bool_]:
    """Return for which taxels the median of the neighbours that count is at least a bound, or above it."""
    reached = np.zeros(grid.shape, bool)
    places = np.flatnonzero(where)
    medians = _around(grid, counts, places)
    reached.reshape(-1)[places] = medians > bound if above else medians >= bound
    return reached


def _around(grid: NDArray[Any], counts: NDArray[np.bool_], places: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the median of the neighbours that count, for taxels by index; 0 if none counts.

    numpy.nanmedian does the same for one taxel at a time and is a hundred times slower.
    """
    padded = np.pad(np.where(counts, grid, np.nan), 1, constant_values=np.nan)
    medians = np.empty(len(places))
    for first in range(0, len(places), _AT_ONCE):
        y, x = np.divmod(places[first : first + _AT_ONCE], grid.shape[1])
        # Neighbours that do not count are NaN, which is sorted last.
        around = np.sort([padded[1 + y + i, 1 + x + j] for i, j in _OFFSETS], axis=0)
        count = np.count_nonzero(~np.isnan(around), axis=0)
        middle = np.stack([np.maximum(count - 1, 0) // 2, count // 2])
        medians[first : first + _AT_ONCE] = np.where(count, np.take_along_axis(around, middle, axis=0).mean(axis=0), 0)
    return medians
