"""Cost of a setting on the wire while the sensor is touched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.information.sampling import SampledEvents

__all__ = ["WIRE", "kilobits_per_second"]

#: What the rates refer to, printed beside them.
WIRE = (
    "wire version 2: 2 bytes for each event (kind 0), 4 with a value (kind 2); a datagram for each time at which "
    "something changed, with 24 bytes of header, sent at once; UDP and IP would add 28 bytes to each datagram; "
    "promises, states and totals "
    "are not counted"
)

_OWN_BYTES, _MOST_BYTES = 24, 1400


def kilobits_per_second(spikes: SampledEvents, window_us: float, *, values: bool) -> float:
    """Return the rate on version 2 of the wire from the contact to a window's or the trial's end, the mean over trials.

    Parameters
    ----------
    spikes : SampledEvents
    window_us : float, us, above 0
    values : bool
        Whether the setting needs a value an event.

    Returns
    -------
    float, kbit/s

    Notes
    -----
    Up to 32 767 places an event is one word, so its size does not depend on its place.
    """
    inside = spikes.bin < spikes.bins_to(window_us)[spikes.trial]
    word = 4 if values else 2
    bins = int(spikes.bin.max(initial=0)) + 1
    at_once: NDArray[np.int64] = np.unique(spikes.trial[inside] * bins + spikes.bin[inside], return_counts=True)[1]
    datagrams = np.ceil(at_once * word / (_MOST_BYTES - _OWN_BYTES)).sum()
    touched = np.minimum(window_us, spikes.length_us).sum()
    return float(8.0 * (word * at_once.sum() + _OWN_BYTES * datagrams) / touched * 1000.0) if touched > 0 else 0.0
