"""Frames of a recording above rest, and their contact area, peak, sum and centre of pressure over time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.array import Array
from taxel.calibration._curves import N_PER_KPA_MM2
from taxel.encode import ContactArea
from taxel.frames import Frames
from taxel.recording.analysis.rest import (
    FrameBlock,
    Rest,
    find_rest,
    flickering,
    frames_above,
    loaded_from,
    of_frames,
    rest_scale,
)
from taxel.recording.frames import FRAMES_HZ, period_us
from taxel.recording.recording import Recording
from taxel.tare import Tare

#: The most frames of a long recording, as a plot resolves no more points.
MOST_FRAMES = 2000
#: Number of values of frames that are computed at once.
_BLOCK = 1 << 21
#: The rest of events is tracked this often, us, and so many times make a stretch that may be quiet.
_TRACKED_US, _STRETCH = 50_000, 10
#: In silence, where nothing changes, the rest is tracked so many times, and then after each further one in so many of
#: it: a wrong time stamp may make it one of years.
_IN_SILENCE = 64
#: Largest rectangle around the taxels with events whose rest is tracked with regard to neighbours.
_MOST_PLACES = 1 << 18


@dataclass(frozen=True, eq=False)
class Series:
    """Hold the pressure of a recording over time.

    Parameters
    ----------
    t : int64, shape (n,), us
    unit : str
    above : float
        The value above which a taxel counts as loaded, in `unit`.
    area : float64, shape (n,), mm2 or taxels; None of channels
    area_unit : {"mm2", "taxels"}
        "taxels", a number of taxels, if their area is not known.
    peak, total : float64, shape (n,), in `unit`
        The largest value, and the sum of the loaded taxels, 0 without one; of all where `above` is 0.
    centre : float64, shape (n, 2), in `centre_unit`; None of channels
        As of `Frames.centre`; NaN in frames above the rest of a quiet stretch whose sum is one that noise adds up to.
    centre_unit : {"mm", "taxels", "places"}
        As of `Array.centre_unit`.
    rest : Rest
        What was subtracted.
    force : float64, shape (n,), N
        Of values in kPa, if the area of each taxel is known.
    """

    t: NDArray[np.int64]
    unit: str
    above: float
    area: NDArray[np.float64] | None
    peak: NDArray[np.float64]
    total: NDArray[np.float64]
    centre: NDArray[np.float64] | None
    area_unit: str
    centre_unit: str
    rest: Rest
    force: NDArray[np.float64] | None = None

    @classmethod
    def from_frames(cls, frames: Frames, above: float, rest: Rest) -> Series:
        """Return the series of frames above rest."""
        array = frames.array
        block = max(1, _BLOCK // max(1, array.rows * array.columns))
        # A block at a time, because the centre's weights have 64 bits.
        blocks = [frames[k : k + block] for k in range(0, len(frames), block)] or [frames]

        def over(measure: Callable[[Frames], NDArray[np.float64]]) -> NDArray[np.float64]:
            return np.concatenate([measure(block) for block in blocks])

        def loaded_sum(block: Frames) -> NDArray[np.float64]:
            # Where no noise is cut off, values below 0 cancel that above; a sum of forces is that of all taxels.
            is_cut_off = above > 0 and rest.source != "unit"
            values = np.where(block._loaded(above), block.values, 0.0) if is_cut_off else block.values
            return np.asarray(values.sum(axis=(1, 2), dtype=np.float64))

        in_mm2 = array.area_mm2 is not None
        area = over(lambda block: block.area(above) if in_mm2 else block.loaded(above).astype(np.float64))
        centre, total = None if array.is_channels else over(lambda block: block.centre(above)), over(loaded_sum)
        if centre is not None and rest.source == "quiet" and len(frames):
            centre[total <= _core.frame_noise(frames.t, total, above)] = np.nan
        return cls(
            frames.t, frames.unit, above, None if array.is_channels else area, over(Frames.peak), total,
            centre, "mm2" if in_mm2 else "taxels", array.centre_unit or "", rest, force_n(frames),
        )  # fmt: skip


def force_n(frames: Frames) -> NDArray[np.float64] | None:
    """Return the force of each frame in kPa, N, from each taxel's area; None in another unit or of unknown area."""
    areas = frames.array.area_mm2
    if frames.unit != "kPa" or areas is None:
        return None
    return np.asarray(np.einsum("nij,ij->n", frames.values, areas, dtype=np.float64) * N_PER_KPA_MM2)


def series(recording: Recording, tare: Tare | None = None) -> Series | None:
    """Return area, peak, sum and centre of a recording's frames above rest (`above_rest`); None without intensities.

    Taxels of frames that flicker (`flickering`) count as 0. For events only taxels with events are computed, a block of
    frames at a time: for a large sensor with few events no whole frame is in memory.
    """
    if not recording.has_events or recording.calibration is not None:
        result = above_rest(recording, tare)
        if result is None or recording.has_events:
            return None if result is None else Series.from_frames(*result)
        frames, above, rest = result
        # As on the page, a taxel that jumps alone for single frames is no load.
        values = np.where(flickering(recording.frames()), np.float32(0), frames.values)
        return Series.from_frames(Frames(values, frames.t, unit=frames.unit, array=frames.array), above, rest)
    events = recording.events
    if events.present is None or events.intensity is None or not events.present.any():
        return None
    drawn = _Drawn.from_recording(recording)
    return _series_of(drawn, _rest_of(recording, drawn, tare), events.array)


def _series_of(drawn: _Drawn, rest: Rest, array: Array) -> Series:
    floor = ContactArea().above
    n, areas = len(drawn.t), drawn.areas(array)
    area, peak, total, centre = np.zeros(n), np.zeros(n), np.zeros(n), np.full((n, 2), np.nan)
    places = None if array.is_channels else [axis.reshape(-1)[drawn.taxels] for axis in array.positions()]
    for first, over in drawn.above(rest):
        loaded = over > np.float64(floor)
        rows = slice(first, first + len(over))
        area[rows] = np.where(loaded, areas, 0.0).sum(axis=1)
        weights = np.where(loaded, over, 0.0).astype(np.float64)
        peak[rows], total[rows] = over.max(axis=1), weights.sum(axis=1)
        if places is None:
            continue
        all_of_them = total[rows, None]
        moments = np.stack([weights @ axis for axis in places], axis=1)
        np.divide(moments, all_of_them, out=centre[rows], where=all_of_them > 0)
    not_of_channels = (area, centre) if places is not None else (None, None)
    unit = "taxels" if array.area_mm2 is None else "mm2"
    return Series(
        drawn.t,
        "ticks",
        floor,
        not_of_channels[0],
        peak,
        total,
        not_of_channels[1],
        unit,
        array.centre_unit or "",
        rest,
    )


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The held values of the taxels with events, in blocks of frames."""

    #: Times of the frames, us.
    t: NDArray[np.int64]
    #: The indices of the taxels, the time from which the value of each is known, us, and their held values.
    taxels: NDArray[np.int64]
    since: NDArray[np.int64]
    held: _core.HeldValues
    #: Times of events, us: of each `_TRACKED_US` with any, the first.
    changed: NDArray[np.int64]
    #: The place of each taxel in the rectangle around them, and that one's shape.
    places: NDArray[np.int64]
    box: tuple[int, int]
    #: Row and column of the rectangle's first taxel.
    corner: tuple[int, int]
    #: Place, time (us) and rest of the taxels that were zeroed.
    zeroed: tuple[tuple[int, int, float], ...]

    @classmethod
    def from_recording(cls, recording: Recording) -> _Drawn:
        events = recording.events
        assert events.present is not None and events.intensity is not None  # noqa: PT018  the caller checked
        present = np.flatnonzero(events.present)
        taxels, column = np.unique(events.array.index(events.x[present], events.y[present]), return_inverse=True)
        since = np.full(len(taxels), np.iinfo(np.int64).max)
        np.minimum.at(since, column, events.t[present])
        begins, held = None, recording.held
        if held is not None:
            known = ~np.isnan(held.reshape(-1)[taxels])
            begins = np.nan_to_num(held.reshape(-1)[taxels])
            since[known] = np.iinfo(np.int64).min
        values = _core.HeldValues(events._parts(), taxels.astype(np.uint32), begins)
        y, x = np.divmod(taxels, events.array.columns)
        rows, columns, corner = int(np.ptp(y)) + 1, int(np.ptp(x)) + 1, (int(y.min()), int(x.min()))
        if rows * columns > _MOST_PLACES:
            places, rows, columns = np.arange(len(taxels)), 1, len(taxels)
        else:
            places = (y - y.min()) * columns + x - x.min()
        column_of = {int(taxel): k for k, taxel in enumerate(taxels)}
        zeroings = [(column_of.get(z.y * events.array.columns + z.x), z.t, z.rest) for z in recording.zeroings]
        zeroed = tuple((k, t, rest) for k, t, rest in zeroings if k is not None)
        steps = events.t // _TRACKED_US
        changed = events.t[np.diff(steps, prepend=steps[0] - 1) != 0]
        return cls(_times(recording), taxels, since, values, changed, places, (rows, columns), corner, zeroed)

    def areas(self, array: Array) -> NDArray[np.float64]:
        """Return the area of each of the taxels, mm2; 1 each where it is not known."""
        areas = array.area_mm2
        return np.asarray((np.ones(array.shape) if areas is None else areas).reshape(-1)[self.taxels], np.float64)

    @cached_property
    def sampled(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The times at which values are read: the frames', and those at which the rest is tracked.

        With each comes the number of times that it stands for, among the frames' and among all multiples of
        `_TRACKED_US`.
        """
        if not len(self.t):
            return self.t, self.t
        first, last = self.t[0], self.t[-1]
        count = -((first - last) // _TRACKED_US)
        changed = (self.changed - first) // _TRACKED_US
        steps = np.union1d(changed[(changed > 0) & (changed < count)], np.arange(min(1, count)))
        until = np.append(steps, count)[1:]
        since = list(range(_IN_SILENCE + 1))
        while since[-1] < count:
            since.append(since[-1] + since[-1] // _IN_SILENCE)
        many = np.searchsorted(since, until - steps)
        number = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
        grid = np.repeat(steps, many) + np.array(since)[number]
        # Stretches begin and end where they would with all times: in silence, around frames, and where events begin.
        later = number >= _IN_SILENCE
        grid[later] -= grid[later] % _STRETCH
        around = np.unique((self.t - first) // (_STRETCH * _TRACKED_US))[:, None] * _STRETCH + [0, _STRETCH]
        ends = until[until - steps > _IN_SILENCE, None] // _STRETCH * _STRETCH + np.arange(_STRETCH)
        grid = np.concatenate([grid, around[around < count], ends[ends < count]])
        times = np.union1d(self.t, first + grid * _TRACKED_US)
        begins = -((first - times) // _TRACKED_US)
        is_multiple = (first + begins * _TRACKED_US == times) & (times < last)
        return times, np.diff(begins, append=count) + ~is_multiple

    def blocks(self) -> Iterator[tuple[NDArray[np.bool_], FrameBlock]]:
        """Yield the held values in the rectangle, at the frames' times and often enough between them.

        A mask shows which of them are frames.
        """
        times, _ = self.sampled
        shown = np.isin(times, self.t)
        size = self.box[0] * self.box[1]
        block = max(1, _BLOCK // max(1, size))
        for first in range(0, len(times), block):
            t = times[first : first + block]
            held = self.held.at(t).reshape(-1, len(self.taxels))
            values = np.full((len(t), size), np.nan, np.float32)
            values[:, self.places] = np.where(t[:, None] >= self.since, held, np.float32(np.nan))
            yield shown[first : first + block], (t, values)

    def found(self) -> Rest:
        """Return the rest that a quiet stretch shows; its values are those of the taxels with events."""
        size, blocks = self.box[0] * self.box[1], lambda: (block for _, block in self.blocks())
        rest = find_rest(blocks, size, self.box[1], corner=self.corner, stands_for=self.sampled[1])
        preload = None if rest.preload is None else rest.preload[self.places]
        # A board's comparators are turned by its register, not by a layout file.
        return replace(rest, values=rest.values[self.places], preload=preload, falls=False)

    def above(self, rest: Rest) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """Yield the number of the first frame of each block, and the values of the taxels above rest."""
        kept: deque[tuple[NDArray[np.bool_], FrameBlock]] = deque()

        def read() -> Iterator[FrameBlock]:
            for block in self.blocks():
                kept.append(block)
                yield block[1]

        everywhere = np.full(self.box[0] * self.box[1], np.nan)
        everywhere[self.places] = rest.values
        first = 0
        for t, over in _above(replace(rest, values=everywhere), read(), self.box[1]):
            shown, (_, values) = kept.popleft()
            for k, since, zero in self.zeroed:
                column, later = self.places[k], t >= since
                over[later, column] = np.maximum(np.nan_to_num(values[later, column] - np.float32(zero)), 0)
            yield first, over[shown][:, self.places]
            first += int(np.count_nonzero(shown))

    def frames(self, rest: Rest, array: Array) -> NDArray[np.float32]:
        """Return the frames above rest, shape (n, rows, columns); 0 of taxels without events."""
        shown = np.zeros((len(self.t), array.rows * array.columns), np.float32)
        for first, over in self.above(rest):
            shown[first : first + len(over), self.taxels] = over
        return shown.reshape(-1, *array.shape)


def _above(rest: Rest, blocks: Iterable[FrameBlock], columns: int, scale: float = 1.0) -> Iterable[FrameBlock]:
    """Yield frames above a rest: tracked where none is given; 0 where a value or its rest is not known."""
    if rest.source in ("quiet", "none"):
        yield from frames_above(rest, blocks, columns, scale)
        return
    known = np.where(np.isnan(rest.values), np.inf, rest.values)
    for t, values in blocks:
        yield t, _core.above_rest(np.nan_to_num(values).reshape(-1), known).reshape(values.shape)


def _rate_hz(recording: Recording) -> float:
    seconds = recording.events.duration_us / 1e6
    return min(FRAMES_HZ, MOST_FRAMES / seconds) if seconds else FRAMES_HZ


def _times(recording: Recording) -> NDArray[np.int64]:
    """Return the times of the frames of `Recording.frames`."""
    t = recording.events.t
    first, stop = recording.interval or (int(t.min()), int(t.max()) + 1)
    return np.arange(first, stop, period_us("rate_hz", _rate_hz(recording)), dtype=np.int64)


def above_rest(recording: Recording, tare: Tare | None = None) -> tuple[Frames, float, Rest] | None:
    """Return frames of the values above rest, the threshold of a loaded taxel, and the rest.

    They are in N or kPa if the recording has a calibration file beside it. None without intensities.

    Parameters
    ----------
    recording : Recording
    tare : Tare, optional
        The rest as it was measured.

    Notes
    -----
    *Reading*: the rest is a given tare, and that of a zeroed taxel what it was zeroed to; else the calibration's; else
    0 where the unit is one of force or pressure; else that of a quiet stretch, tracked after it
    (`taxel.encode.LocalLoad`); else it is not known: events are then above each taxel's first value, and frames as
    they are. A taxel is loaded if it is above its rest by more than the noise floor of the board's fast presets and
    half a tick, as in `taxel.encode.ContactArea`; in another unit the range of a recording's values counts as 150
    ticks; in one of force or pressure by more than six times the noise of a quiet stretch, or than 0 without one.
    """
    read = readings(recording, tare)
    if read is None:
        return None
    frames, rest, floor = read
    if recording.calibration is not None:
        calibration, values = recording.calibration, rest.values.reshape(frames.array.shape)
        return (
            Frames(calibration._values(frames.values, values), frames.t, unit=calibration.unit, array=frames.array),
            0.0,
            rest,
        )
    if recording.has_events:
        drawn = _Drawn.from_recording(recording)
        shown = drawn.frames(replace(rest, values=rest.values.reshape(-1)[drawn.taxels]), frames.array)
    elif rest.source in ("unit", "none"):
        return frames, floor, rest
    else:
        blocks = [(frames.t, frames.values.reshape(len(frames), frames.array.rows * frames.array.columns))]
        [(_, shown)] = _above(rest, blocks, frames.array.columns, rest_scale(frames))
    shape = len(frames), *frames.array.shape
    return Frames(shown.reshape(shape), frames.t, unit=frames.unit, array=frames.array), floor, rest


def quiet_rest(recording: Recording) -> Rest | None:
    """Return the rest that a quiet stretch of a board's events shows, on their held values; None without intensities.

    Its values are those of the taxels with events.
    """
    present = recording.events.present
    return None if present is None or not present.any() else _Drawn.from_recording(recording).found()


def readings(recording: Recording, tare: Tare | None = None) -> tuple[Frames, Rest, float] | None:
    """Return raw frames, the rest of each taxel, and the threshold of a loaded taxel; None without intensities.

    The rest is as of `above_rest`, but that of a quiet stretch as it was there.
    """
    if not recording.has_events:
        frames = recording.frames()
        rest = _measured(recording, tare) or of_frames(frames)
        return frames, rest, loaded_from(frames, rest)
    events = recording.events
    if events.present is None or not events.present.any():
        return None
    drawn = _Drawn.from_recording(recording)
    rest, values, preload = _rest_of(recording, drawn, tare), np.full(events.array.shape, np.nan), None
    values.reshape(-1)[drawn.taxels] = rest.values
    if rest.preload is not None:
        preload = np.zeros(values.size)
        preload[drawn.taxels] = rest.preload
    raw = recording.frames(_rate_hz(recording))
    return raw, replace(rest, values=values.reshape(-1), preload=preload), ContactArea().above


def _rest_of(recording: Recording, drawn: _Drawn, tare: Tare | None) -> Rest:
    """Return the rest of the taxels with events, in their order."""
    measured = _measured(recording, tare)
    rest = drawn.found() if measured is None else replace(measured, values=measured.values[drawn.taxels])
    return replace(rest, zeroed=len({k for k, *_ in drawn.zeroed}))


def _measured(recording: Recording, tare: Tare | None) -> Rest | None:
    """Return the measured rest; NaN where a taxel has none."""
    if tare is not None:
        if tare.array.shape != recording.array.shape:
            measured, stated = (f"{rows} x {columns}" for rows, columns in (tare.array.shape, recording.array.shape))
            raise ProblemError(f"the tare has {measured} taxels, {recording.path} has {stated}")
        return Rest("tare", tare.rest.reshape(-1))
    calibration = recording.calibration
    if calibration is None or calibration.rest is None:
        return None
    return Rest("calibration", calibration.rest.reshape(-1))
