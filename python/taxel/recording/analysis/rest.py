"""The rest of a recording's taxels: what they read while nothing touches them, and where that is known from."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.messages import counted
from taxel._base.times import beginning_us
from taxel.formats.event_camera import are_counts
from taxel.formats.layout import or_given
from taxel.frames import Frames
from taxel.tare import Tare

#: Units of force and pressure: an unloaded taxel reads 0 in them.
FORCE_UNITS = _core.FORCE_UNITS
#: The note of a tare that was not measured.
BY_UNIT = "0, by the unit"
#: Reading: a noise floor is so many standard deviations of the noise, so that two neighbours rarely exceed it together,
#: and its noise is what this share of the taxels has at most: of the others some may be bad.
TIMES_NOISE, SHARE = 6.0, 0.9
#: Reading: the noise floor of the board's fast presets, ticks ...
NOISE_FLOOR = 3.0
#: ... in another unit, the range of a recording's values counts as so many ticks.
RANGE_TICKS = 150.0

#: ... but counts of events are chance up to so many more than standard deviations of them, in this share of the frames.
_BY_CHANCE, _QUIET_SHARE = 2.0, 0.75

#: Reading: what a taxel reads in a quiet stretch is not its rest, but a load that stood still, if in more than this
#: share of all frames it reads less by so many ticks.
LOADED_SHARE, LOADED_TICKS = 0.1, _core.LOADED_TICKS
#: Values fall from a rest if they go so many times as far below it as above it, in the taxel that does so third most:
#: bad taxels move alone or in pairs. In ...
_FALLS, _THIRD = 3.0, 3
#: ... a smaller array the first counts.
_SMALL = 9
#: So many frames or fewer give a taxel's median, and what it reads in all but this share of them.
_MEDIAN_OF, _LOWEST = 2000, 0.05

#: Values in a block of frames.
_BLOCK = 1 << 16

#: Frames in order: their times, us, and their values by taxel, NaN where a taxel has none.
FrameBlock = tuple[NDArray[np.int64], NDArray[np.float32]]

T = TypeVar("T")


def _once(find: Callable[[Frames], T]) -> Callable[[Frames], T]:
    """Return a costly function of frames that computes each result once."""

    @wraps(find)
    def found(frames: Frames) -> T:
        known: dict[str, T] = frames._found
        if find.__name__ not in known:
            known[find.__name__] = find(frames)
        return known[find.__name__]

    return found


@dataclass(frozen=True, eq=False)
class Rest:
    """Hold what taxels read at rest, and where it is known from.

    Parameters
    ----------
    source : {"tare", "calibration", "unit", "quiet", "none"}
        A given tare; the calibration's own rest; 0, because the values are force or pressure; a quiet stretch; nothing.
    values : float64, one per taxel, in the sensor's unit
        NaN for a taxel whose rest is not known. That of a quiet stretch is where the rest is tracked from.
    quiet_us : (int, int), us, optional
        The quiet stretch.
    begin_us : int, us
        The time that text counts the quiet stretch from (`taxel._base.times`).
    zeroed : int
        Number of taxels that were zeroed while recording: after that their rest is the given value.
    falls : bool
        Whether values of frames go further below the rest of a quiet stretch than above it, and come back: less may
        mean more pressure.
    preload : float64, one per taxel, in the sensor's unit, optional
        Of a grid: how much more than at rest a taxel read in the quiet stretch, where something lay on it then and was
        taken away; 0 elsewhere.
    preload_at : str
        Where that was, for people; empty where nothing lay there.
    """

    source: str
    values: NDArray[np.float64]
    quiet_us: tuple[int, int] | None = None
    begin_us: int = 0
    zeroed: int = 0
    falls: bool = False
    preload: NDArray[np.float64] | None = None
    preload_at: str = ""

    def __str__(self) -> str:
        """Return the line of ``taxel info``."""
        return self.text()

    def text(self, path: Path | None = None, turned: float | None = None) -> str:
        """Return the line of ``taxel info``; `path` is the recording's, `turned` what its values were turned by."""
        words = {
            "tare": "the given tare",
            "calibration": "the calibration's",
            "unit": "0, because the values are force or pressure",
            "none": "unknown, because no stretch of half a second and four values was quiet and without load; "
            "to set the rest, give a tare",
        }
        text = words.get(self.source, "")
        if self.quiet_us is not None:
            first, end = ((us - self.begin_us) / 1e6 for us in self.quiet_us)
            text = f"that of a quiet stretch, {first:.3f} to {end:.3f} s; later the rest follows slow changes"
            text += f"; something was on {self.preload_at} during this stretch" * bool(self.preload_at)
        if self.falls and turned is not None:
            text += "; values fall from their rest after a layout inverted them: if the values need no inversion, "
            text += "remove the line 'falls = ...' from it"
        elif self.falls:
            where = "" if path is None else f", {or_given(path)}"
            text += "; values fall from their rest: if smaller values mean more pressure, write falls = true in a "
            text += f"layout file{where}"
        return text + f"; {counted(self.zeroed, 'taxel')} zeroed" * bool(self.zeroed)

    def described(self) -> dict[str, object]:
        """Return source, quiet stretch, number of zeroed taxels and whether values fall, as JSON values."""
        return {"source": self.source, "quiet_us": self.quiet_us, "zeroed": self.zeroed, "falls": self.falls}


@_once
def by_unit(frames: Frames) -> Tare | None:
    """Return the tare of frames in a unit of force or pressure: 0, with the noise of a quiet stretch; None of others.

    The noise of a taxel is 1.4826 times how much the third quartile of what it reads there is above the median: the
    standard deviation of normal noise, also where a sensor cuts off what is below 0, and in a stretch of which less
    than a quarter is a press. 0 where none is quiet, and of a taxel without a value.
    """
    if frames.unit not in FORCE_UNITS or not len(frames):
        return None
    quiet = _of_rising(frames).quiet_us
    still = np.zeros((1, *frames.array.shape)) if quiet is None else frames.between(*quiet).values
    middle, above = quantile(np.where(np.isnan(still).all(axis=0), 0.0, still), (0.5, 0.75))
    noise = 1.4826 * np.asarray(above - middle, np.float64)
    nothing = Frames(np.zeros((2, *frames.array.shape)), [0, 1], unit=frames.unit, array=frames.array)
    return Tare.take(nothing, note=BY_UNIT)._with(noise=noise.reshape(-1).tolist())


def loaded_from(frames: Frames, rest: Rest) -> float:
    """Return from how much above its rest on a taxel of frames counts as loaded, in their unit.

    Of force and pressure that is more than the noise of a quiet stretch, or than 0 without one; of a rest that a quiet
    stretch shows, more than the noise floor of the board; of any other rest, more than 0.
    """
    if rest.source == "unit" and (tare := by_unit(frames)) is not None:
        return TIMES_NOISE * float(np.quantile(tare.noise, SHARE))
    if rest.source != "quiet":
        return 0.0
    return float(_core.touched_above(NOISE_FLOOR)) / rest_scale(frames)


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


@_once
def ticks_by_unit(frames: Frames) -> float:
    """Return the ticks by the unit of frames: the range of their values counts as that of a board's ramp."""
    if frames.unit == "ticks":
        return 1.0
    least, most = extremes(frames)
    span = float(np.fmax.reduce(most, axis=None, initial=np.nan)) - float(
        np.fmin.reduce(least, axis=None, initial=np.nan)
    )
    return RANGE_TICKS / span if span > 0 else 1.0


@_once
def extremes(frames: Frames) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return each taxel's least and greatest value, NaN for one without any."""
    least, most = (reduction.reduce(frames.values, axis=0, initial=np.nan) for reduction in (np.fmin, np.fmax))
    return least, most


def find_rest(
    blocks: Callable[[], Iterable[FrameBlock]],
    taxels: int,
    columns: int,
    scale: float = 1.0,
    *,
    falls: bool = False,
) -> Rest:
    """Return the rest that a quiet stretch of frames shows (`_core.TrackedRest`), or none.

    Parameters
    ----------
    blocks : function
        Returns the frames in order, each time it is called.
    taxels, columns : int
    scale : float
        Ticks by the sensor's unit.
    falls : bool
        Whether values fall from the rest with pressure.
    """
    rest = _core.TrackedRest(columns, NOISE_FLOOR, np.full(taxels, np.nan), falls)
    begin_us = None
    for t, values in blocks():
        begin_us = beginning_us(t) if begin_us is None else begin_us
        rest.above(t, np.ascontiguousarray(values * np.float32(scale)).reshape(-1))
    unknown = np.full(taxels, np.nan)
    if rest.quiet is None:
        return Rest("none", unknown)
    begins, known = rest.begins / scale, np.zeros(taxels, np.int64)
    released, less, quiet, in_quiet = known.copy(), np.zeros(taxels), np.zeros(taxels), known.copy()
    for t, values in blocks():
        load = begins - values if falls else values - begins
        far = load < -LOADED_TICKS / scale
        released += far.sum(axis=0)
        less -= np.where(far, load, 0.0).sum(axis=0)
        known += np.count_nonzero(~np.isnan(load), axis=0)
        within = load[slice(*np.searchsorted(t, rest.quiet))]
        quiet += np.nan_to_num(within).sum(axis=0)
        in_quiet += np.count_nonzero(~np.isnan(within), axis=0)
    loaded = released > LOADED_SHARE * known
    begins[loaded] = np.nan
    if np.isnan(begins).all():
        return Rest("none", unknown)
    loads = quiet / np.maximum(in_quiet, 1) + np.where(loaded, less / np.maximum(released, 1), 0.0)
    preload, where = _core.preload(np.where(known > 0, loads, np.nan), columns, LOADED_TICKS / scale, (0, 0))
    return Rest("quiet", begins, rest.quiet, begin_us or 0, falls=falls, preload=preload, preload_at=where)


def of_frames(frames: Frames) -> Rest:
    """Return the rest of frames without a tare: 0 of force or pressure, else what a quiet stretch shows, or none."""
    if frames.unit in FORCE_UNITS:
        return Rest("unit", np.zeros(frames.array.rows * frames.array.columns))
    return of_quiet(frames)


def quantile(values: NDArray[np.float32], shares: float | tuple[float, ...]) -> NDArray[np.float64]:
    """Return quantiles over frames, without missing values; NumPy takes far longer to look for these."""
    find = np.nanquantile if np.isnan(values.min(initial=0.0)) else np.quantile
    return np.asarray(find(values, shares, axis=0))


def standing(frames: Frames) -> str:
    """Return on which taxels of a grid, in a unit of force, an object is from beginning to end; "" if none is.

    They read more than 0 in nearly all frames, by more than the rest of any recording may be off.
    """
    if frames.unit not in FORCE_UNITS or min(frames.array.shape) == 1 or not len(frames):
        return ""
    lowest = quantile(frames.values[:: 1 + len(frames) // _MEDIAN_OF], _LOWEST).reshape(-1)
    above = LOADED_TICKS / ticks_by_unit(frames)
    _, where = _core.preload(lowest.astype(np.float64), frames.array.columns, above, (0, 0))
    return where.replace(" above rest", f" {frames.unit} in every frame")


@_once
def of_quiet(frames: Frames) -> Rest:
    """Return the rest of frames that a quiet stretch of them shows, or none."""
    rest = _of_rising(frames)
    if rest.quiet_us is None or not _fall(frames, rest.quiet_us, rest_scale(frames)):
        return rest
    fallen = _found_in(frames, falls=True)
    # Without a rest of their own the values are tracked from their first ones on. What they rise by is no load.
    return replace(rest, values=fallen.values, falls=True, preload=None, preload_at="")


@_once
def _of_rising(frames: Frames) -> Rest:
    """Return the rest that a quiet stretch of frames shows if their values rise with pressure."""
    return _found_in(frames, falls=False)


def _found_in(frames: Frames, *, falls: bool) -> Rest:
    blocks, columns = _blocks(frames), frames.array.columns
    return find_rest(lambda: blocks, frames.array.rows * columns, columns, rest_scale(frames), falls=falls)


def _blocks(frames: Frames) -> list[FrameBlock]:
    """Return frames in blocks that a processor's cache holds."""
    taxels = frames.array.rows * frames.array.columns
    values, block = frames.values.reshape(len(frames), taxels), max(1, _BLOCK // max(1, taxels))
    return [(frames.t[k : k + block], values[k : k + block]) for k in range(0, len(frames), block)]


def _fall(frames: Frames, quiet_us: tuple[int, int], scale: float) -> bool:
    """Return whether values go further below their rest than above it, and come back.

    The rest is here that of the quiet stretch itself: a tracked one follows values that fall and stay for a while. A
    taxel that is loaded half of the time or more has its lower one; one that never comes back was loaded before.
    """
    values = frames.held().values.reshape(len(frames), -1)
    first, end = np.searchsorted(frames.t, quiet_us)
    rest = np.median(values[:: 1 + len(values) // _MEDIAN_OF], axis=0)
    rest = np.minimum(rest, values[first:end].mean(axis=0, dtype=np.float64))
    lowest = values.min(axis=0)
    down, up = rest - lowest, values.max(axis=0) - rest
    rank = _THIRD if down.size >= _SMALL else 1
    far = max(_FALLS * np.partition(up, -rank)[-rank], 2 * LOADED_TICKS / scale)
    fallen = np.flatnonzero(down > far)
    if len(fallen) < rank:
        return False
    series = values[:, fallen].T
    back = np.array([each[k:].max() for each, k in zip(series, series.argmin(axis=1), strict=True)])
    return int(np.count_nonzero(back >= (rest - down / _FALLS)[fallen])) >= rank


def frames_above(rest: Rest, blocks: Iterable[FrameBlock], columns: int, scale: float = 1.0) -> Iterable[FrameBlock]:
    """Yield frames above a rest that is tracked, from a quiet stretch or from the first values; 0 below it."""
    at = _core.TrackedRest(columns, NOISE_FLOOR, rest.values * scale, rest.falls)
    for t, values in blocks:
        above = at.above(t, np.ascontiguousarray(values * np.float32(scale)).reshape(-1))
        yield t, above.reshape(values.shape) / np.float32(scale)
