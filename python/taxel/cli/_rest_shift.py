"""Whether the taxels of a source of frames rest elsewhere after a gap than their tare has it."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import plain

#: A gap is as long as a silence that a verdict counts, s.
GAP_S = 1.0
#: Number of frames, a tenth of a second apart, in which the taxels must hold still.
_LOOKS = 10
#: Of so many times its noise a taxel has left its rest, where the readout has no noise floor.
_NOISE = 6.0
#: The part of the taxels that must have left it: what lies on a sensor covers fewer.
_PART = 0.25


class RestShift:
    """Compare the taxels with their rest when they hold still after a gap; tell it once.

    Parameters
    ----------
    floor : float, in the sensor's unit, 0 or more
        The noise floor of the readout; 0 if it has none.
    """

    def __init__(self, floor: float) -> None:
        self._floor = floor
        self._longest_s = 0.0
        self._looks: deque[NDArray[np.float64]] | None = None

    def look(
        self,
        silent_s: float,
        values: NDArray[np.float64],
        rest: NDArray[np.float64],
        noise: NDArray[np.float64],
        unit: str,
    ) -> str | None:
        """Take the values of a frame, after so long a silence; return a warning, once, where the rest has shifted."""
        if silent_s >= GAP_S:
            self._longest_s, self._looks = max(self._longest_s, silent_s), deque(maxlen=_LOOKS)
            return None
        if self._looks is None:
            return None
        self._looks.append(np.asarray(values, np.float64))
        if len(self._looks) < _LOOKS:
            return None
        looks = np.stack(self._looks)
        floor = self._floor or _NOISE * float(np.nanmedian(noise))
        if np.nanmax(np.ptp(looks, axis=0)) > 2 * floor:
            return None
        self._looks = None
        shift = np.abs(np.median(looks, axis=0) - rest)
        count = int(np.count_nonzero(shift > floor))
        if count <= _PART * shift.size:
            return None
        farthest = plain(round(float(np.nanmax(shift)), 3))
        return (
            f"after a gap of {self._longest_s:.1f} s {count} of {shift.size} taxels rest elsewhere than by the tare, "
            f"by up to {farthest} {unit}, so that presses are missed: with nothing on the sensor, zero it on the page, "
            "or start anew with --tare SECONDS"
        )
