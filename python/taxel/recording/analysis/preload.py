"""The tare of a recording that began with something on the array, which was taken away later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording.analysis.pressure import readings
from taxel.recording.analysis.rest import FORCE_UNITS, LOADED_TICKS, Rest, of_quiet, quantile, ticks_by_unit
from taxel.recording.recording import Recording

#: What lies on an array all the time is in all but this share of the frames, of so many.
_LOWEST, _FRAMES = 0.05, 2000


def free_of_preload(recording: Recording, rest: Rest) -> tuple[tuple[int, int] | None, str]:
    """Return a quiet stretch, us, without what lay on the array in that of a rest, and the line that says so.

    Without one it is that of the rest.
    """
    source = recorded(recording)
    read = (source,) if isinstance(source, Frames) else readings(recording)
    assert read is not None  # a rest is of values
    free = _free(read[0], rest)
    span = _later(read[0], free) if len(free) else None
    return rest.quiet_us if span is None else span, _line(recording, rest, found=span is not None)


def standing(frames: Frames) -> str:
    """Return on which taxels of a grid, in a unit of force, an object is from beginning to end; "" if none is.

    They read more than 0 in nearly all frames, by more than the rest of any recording may be off.
    """
    if frames.unit not in FORCE_UNITS or min(frames.array.shape) == 1 or not len(frames):
        return ""
    lowest = quantile(frames.values[:: 1 + len(frames) // _FRAMES], _LOWEST).reshape(-1)
    above = LOADED_TICKS / ticks_by_unit(frames)
    _, where = _core.preload(lowest.astype(np.float64), frames.array.columns, above, (0, 0))
    return where.replace(" above rest", f" {frames.unit} in every frame")


def _line(recording: Recording, rest: Rest, *, found: bool) -> str:
    """Return the line on a tare beside a rest with something on the array, where a time without it was found or not."""
    without = "so the tare is measured at a time when nothing was on the sensor"
    lacks = "and no other rest was found, so the tare contains this load; give a file of a tare"
    return f"{recording.path}: the rest is {rest}, {without if found else lacks}"


def _free(frames: Frames, rest: Rest) -> NDArray[np.int64]:
    """Return the numbers of the frames without what lay on the array in the quiet stretch of a rest."""
    assert rest.quiet_us is not None
    assert rest.preload is not None
    is_loaded = rest.preload > 0
    values = frames.values.reshape(len(frames), -1)[:, is_loaded]
    quiet = values[slice(*np.searchsorted(frames.t, rest.quiet_us))].mean(axis=0, dtype=np.float64)
    return np.flatnonzero((values < quiet - rest.preload[is_loaded] / 2).all(axis=1))


def _later(frames: Frames, free: NDArray[np.int64]) -> tuple[int, int] | None:
    """Return the first quiet stretch after the first of these frames, us, unless the array is loaded in it."""
    later = of_quiet(frames.between(frames.t[free[0]], np.inf))
    return None if later.preload_at else later.quiet_us
