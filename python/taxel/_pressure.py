"""What a recording reads above rest: the pictures whose area, peak, sum and centre a pressure lab looks at first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._parameters import defaults
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import Recording

__all__ = ["above_rest"]

#: Of a long recording, so many pictures at most: a curve has no more points to see.
MOST_PICTURES = 2000
#: Pictures a second of a short recording of events.
PICTURES_HZ = 100.0


def above_rest(recording: Recording) -> tuple[Frames, float] | None:
    """Return pictures of what stands above rest, and what a loaded taxel reads more than; None without intensities.

    *Reading*: the rest of a taxel of events is the lowest value that it held since it was first heard, and it is loaded
    above the noise floor of the board's fast presets and half a tick, as `taxel.encode.ContactArea` has it. Files of
    pictures hold pressure: rest is 0 there.
    """
    if not recording.has_events:
        return recording.frames(), 0.0
    events = recording.events
    if events.present is None or not events.present.any():
        return None
    seconds = events.duration_us / 1e6
    frames = recording.frames(min(PICTURES_HZ, MOST_PICTURES / seconds) if seconds else PICTURES_HZ)
    heard = frames.t[:, None, None] >= _first_heard(events)
    rest = np.min(frames.values, axis=0, where=heard, initial=np.inf)
    values = np.where(heard, frames.values - rest, np.float32(0))
    return Frames(values, frames.t, unit=frames.unit, array=frames.array), defaults("contact_area").noise_floor + 0.5


def _first_heard(events: Events) -> NDArray[np.int64]:
    """Return when each taxel was first heard, us; far ahead where it never was."""
    first = np.full(events.array.shape, np.iinfo(np.int64).max)
    there = events.present
    np.minimum.at(first, (events.y[there], events.x[there]), events.t[there])
    return first
