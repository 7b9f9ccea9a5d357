"""The rest of a recording's taxels: what they read while nothing touches them, and where that is known from.

One ladder for trainings, detections, summaries, plots and the page: what is given; 0 by the unit; a quiet stretch;
nothing. A stretch in which the sensor was loaded is never a rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from errno import ENOENT
from functools import wraps
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import checked_path, instance
from taxel._base.errors import helped, refused
from taxel._base.messages import counted, warn
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.formats.layout import or_given
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.opening import open_one
from taxel.recording.recording import Recording
from taxel.spikes import to_ms
from taxel.tare import GivenTare, Tare, check_tare, seconds_of

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
#: So long a stretch must be quiet, s.
_QUIET_S = 0.5
#: A taxel in a unit of force or pressure reads more than its noise in a quiet stretch from so many times that on; more
#: than this share of all are many. What it reads there is mostly a load if in nearly all frames it reads less than this
#: share of that.
_TIMES, _MANY, _MOSTLY_LOAD = 3.0, 0.25, 0.5
#: Why nothing is known.
_WHY = "no stretch of half a second and four values was quiet and without load"
#: Share of the taxels with events that may lack a rest without a warning: a few have their first event late.
_MOST_UNKNOWN = 0.1

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


@dataclass(frozen=True, eq=False)
class Rest:
    """What the taxels of a recording read at rest, how large their noise is, and where both are known from.

    Attributes
    ----------
    source : {"given", "beginning", "calibration", "unit", "quiet", "none"}
        A given tare; seconds at the recording's beginning, as asked; the calibration's own rest; 0, as the values are
        force or pressure; the first quiet stretch; nothing.
    tare : Tare, optional
        Rest and noise of each taxel; None of "none". That of a quiet stretch is where the rest is tracked from.
    begin_us : int, us
        The time that text counts from: the recording's first if its times count from 1970, else 0.
    falls : bool
        Whether values of frames go further below the rest of a quiet stretch than above it, and come back: less may
        mean more pressure.
    preload_at : str
        Of a grid: where something lay in the quiet stretch, for people; the rest is without it. "" where nothing did.
    zeroed : int
        Number of taxels that were zeroed while recording: after that their rest is the given value.
    """

    source: str
    tare: Tare | None = None
    begin_us: int = 0
    falls: bool = False
    preload_at: str = ""
    zeroed: int = 0

    @property
    def us(self) -> tuple[int, int] | None:
        """From when to when it was measured in the recording, us."""
        measured = self.source in ("beginning", "quiet")
        return (self.tare.start_us, self.tare.stop_us) if measured and self.tare is not None else None

    @property
    def detect_from_us(self) -> int | None:
        """When detection begins: at the end of a beginning that was given as at rest; None: with the recording."""
        return self.us[1] if self.us is not None and self.source == "beginning" else None

    def _values(self, array: Array) -> NDArray[np.float64]:
        """Return the rest of each taxel, in the sensor's unit; NaN where it is not known."""
        return np.full(array.rows * array.columns, np.nan) if self.tare is None else self.tare.rest.reshape(-1)

    def _needed(self, recording: Recording) -> Tare:
        """Return its tare.

        Raises
        ------
        ProblemError : it is not known, so that a tare must be given
        """
        if self.tare is None:
            error = ProblemError(f"{recording.path}: the values of its taxels at rest are not known, because {_WHY}")
            raise helped(error, "tare", "give")
        return self.tare

    def __str__(self) -> str:
        return self._text()

    def _text(self, path: Path | None = None, turned: float | None = None) -> str:
        """Return the line of every command; `path` is the recording's, `turned` what its values were turned by."""
        first, end = (f"{(t - self.begin_us) / 1e6:.3f}" for t in self.us or (0, 0))
        text = {
            "given": "the given tare",
            "beginning": f"its beginning, {first} to {end} s",
            "calibration": "the calibration's",
            "unit": "0, because the values are force or pressure",
            "quiet": f"its first quiet stretch, {first} to {end} s",
            "none": f"unknown, because {_WHY}; to set the rest, give a tare",
        }[self.source]
        text += f"; {self.preload_at} were loaded then, and that load is subtracted" * bool(self.preload_at)
        if self.falls and turned is not None:
            text += "; values fall from their rest after a layout inverted them: if the values need no inversion, "
            text += "remove the line 'falls = ...' from it"
        elif self.falls:
            where = "" if path is None else f", {or_given(path)}"
            text += "; values fall from their rest: if smaller values mean more pressure, write falls = true in a "
            text += f"layout file{where}"
        return text + f"; {counted(self.zeroed, 'taxel')} zeroed" * bool(self.zeroed)

    def to_dict(self) -> dict[str, Any]:
        """Return where it is from, when it was measured, how many taxels were zeroed, and whether values fall."""
        us = None if self.us is None else list(self.us)
        return {"source": self.source, "us": us, "zeroed": self.zeroed, "falls": self.falls}


def rest(recording: Recording, tare: GivenTare | None = None) -> Rest:
    """Return the rest of a recording's taxels, for each task, on the page, in shell and Python.

    It is the given one; else 0 of frames in a unit of force or pressure; else that of the first quiet stretch of half
    a second in which nothing is on the array, for a board's events on their held values, or on what all taxels read
    until the board's start, if it is in there; else unknown.

    Parameters
    ----------
    recording : Recording
        Of one sensor.
    tare : Tare, path or float (s), optional
        A tare, its file, a recording at rest, or the seconds at rest at the recording's beginning.

    Raises
    ------
    ProblemError : a given tare is invalid
    FormatError : the file is neither a tare nor a recording

    Examples
    --------
    >>> import numpy as np
    >>> import taxel
    >>> values = np.full((100, 2, 2), 50.0)
    >>> values[70:] += 200
    >>> frames = taxel.Frames(values, 10_000 * np.arange(100), unit="counts", array=taxel.Array(2, 2))
    >>> import pathlib, tempfile
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "press.npz"
    >>> _ = taxel.convert(frames, place)
    >>> taken = rest(taxel.open(place))
    >>> str(taken), taken.tare.rest[0, 0]
    ('its first quiet stretch, 0.000 to 0.500 s', np.float64(50.0))
    """
    instance("recording", recording, Recording)
    source = recording.events if recording.has_events else recording.frames()
    zeroed = len({(z.x, z.y) for z in recording.zeroings})
    if tare is not None:
        known = Rest("given" if seconds_of(tare) is None else "beginning", given_tare(tare, recording))
    elif isinstance(source, Frames):
        known = of_frames(source)
        if known.source == "unit" and recording.timed:
            _warn_of_offset(recording, source, known)
    else:
        known = _of_events(recording)
    return replace(known, begin_us=beginning_us(source.t[:1]), zeroed=zeroed)


def is_stated(recording: Recording, tare: GivenTare | None) -> bool:
    """Return whether the rest is known without a look at the values: a tare is given, or the unit says that it is 0."""
    return tare is not None or (not recording.has_events and recording.frames().unit in FORCE_UNITS)


@once
def of_frames(frames: Frames) -> Rest:
    """Return the rest of frames without a tare: 0 of force or pressure, else what a quiet stretch shows, or none."""
    if (zero := by_unit(frames)) is not None:
        return Rest("unit", zero)
    if frames.array._has_axes:
        return _of_axes(frames)
    if (found := in_quiet(frames)) is None:
        return Rest("none")
    tare = Tare.take(frames.held(), start_us=found[0][0], stop_us=found[0][1])
    taken = _unloaded(tare, Readings.of_frames(frames), found[1])
    # What values that fall with pressure rise by is no load.
    return Rest("quiet", tare, falls=True) if taken.tare is not None and fall(frames, found[0]) else taken


def _of_axes(frames: Frames) -> Rest:
    """Return the rest of channels that are axes of taxels: z says where the sensor was at rest."""
    is_z = np.array([name.endswith("_z") for name in frames.array.names or ()])
    z = frames.values.reshape(len(frames), -1)[:, is_z]
    of_z = of_frames(Frames(z[:, None], frames.t, unit=frames.unit, array=Array(1, z.shape[1])))
    if of_z.tare is None:
        return of_z
    tare = Tare.take(frames.held(), start_us=of_z.tare.start_us, stop_us=of_z.tare.stop_us)
    rest = tare.rest.reshape(-1).copy()
    rest[is_z] = of_z.tare.rest.reshape(-1)
    return replace(of_z, tare=tare._with(rest=rest))


def _of_events(recording: Recording) -> Rest:
    """Return the rest of a board's taxels that a quiet stretch of what they hold shows, or none."""
    events = recording.events
    if events.present is None or not events.present.any():
        return Rest("none")
    read = Readings.of_events(recording)
    if (found := read.in_quiet()) is None:
        return Rest("none")
    begin, end = found[0]
    # Until its start a board sends all that its taxels read, and then only changes beyond its noise floor.
    marked = min((t for t, starts in events.markers if starts and begin < t < end), default=end)
    if _taxels(events.between(begin, marked)) == _taxels(events):
        end = marked
    return _unloaded(_measured(recording, end, begin), read, found[1])


def _taxels(events: Events) -> int:
    """Return how many taxels have events."""
    return len(np.unique(events.y.astype(np.int64) * events.array.columns + events.x))


def _unloaded(tare: Tare, read: Readings, begins: NDArray[np.float64]) -> Rest:
    """Return the rest of a quiet stretch, without what lay on the taxels then; none if all were loaded."""
    if (load := read.load_in((tare.start_us, tare.stop_us), begins)) is None:
        return Rest("none")
    on, where = load
    return Rest("quiet", tare._with(rest=tare.rest.reshape(-1) - on) if on.any() else tare, preload_at=where)


def loaded_from(frames: Frames, taken: Rest) -> float:
    """Return from how much above its rest on a taxel of frames counts as loaded, in their unit.

    It is more than the noise of a quiet stretch, and where the unit does not say that the rest is 0, than the noise
    floor of the board's fast presets; of a rest that is not of the recording itself, more than 0.
    """
    if taken.tare is None or taken.source not in ("unit", "quiet"):
        return 0.0
    least = float(_core.touched_above(NOISE_FLOOR)) / rest_scale(frames) if taken.source == "quiet" else 0.0
    return max(floor_at_rest(taken.tare.noise), least)


def given_tare(tare: GivenTare, recording: Recording) -> Tare:
    """Return the tare that is given: itself, that of a file or of a recording at rest, or of seconds at the beginning.

    The rest ends early where the board marked the start of the recording, as a board that was tared does. A rest
    longer than half of the recording is refused, because the sensor was hardly at rest for all of it.
    """
    if isinstance(tare, Tare):
        return tare
    seconds = seconds_of(tare)
    if seconds is None:
        return tare_of(Path(checked_path("tare", tare)), recording)
    check_tare(tare)
    source = recorded(recording)
    if not len(source):
        raise ProblemError(f"{recording.path}: holds nothing to take a tare from")
    first, last = int(source.t[0]), int(source.t[-1])
    if seconds * 2e6 > last - first:
        raise refused(
            "tare",
            f" is {tare}: more than half of {recording.title}, which lasts {(last - first) / 1e6:g} s; must be the "
            "seconds at its beginning in which nothing was touched",
        )
    stop = first + int(seconds * 1e6)
    if isinstance(source, Events):
        stop = min([stop, *(t for t, start in source.markers if start and t > first)])
    measured = _measured(recording, stop)
    subject, remedy = f"the beginning of {recording.title}", "give the seconds before it, or a file"
    _warn_of_touch(f"tare is {tare}: {subject}", remedy, source, measured)
    return measured


def tare_of(path: Path, recording: Recording | None = None) -> Tare:
    """Return the tare that a file holds, or the rest of the taxels in a recording in which nothing is touched.

    Parameters
    ----------
    path : Path
        A file that `Tare.save` wrote, which is JSON; else what `taxel.open` opens.
    recording : Recording, optional
        What the tare is for.

    Raises
    ------
    ProblemError : a recording in another unit than the one that the tare is for
    FormatError : neither a tare nor a recording
    FileNotFoundError : no such file
    """
    if not path.exists():
        why = "no such file; seconds are a number with a point, for example 0.5"
        raise FileNotFoundError(ENOENT, why, f"tare: {path}")
    if path.suffix == ".json" or (path.is_file() and path.open("rb").read(64).lstrip().startswith(b"{")):
        return Tare.load(path)
    source = recorded(open_one(path))
    expected = None if recording is None else recorded(recording)
    if isinstance(source, Frames) and isinstance(expected, Frames) and source.unit != expected.unit:
        assert recording is not None
        raise refused(
            "tare", f" is {path}: a recording in {source.unit}; must be in {expected.unit}, as {recording.title} is"
        )
    measured = Tare.take(source, note=str(path))
    _warn_of_touch(f"tare is {path}: it", "cut it (taxel cut) to what is quiet", source, measured)
    return measured


def _warn_of_touch(subject: str, remedy: str, source: Events | Frames, measured: Tare) -> None:
    """Warn of a tare in which something was touched, by which lifts are missed or false."""
    if (taxels := touched(source, measured)) >= TOUCH:
        warn(f"{subject} is not quiet but contains a touch of {taxels} taxels; {remedy}", stacklevel=3)


def _warn_of_offset(recording: Recording, source: Frames, zero: Rest) -> None:
    """Warn of many taxels in a unit of force or pressure that do not rest near 0, or of an object on them."""
    if (found := in_quiet(source)) is None or zero.tare is None:
        return
    stretch_us, begins = found
    load = Readings.of_frames(source).load_in(stretch_us, begins)
    if load is None or load[1]:
        return
    middle = np.nan_to_num(quantile(source.between(*stretch_us).values, 0.5))
    above = _TIMES * zero.tare.noise
    # What is mostly a load that ends later is no rest.
    stays = np.nan_to_num(lowest(source)) > np.maximum(above, _MOSTLY_LOAD * middle)
    off = (middle < -above) | ((middle > above) & stays)
    count = np.count_nonzero(off)
    is_off = count > _MANY * source.array.taxels
    where = "" if is_off else standing(source)
    if not is_off and not where:
        return
    stretch_s = [(t - beginning_us(source.t[:1])) / 1e6 for t in stretch_us]
    stretch = "{:.3f} to {:.3f} s".format(*stretch_s)
    # Of several recordings one number is right for all: the shortest that is quiet.
    option = f"give --tare {_QUIET_S:g} to subtract the values of this stretch"
    if stretch_us[0] > source.t[0]:
        cut = "taxel cut {} rest.npz --from {:.3f} --to {:.3f}".format(quote(str(recording.path)), *stretch_s)
        option = f"give --tare rest.npz to subtract the values of this stretch; to make this file, run: {cut}"
    reads = (
        f"an object is on the sensor from beginning to end, at {where}; if nothing else touches the sensor in {stretch}"
        if where
        else f"{count} of {source.array.taxels} taxels read {middle[off].min():.3g} to {middle[off].max():.3g} "
        f"{source.unit} in a quiet stretch, {stretch}, and not 0; if nothing touches them then"
    )
    warn(f"{recording.path}: {reads}, {option}", stacklevel=3)


def _measured(recording: Recording, stop_us: int, start_us: int | None = None) -> Tare:
    """Return the rest before a time; warn of taxels whose first event is later, which encoders ignore."""
    source = recorded(recording)
    tare = Tare.take(source, start_us=start_us, stop_us=stop_us, note=str(recording.path))
    if isinstance(source, Events):
        present = np.zeros(source.array.shape, bool)
        present[source.y, source.x] = True
        unknown = int(np.count_nonzero(present & np.isnan(tare.rest)))
        if unknown > _MOST_UNKNOWN * np.count_nonzero(present):
            warn(
                f"{recording.path}: the rest of {unknown} of {np.count_nonzero(present)} taxels is not known, because "
                f"none of their changes is in its first {to_ms(stop_us - int(source.t[0])):g} ms: their events are "
                "left "
                "out; start the recording before the board, which then sends all values, or give a tare's file",
                stacklevel=2,
            )
    return tare
