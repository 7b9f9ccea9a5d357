"""Pictures of a recording above rest, and their contact area, peak, sum and centre of pressure over time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.calibration._curves import N_PER_KPA_MM2
from taxel.encode import ContactArea
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.contents import UNKNOWN
from taxel.recording.pictures import period_us
from taxel.recording.recording import Recording

__all__ = ["Series", "above_rest", "readings", "series"]

#: The most pictures of a long recording, as a plot resolves no more points.
MOST_PICTURES = 2000
#: Rate of the pictures of a short recording of events, Hz.
PICTURES_HZ = 100.0
#: Number of values of pictures that are computed at once.
_BLOCK = 1 << 21


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
    centre : float64, shape (n, 2), in `centre_unit`; None of channels
        As of `Frames.centre`.
    centre_unit : {"mm", "taxels", "places"}
        As of `Array.centre_unit`.
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
    force: NDArray[np.float64] | None = None

    @classmethod
    def of(cls, frames: Frames, above: float) -> Series:
        """Return the series of pictures above rest."""
        array = frames.array
        in_mm2 = array.area_mm2 is not None
        area = frames.area(above) if in_mm2 else frames.loaded(above).astype(np.float64)
        centre = None if array.is_channels else frames.centre(above)
        return cls(
            frames.t, frames.unit, above, None if array.is_channels else area, frames.peak(), frames.total(), centre,
            "mm2" if in_mm2 else "taxels", array.centre_unit or "", force_n(frames),
        )  # fmt: skip


def force_n(frames: Frames) -> NDArray[np.float64] | None:
    """Return the force of each picture in kPa, N, from each taxel's area; None in another unit or of unknown area."""
    areas = frames.array.area_mm2
    if frames.unit != "kPa" or areas is None:
        return None
    return np.asarray(np.einsum("nij,ij->n", frames.values, areas, dtype=np.float64) * N_PER_KPA_MM2)


def series(recording: Recording) -> Series | None:
    """Return area, peak, sum and centre of a recording's pictures above rest (`above_rest`); None without intensities.

    For events only taxels with events are computed, a block of pictures at a time: for a large sensor with few events
    no whole picture is in memory.
    """
    if not recording.has_events or recording.calibration is not None:
        result = above_rest(recording)
        return None if result is None else Series.of(*result)
    events = recording.events
    if events.present is None or events.intensity is None or not events.present.any():
        return None
    floor = ContactArea().above
    drawn = _Drawn.of(recording)
    rest = np.full(len(drawn.taxels), np.inf)
    for first, values in drawn.blocks():
        known = drawn.t[first : first + len(values), None] >= drawn.since
        rest = np.minimum(rest, np.min(values, axis=0, where=known, initial=np.inf))
    array, n = events.array, len(drawn.t)
    areas = array.area_mm2
    each = (np.ones(array.shape) if areas is None else areas).reshape(-1)[drawn.taxels]
    area, peak, total, centre = np.zeros(n), np.zeros(n), np.zeros(n), np.full((n, 2), np.nan)
    places = None if array.is_channels else [axis.reshape(-1)[drawn.taxels] for axis in array.positions()]
    for first, values in drawn.blocks():
        over = _core.above_rest(values.reshape(-1), rest).reshape(values.shape)
        loaded = over > np.float64(floor)
        part = slice(first, first + len(values))
        area[part] = np.where(loaded, each, 0.0).sum(axis=1)
        peak[part], total[part] = over.max(axis=1), over.sum(axis=1, dtype=np.float64)
        if places is None:
            continue
        weights = np.where(loaded, over, 0.0).astype(np.float64)
        all_of_them = weights.sum(axis=1)[:, None]
        moments = np.stack([weights @ axis for axis in places], axis=1)
        np.divide(moments, all_of_them, out=centre[part], where=all_of_them > 0)
    of = (area, centre) if places is not None else (None, None)
    unit = "taxels" if areas is None else "mm2"
    return Series(drawn.t, "ticks", floor, of[0], peak, total, of[1], unit, array.centre_unit or "")


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The held values of the taxels with events at the times of pictures, in blocks of pictures."""

    t: NDArray[np.int64]
    #: The indices of the taxels, the time of the first event of each, us, and their held values.
    taxels: NDArray[np.int64]
    since: NDArray[np.int64]
    held: _core.HeldValues

    @classmethod
    def of(cls, recording: Recording) -> _Drawn:
        events = recording.events
        assert events.present is not None and events.intensity is not None  # noqa: PT018  the caller checked
        there = np.flatnonzero(events.present)
        taxels, column = np.unique(events.array.index(events.x[there], events.y[there]), return_inverse=True)
        begins, held = None, recording._contents.held
        if held is not None:
            begins = np.where(held == UNKNOWN, 0, held).reshape(-1)[taxels].astype(np.float32)
        since = np.full(len(taxels), np.iinfo(np.int64).max)
        np.minimum.at(since, column, events.t[there])
        values = _core.HeldValues(events._parts(), taxels.astype(np.uint32), begins)
        return cls(_times(recording), taxels, since, values)

    def blocks(self) -> Iterator[tuple[int, NDArray[np.float32]]]:
        """Yield the number of the first picture of each block, and the held values of the taxels in its pictures."""
        each = max(1, _BLOCK // max(1, len(self.taxels)))
        for first in range(0, len(self.t), each):
            yield first, self.held.at(self.t[first : first + each]).reshape(-1, len(self.taxels))


def _rate_hz(recording: Recording) -> float:
    seconds = recording.events.duration_us / 1e6
    return min(PICTURES_HZ, MOST_PICTURES / seconds) if seconds else PICTURES_HZ


def _times(recording: Recording) -> NDArray[np.int64]:
    """Return the times of the pictures of `Recording.frames`."""
    t = recording.events.t
    first, stop = recording._contents.stretch or (int(t.min()), int(t.max()) + 1)
    return np.arange(first, stop, period_us("rate_hz", _rate_hz(recording)), dtype=np.int64)


def above_rest(recording: Recording) -> tuple[Frames, float] | None:
    """Return pictures of the values above rest, and the threshold of a loaded taxel; None without intensities.

    They are in N or kPa if the recording has a calibration file beside it.

    *Reading*: in a recording of events the rest of a taxel is the lowest value since its first event, and it is loaded
    if it is above its rest by more than the noise floor of the board's fast presets and half a tick, as in
    `taxel.encode.ContactArea`. Files of pictures hold pressure, so the rest is 0.
    """
    read = readings(recording)
    if read is None:
        return None
    frames, rest, floor = read
    if recording.calibration is not None:
        known = recording.calibration.rest is not None
        return recording.calibration.apply(frames, None if known else np.where(np.isinf(rest), np.nan, rest)), 0.0
    if not recording.has_events:
        return frames, 0.0
    return frames._above(rest), floor


def readings(recording: Recording) -> tuple[Frames, NDArray[np.float64], float] | None:
    """Return raw pictures, each taxel's rest, and the threshold of a loaded taxel; None without intensities.

    The rest of a taxel without any event is infinite.
    """
    if not recording.has_events:
        return recording.frames(), np.zeros(recording.array.shape), 0.0
    events = recording.events
    if events.present is None or not events.present.any():
        return None
    frames = recording.frames(_rate_hz(recording))
    known = frames.t[:, None, None] >= _first_event_us(events)
    rest = np.min(frames.values, axis=0, where=known, initial=np.inf).astype(np.float64)
    return frames, rest, ContactArea().above


def _first_event_us(events: Events) -> NDArray[np.int64]:
    """Return the time of each taxel's first event, us; the largest time if there is none."""
    first = np.full(events.array.shape, np.iinfo(np.int64).max)
    there = events.present
    np.minimum.at(first, (events.y[there], events.x[there]), events.t[there])
    return first
