"""What the quiet of a recording shows: what its taxels read at rest, and how large a change is noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import wraps
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recording.recording import Recording
from taxel.tare import Tare

#: Units of force and pressure: an unloaded taxel reads 0 in them.
FORCE_UNITS = _core.FORCE_UNITS
#: The note of a tare that was not measured.
BY_UNIT = "0, by the unit"
#: Reading: a noise floor is so many standard deviations of the noise, so that two neighbours rarely exceed it together,
#: and its noise is what this share of the taxels has at most: of the others some may be bad. It is ...
TIMES_NOISE, SHARE = _core.TIMES_NOISE, 0.9
#: ... at least this share of the range above rest: taxels without noise drift and creep.
_SHARE_OF_RANGE = 0.01
#: Reading: the noise floor of the board's fast presets, ticks ...
NOISE_FLOOR = _core.NOISE_FLOOR
#: ... in another unit, the range of a recording's values counts as so many ticks, ...
RANGE_TICKS = 150.0
#: ... but counts of events are chance up to so many more than standard deviations of them, in this share of the frames.
_BY_CHANCE, _QUIET_SHARE = 2.0, 0.75

#: Reading: what a taxel reads in a quiet stretch is not its rest, but a load that stood still, if in more than this
#: share of all frames it reads less by so many ticks.
LOADED_SHARE, LOADED_TICKS = 0.1, _core.LOADED_TICKS
#: Fewer rows or columns have no place where a load has so many neighbours.
_TOGETHER = 3
#: Values fall from a rest if they go so many times as far below it as above it, in the taxel that does so third most:
#: bad taxels move alone or in pairs. In ...
_FALLS, _THIRD = 3.0, 3
#: ... a smaller array the first counts.
_SMALL = 9
#: So many frames or fewer give a taxel's median, and what it reads in all but this share of them.
_MEDIAN_OF, _LOWEST = 2000, 0.05
#: The number of loaded taxels of the smallest touch.
TOUCH = 2.0
#: This share of a tare, at its beginning, holds no touch.
_EARLY = 0.25
#: A taxel varies more than its noise at the beginning from so many times that on, and this part of the noise floor.
_VARIES, _OF_FLOOR = 3.0, 6.0

#: Values in a block of frames, and in one of what a board's taxels hold.
_BLOCK, _HELD_BLOCK = 1 << 16, 1 << 21
#: The values of events are read this often, us, so many times from each change on: a second has a whole quiet stretch.
_TRACKED_US, _AFTER = 50_000, 21

#: Frames in order: their times, us, and their values by taxel, NaN where a taxel has none.
FrameBlock = tuple[NDArray[np.int64], NDArray[np.float32]]

T = TypeVar("T")


def once(find: Callable[[Frames], T]) -> Callable[[Frames], T]:
    """Return a costly function of frames that computes each result once."""

    @wraps(find)
    def found(frames: Frames) -> T:
        known: dict[str, T] = frames._found
        if find.__name__ not in known:
            known[find.__name__] = find(frames)
        return known[find.__name__]

    return found


@dataclass(frozen=True, eq=False)
class Readings:
    """What the taxels of a source read over time, in blocks, and the ticks by the unit."""

    array: Array
    scale: float
    blocks: Callable[[], Iterable[FrameBlock]]

    @classmethod
    def of_frames(cls, frames: Frames) -> Readings:
        """Return frames in blocks that a processor's cache holds."""
        taxels = frames.array.rows * frames.array.columns
        values, block = frames.values.reshape(len(frames), taxels), max(1, _BLOCK // max(1, taxels))
        blocks = [(frames.t[k : k + block], values[k : k + block]) for k in range(0, len(frames), block)]
        return cls(frames.array, rest_scale(frames), lambda: blocks)

    @classmethod
    def of_events(cls, recording: Recording) -> Readings:
        """Return what a board's taxels hold where one changes and for a while after it: then all stays."""
        (first, stop), held = interval(recording), held_values(recording)
        taxels = recording.array.rows * recording.array.columns
        steps = np.unique((np.append(recording.events.t, first) - first) // _TRACKED_US)
        times = first + np.unique(steps[:, None] + np.arange(_AFTER)) * _TRACKED_US
        times, size = times[times < stop], max(1, _HELD_BLOCK // taxels)

        def blocks() -> Iterator[FrameBlock]:
            for t in (times[k : k + size] for k in range(0, len(times), size)):
                yield t, held.at(t).reshape(len(t), taxels)

        return cls(recording.array, 1.0, blocks)

    def tracked(self, begins: NDArray[np.float64]) -> _core.TrackedRest:
        """Return the rest that is tracked from these values on, NaN where that of a taxel is unknown."""
        return _core.TrackedRest(self.array.columns, NOISE_FLOOR, begins * self.scale)

    def above(self, rest: _core.TrackedRest) -> Iterator[FrameBlock]:
        """Yield what is read above a rest, which tracks it; 0 below it."""
        for t, values in self.blocks():
            above = rest.above(t, np.ascontiguousarray(values * np.float32(self.scale)).reshape(-1))
            yield t, above.reshape(values.shape) / np.float32(self.scale)

    def in_quiet(self) -> tuple[tuple[int, int], NDArray[np.float64]] | None:
        """Return the first quiet stretch, us, and what each taxel read in it, or later when released; or None."""
        rest = self.tracked(np.full(self.array.rows * self.array.columns, np.nan))
        for _ in self.above(rest):
            pass
        return None if rest.quiet is None else (rest.quiet, rest.begins / self.scale)

    def load_in(
        self, stretch_us: tuple[int, int], begins: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], str] | None:
        """Return what lay on each taxel in a stretch and was taken away later, and where, for people; "" for nowhere.

        None where all taxels were loaded in it: a loaded stretch is no rest. On a grid it lay on three of nine
        neighbours or more, and not on most taxels, which is drift.

        Parameters
        ----------
        stretch_us : (int, int), us
        begins : float64, one per taxel
            What it read in the stretch, or the least in a later quiet one.
        """
        known, released, in_stretch = (np.zeros(len(begins), np.int64) for _ in range(3))
        less, within = np.zeros(len(begins)), np.zeros(len(begins))
        for t, values in self.blocks():
            load = values - begins
            far = load < -LOADED_TICKS / self.scale
            released += far.sum(axis=0)
            less -= np.where(far, load, 0.0).sum(axis=0)
            known += np.count_nonzero(~np.isnan(load), axis=0)
            inside = load[slice(*np.searchsorted(t, stretch_us))]
            within += np.nan_to_num(inside).sum(axis=0)
            in_stretch += np.count_nonzero(~np.isnan(inside), axis=0)
        loaded, above = released > LOADED_SHARE * known, LOADED_TICKS / self.scale
        if loaded[known > 0].all():
            return None
        loads = within / np.maximum(in_stretch, 1) + np.where(loaded, less / np.maximum(released, 1), 0.0)
        if min(self.array.shape) < _TOGETHER:
            return np.where(loads > above, loads, 0.0), ""
        return _core.preload(np.where(known > 0, loads, np.nan), self.array.columns, above, (0, 0))


def held_values(recording: Recording) -> _core.HeldValues:
    """Return what the taxels hold over time; NaN before the first event of a taxel whose value was not known."""
    unknown = np.full(recording.array.shape, np.nan, np.float32)
    begins = unknown if recording.held is None else recording.held
    return _core.HeldValues(recording.events, None, begins.reshape(-1))


def interval(recording: Recording) -> tuple[int, int]:
    """Return the first time of a recording of events and its end, us."""
    t = recording.events.t
    return recording.interval or (int(t.min()), int(t.max()) + 1)


@once
def by_unit(frames: Frames) -> Tare | None:
    """Return the tare of frames in a unit of force or pressure: 0, with the noise of a quiet stretch; None of others.

    The noise of a taxel is 1.4826 times how much the third quartile of what it reads there is above the median: the
    standard deviation of normal noise, also where a sensor cuts off what is below 0, and in a stretch of which less
    than a quarter is a press. 0 where none is quiet, and of a taxel without a value.
    """
    if frames.unit not in FORCE_UNITS or not len(frames):
        return None
    found = in_quiet(frames)
    still = np.zeros((1, *frames.array.shape)) if found is None else frames.between(*found[0]).values
    middle, above = quantile(np.where(np.isnan(still).all(axis=0), 0.0, still), (0.5, 0.75))
    nothing = Frames(np.zeros((2, *frames.array.shape)), [0, 1], unit=frames.unit, array=frames.array)
    return Tare.take(nothing, note=BY_UNIT)._with(noise=1.4826 * np.asarray(above - middle, np.float64))


@once
def in_quiet(frames: Frames) -> tuple[tuple[int, int], NDArray[np.float64]] | None:
    """Return the quiet stretch of frames as of `Readings.in_quiet`."""
    return Readings.of_frames(frames).in_quiet()


def fall(frames: Frames, stretch_us: tuple[int, int]) -> bool:
    """Return whether values go further below their rest in a quiet stretch than above it, and come back.

    The rest is here that of the stretch itself: a tracked one follows values that fall and stay for a while. A taxel
    that is loaded half of the time or more has its lower one; one that never comes back was loaded before.
    """
    values, scale = frames.held().values.reshape(len(frames), -1), rest_scale(frames)
    first, end = np.searchsorted(frames.t, stretch_us)
    rest = np.median(values[:: 1 + len(values) // _MEDIAN_OF], axis=0)
    rest = np.minimum(rest, values[first:end].mean(axis=0, dtype=np.float64))
    lowest = values.min(axis=0)
    down, up = rest - lowest, values.max(axis=0) - rest
    rank = _THIRD if down.size >= _SMALL else 1
    far = max(_FALLS * np.partition(up, -rank)[-rank], 2 * LOADED_TICKS / scale)
    below = np.flatnonzero(down > far)
    if len(below) < rank:
        return False
    series = values[:, below].T
    back = np.array([each[k:].max() for each, k in zip(series, series.argmin(axis=1), strict=True)])
    return int(np.count_nonzero(back >= (rest - down / _FALLS)[below])) >= rank


def rest_scale(frames: Frames) -> float:
    """Return the ticks by the unit of frames by which their rest is found: of counts of events by chance, not by range.

    A count is chance up to so many standard deviations above the mean, and an event or two. The mean is that of the
    frames with the fewest events: touches fill less than a quarter.
    """
    if not are_counts(frames.unit) or not len(frames):
        return ticks_by_unit(frames)
    means = np.nan_to_num(np.nanmean(frames.values.reshape(len(frames), -1), axis=1, dtype=np.float64))
    mean = float(means[means <= np.quantile(means, _QUIET_SHARE)].mean())
    return float(_core.touched_above(NOISE_FLOOR)) / (_BY_CHANCE + TIMES_NOISE * float(np.sqrt(mean)))


@once
def ticks_by_unit(frames: Frames) -> float:
    """Return the ticks by the unit of frames: the range of their values counts as that of a board's ramp."""
    if frames.unit == "ticks":
        return 1.0
    least, most = extremes(frames)
    span = float(np.fmax.reduce(most, axis=None, initial=np.nan)) - float(
        np.fmin.reduce(least, axis=None, initial=np.nan)
    )
    return RANGE_TICKS / span if span > 0 else 1.0


@once
def extremes(frames: Frames) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return each taxel's least and greatest value, NaN for one without any."""
    least, most = (reduction.reduce(frames.values, axis=0, initial=np.nan) for reduction in (np.fmin, np.fmax))
    return least, most


def quantile(values: NDArray[np.float32], shares: float | tuple[float, ...]) -> NDArray[np.float64]:
    """Return quantiles over frames, without missing values; NumPy takes far longer to look for these."""
    find = np.nanquantile if np.isnan(values.min(initial=0.0)) else np.quantile
    return np.asarray(find(values, shares, axis=0), np.float64)


def lowest(frames: Frames) -> NDArray[np.float64]:
    """Return what each taxel reads in nearly all frames, NaN for one without a value."""
    return quantile(frames.values[:: 1 + len(frames) // _MEDIAN_OF], _LOWEST)


def standing(frames: Frames) -> str:
    """Return on which taxels of a grid, in a unit of force, an object is from beginning to end; "" if none is.

    They read more than 0 in nearly all frames, by more than the rest of any recording may be off.
    """
    if frames.unit not in FORCE_UNITS or not len(frames):
        return ""
    above = LOADED_TICKS / ticks_by_unit(frames)
    _, where = _core.preload(lowest(frames).reshape(-1), frames.array.columns, above, (0, 0))
    return where.replace(" above rest", f" {frames.unit} in every frame")


def floor_at_rest(noise: NDArray[np.float64]) -> float:
    """Return the noise floor by the noise of taxels at rest, NaN where unknown, in its unit; 0 where none is known."""
    known = noise[np.isfinite(noise)]
    return TIMES_NOISE * float(np.quantile(known, SHARE)) if len(known) else 0.0


def reach(frames: Frames, tare: Tare) -> float:
    """Return the largest value above rest that 90 % of the taxels have at most."""
    above = np.fmax.reduce(frames.values, axis=0, initial=-np.inf) - tare.rest
    known = above[np.isfinite(above) & np.isfinite(tare.noise)]
    return float(np.quantile(known, SHARE)) if len(known) else 0.0


def noise_floor(source: Events | Frames, tare: Tare) -> float:
    """Return the noise floor of a sensor above a tare, in its unit: that of the fast presets for a board's ticks.

    Of others six standard deviations of the noise, and a hundredth of the largest value above rest at least, both those
    that 90 % of the taxels have at most; 0 where nothing is known.
    """
    if not isinstance(source, Frames) or source.unit == "ticks":
        return NOISE_FLOOR
    if np.isnan(tare.noise).all() or not len(source):
        return 0.0
    return max(floor_at_rest(tare.noise), _SHARE_OF_RANGE * reach(source, tare))


def early(source: Events | Frames, tare: Tare) -> Tare | None:
    """Return the beginning of a tare, as a touch may end it; None if the tare is of another recording."""
    try:
        again = Tare.take(source, start_us=tare.start_us, stop_us=tare.stop_us)
        stop_us = tare.start_us + round(_EARLY * (tare.stop_us - tare.start_us))
        is_own = np.array_equal(again.rest, tare.rest, equal_nan=True)
        return Tare.take(source, start_us=tare.start_us, stop_us=stop_us) if is_own else None
    except ProblemError:
        return None


def touched(source: Events | Frames, tare: Tare) -> int:
    """Return how many taxels vary far more in a tare than at its beginning, as a touch is in it.

    A tare of another recording says nothing: 0.
    """
    first = early(source, tare)
    if first is None:
        return 0
    noise, more = first.noise, (noise_floor(source, first) or NOISE_FLOOR) / _OF_FLOOR
    if isinstance(source, Frames) and are_counts(source.unit):
        # Few events show neither their noise nor that one more is chance.
        count, of_all = (len(source.between(each.start_us, each.stop_us)) for each in (first, tare))
        noise = np.maximum(noise, (np.nanmean(first.rest) + 1.0 / (count * noise.size)) ** 0.5)
        more = max(more, of_all**-0.5)
    return int(np.count_nonzero(tare.noise > _VARIES * noise + more))
