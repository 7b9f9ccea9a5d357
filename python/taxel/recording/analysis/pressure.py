"""Frames of a recording above rest, and their contact area, peak, sum and centre of pressure over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._core import ProblemError
from taxel.array import Array
from taxel.encode import ContactArea
from taxel.frames import Frames
from taxel.recording.analysis.rest import Readings, Rest, held_values, interval, loaded_from, rest
from taxel.recording.frames import FRAMES_HZ, period_us
from taxel.recording.recording import Recording
from taxel.regions import Region
from taxel.tare import Tare

#: The most frames of a long recording of events, as a plot resolves no more points, and the most values of them.
MOST_FRAMES, _MOST_VALUES = 2000, 1 << 27
#: Number of values of frames that are computed at once.
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
    columns : dict from str to float64, shape (n,)
        By name and unit, as ``peak_kPa``: `area` (mm2, or taxels where their area is not known); the largest value,
        `peak`; the `sum` of the loaded taxels, 0 without one, and of all where `above` is 0; `centre_x` and `centre_y`
        (`Array.centre_unit`), NaN in frames without a loaded taxel;
        `force` (N), of pressures whose areas are known. Channels have neither area nor centre.
    rest : Rest
        What was subtracted.
    regions : dict from str to dict from str to float64, shape (n,)
        What loads the whole sensor and each region (`Frames.region`), where regions are given.
    """

    t: NDArray[np.int64]
    unit: str
    above: float
    columns: dict[str, NDArray[np.float64]]
    rest: Rest
    regions: dict[str, dict[str, NDArray[np.float64]]] = field(default_factory=dict)

    @classmethod
    def from_frames(
        cls, frames: Frames, above: float, rest: Rest, regions: Sequence[Region] = (), range_end: float | None = None
    ) -> Series:
        """Return the series of frames above rest, and of the load of regions (`Frames.region`)."""
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

        columns = {f"peak_{frames.unit}": over(Frames.peak), f"sum_{frames.unit}": over(loaded_sum)}
        if not array.is_channels:
            in_mm2 = array.area_mm2 is not None
            area = over(lambda block: block.area(above) if in_mm2 else block.loaded(above).astype(np.float64))
            centre = over(lambda block: block.centre(above))
            columns = {"area_mm2" if in_mm2 else "area_taxels": area, **columns}
            columns |= {f"centre_{axis}_{array.centre_unit}": centre[:, k] for k, axis in enumerate("xy")}
        if frames.unit != "N" and (force := frames.force()) is not None:
            columns["force_N"] = force
        loads = {}
        for region in [_whole(array), *regions] if regions else []:
            of_blocks = [block.region(region, above=above, range_end=range_end) for block in blocks]
            loads[region.name] = {name: np.concatenate([one[name] for one in of_blocks]) for name in of_blocks[0]}
        return cls(frames.t, frames.unit, above, columns, rest, loads)


def _whole(array: Array) -> Region:
    """Return the region of all taxels."""
    return Region("whole", taxels=tuple((int(x), int(y)) for y, x in np.argwhere(array._there())))


def series(
    recording: Recording,
    taken: Rest | None = None,
    regions: Sequence[Region] = (),
    range_end: float | None = None,
) -> Series | None:
    """Return area, peak, sum and centre of a recording's frames above rest (`above_rest`); None without intensities."""
    result = above_rest(recording, taken)
    return None if result is None else Series.from_frames(*result, regions, range_end)


def _frames(recording: Recording) -> Frames:
    """Return frames of held values, at most 100 a second; NaN as of `held_values`."""
    (first, stop), array = interval(recording), recording.array
    taxels, seconds = array.rows * array.columns, recording.events.duration_us / 1e6
    most = max(1, min(MOST_FRAMES, _MOST_VALUES // taxels))
    period = period_us("rate_hz", min(FRAMES_HZ, most / seconds) if seconds else FRAMES_HZ)
    t = np.arange(first, stop, period, dtype=np.int64)
    return Frames(held_values(recording).at(t).reshape(-1, *array.shape), t, unit="ticks", array=array)


def above_rest(recording: Recording, taken: Rest | None = None) -> tuple[Frames, float, Rest] | None:
    """Return frames of the values above rest, the threshold of a loaded taxel, and the rest.

    They are in N or kPa if the recording has a calibration file beside it. None without intensities.

    Parameters
    ----------
    recording : Recording
    taken : Rest, optional
        Default: as of `readings`.

    Notes
    -----
    *Reading*: the rest is a given tare, and that of a zeroed taxel what it was zeroed to; else the calibration's; else
    0 where the unit is one of force or pressure; else that of a quiet stretch, tracked after it
    (`taxel.encode.LocalLoad`); else it is not known: events are then above each taxel's first value, and frames as
    they are. A taxel is loaded if it is above its rest by more than the noise floor of the board's fast presets and
    half a tick, as in `taxel.encode.ContactArea`; in another unit the range of a recording's values counts as 150
    ticks, and six times the noise of the quiet stretch is less than a load; in one of force or pressure that alone.
    """
    read = readings(recording, taken)
    if read is None:
        return None
    frames, taken, floor = read
    array, known = frames.array, taken._values(frames.array)
    if (calibration := recording.calibration) is not None:
        values = calibration._values(np.nan_to_num(frames.values), known.reshape(array.shape))
        return Frames(values, frames.t, unit=calibration.unit, array=array), 0.0, taken
    if not recording.has_events and taken.source in ("unit", "none"):
        return frames, floor, taken
    values = frames.values.reshape(len(frames), known.size)
    if taken.source in ("quiet", "none"):
        blocks = Readings.of_frames(frames)
        parts = [part for _, part in blocks.above(blocks.tracked(known))]
        above = np.concatenate([np.empty((0, known.size)), *parts])
    else:
        above = _core.above_rest(np.nan_to_num(values).reshape(-1), np.where(np.isnan(known), np.inf, known))
        above = above.reshape(values.shape)
    for zeroed in recording.zeroings:
        later, taxel = frames.t >= zeroed.t, zeroed.y * array.columns + zeroed.x
        above[later, taxel] = np.maximum(np.nan_to_num(values[later, taxel] - np.float32(zeroed.rest)), 0)
    return Frames(above.reshape(-1, *array.shape), frames.t, unit=frames.unit, array=array), floor, taken


def readings(recording: Recording, taken: Rest | None = None) -> tuple[Frames, Rest, float] | None:
    """Return raw frames, their rest, and the threshold of a loaded taxel; None without intensities.

    A taxel has NaN before its first event. The rest is by default the calibration's, else as of `rest`.
    """
    if recording.has_events and (recording.events.present is None or not recording.events.present.any()):
        return None
    if taken is None:
        of_calibration = None if recording.calibration is None else recording.calibration.rest
        taken = (
            rest(recording)
            if of_calibration is None
            else Rest("calibration", Tare._of(recording.array, of_calibration, "the calibration's"))
        )
    if taken.tare is not None and taken.tare.array.shape != recording.array.shape:
        measured, stated = (f"{rows} x {columns}" for rows, columns in (taken.tare.array.shape, recording.array.shape))
        raise ProblemError(f"the tare has {measured} taxels, {recording.path} has {stated}")
    if recording.has_events:
        return _frames(recording), taken, ContactArea().above
    frames = recording.frames()
    return frames, taken, loaded_from(frames, taken)
