"""What a recording reads above rest: the pictures whose area, peak, sum and centre a pressure lab looks at first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._base.parameters import defaults
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording.recording import Recording

__all__ = ["above_rest", "readings"]

#: Of a long recording, so many pictures at most: a curve has no more points to see.
MOST_PICTURES = 2000
#: Pictures a second of a short recording of events.
PICTURES_HZ = 100.0


def above_rest(recording: Recording) -> tuple[Frames, float] | None:
    """Return pictures of what stands above rest, and what a loaded taxel reads more than; None without intensities.

    They are in N or kPa where a calibration lies beside the recording.

    *Reading*: the rest of a taxel of events is the lowest value that it held since it was first heard, and it is loaded
    above the noise floor of the board's fast presets and half a tick, as `taxel.encode.ContactArea` has it. Files of
    pictures hold pressure: rest is 0 there.
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
    values = np.maximum(frames.values - rest, 0.0)
    return Frames(values.astype(np.float32), frames.t, unit=frames.unit, array=frames.array), floor


def readings(recording: Recording) -> tuple[Frames, NDArray[np.float64], float] | None:
    """Return pictures as they were read, each taxel's rest, and what a loaded one reads more; None without intensities.

    The rest of a taxel that was never heard is infinite.
    """
    if not recording.has_events:
        return recording.frames(), np.zeros(recording.array.shape), 0.0
    events = recording.events
    if events.present is None or not events.present.any():
        return None
    seconds = events.duration_us / 1e6
    frames = recording.frames(min(PICTURES_HZ, MOST_PICTURES / seconds) if seconds else PICTURES_HZ)
    heard = frames.t[:, None, None] >= _first_heard(events)
    rest = np.min(frames.values, axis=0, where=heard, initial=np.inf).astype(np.float64)
    return frames, rest, defaults("contact_area").noise_floor + 0.5


def _first_heard(events: Events) -> NDArray[np.int64]:
    """Return when each taxel was first heard, us; far ahead where it never was."""
    first = np.full(events.array.shape, np.iinfo(np.int64).max)
    there = events.present
    np.minimum.at(first, (events.y[there], events.x[there]), events.t[there])
    return first
