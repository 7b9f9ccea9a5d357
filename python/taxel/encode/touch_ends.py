"""Encoder of touches as they end: how long each lasted, and how large it was."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("touch_ends")


@dataclass(kw_only=True, eq=False, repr=False)
class TouchEnds(Tared):
    """Give a graded spike on each train when a touch ends, with the duration and size of the touch.

    A touch begins when the number of taxels that count for `ContactArea` rises above 0, and ends when it is 0 again.
    Channels and a single taxel have no neighbours and count alone: from the noise floor on, or from six times their
    noise in the tare if that is more, until they are below half of it.

    The trains are log(1 + duration in ms); log(1 + the largest) of its area, of its total and of its peak, as in
    `Moments`; and 1. A touch that has not ended gives nothing. The detections of a neuron that receives them have the
    beginning of the touch as their time `t`, or its end, and are `known` after its end.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        The noise floor of the board; 3 in its fast presets.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording. It is valid for one board on one
        day, so a saved readout has no tare; encoding requires one.
    at_end : bool
        Whether the time `t` of a detection is the end of the touch, not its beginning.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, or with another array's

    Notes
    -----
    Ours. The duration is exact to 1 us up to 2 s, then to 1 part in a million.

    Examples
    --------
    >>> import numpy as np
    >>> from taxel import Array, Frames
    >>> values = np.zeros((50, 2, 2))
    >>> values[10:30] = 60.0
    >>> frames = Frames(values, range(0, 500_000, 10_000), unit="N", array=Array(2, 2))
    >>> spikes = TouchEnds().with_tare(Tare.take(frames, stop_us=50_000)).encode(frames)
    >>> spikes.times, np.expm1(spikes.values[:2]).round(3)
    (array([300., 300., 300., 300., 300.]), array([200.,   4.], dtype=float32))
    """

    name = "touch_ends"

    noise_floor: float = _DEFAULT.noise_floor
    tare: Tare | float | None = _DEFAULT.tare
    at_end: bool = _DEFAULT.at_end
