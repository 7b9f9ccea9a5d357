"""What a setting costs on the wire while the sensor is touched."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.information.sampling import Spikes

__all__ = ["WIRE", "kilobits_per_second"]

#: What the rates are of, to stand beside them.
WIRE = (
    "wire version 1: 5 bytes a change, 5 more with a value; a datagram for each time at which something changed, "
    "28 bytes of UDP and IP headers each; nothing is held back"
)

_EVENT_BITS, _HEADER_BITS, _MOST_BYTES = 40, 8 * 28, 1472


def kilobits_per_second(spikes: Spikes, window_us: float, *, values: bool) -> float:
    """Return the rate on version 1 of the wire from the contact to a window's or the trial's end, the mean over trials.

    Parameters
    ----------
    spikes : Spikes
    window_us : float, us, above 0
    values : bool
        Whether the setting needs a value an event.

    Returns
    -------
    float, kbit/s
    """
    kept = spikes.bin < spikes.bins_to(window_us)[spikes.trial]
    bits = _EVENT_BITS * (2 if values else 1)
    at_once: NDArray[np.int64] = np.unique(
        np.stack([spikes.trial[kept], spikes.bin[kept]]), axis=1, return_counts=True
    )[1]
    datagrams = np.ceil(at_once * bits / 8 / _MOST_BYTES).sum()
    touched = np.minimum(window_us, spikes.length_us).sum()
    return float((bits * at_once.sum() + _HEADER_BITS * datagrams) / touched * 1000.0) if touched > 0 else 0.0
