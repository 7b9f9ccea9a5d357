"""Encoder of the peak: the largest deviation of a taxel in units of its noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("peak")


@dataclass(kw_only=True, eq=False, repr=False)
class Peak(Tared):
    """Fire as the largest deviation of a taxel from its rest reaches and leaves levels, in units of its noise.

    With u a value less its rest, divided by the taxel's standard deviation in the tare (at least `least_noise`), the
    peak is the largest u. If several are 4 or more, it is the root of the sum of their squares. It is at least 0. It
    depends neither on position nor on neighbours: one loaded taxel is a touch, and channels have a peak too. A stuck
    taxel that moves also counts as a touch; `LocalLoad` and `ContactArea` reject it.

    A taxel that has been 0 since the first sample has no value yet and counts as at rest; a taxel without a value in
    the tare is left out.

    Trains are unsigned: first one per level, which fires when the peak rises to it, then one per level, which fires
    when the peak falls below `release` x level. They are computed once for each stamp, after the last event with it.

    Parameters
    ----------
    least_noise : float, in the sensor's unit, from 1e-9 to 1e9
        Least noise of a taxel. 0.3 is the standard deviation within a tick; for another unit use 0.3 of the step
        between its values.
    levels : sequence of float, ascending, above 0
        In units of noise.
    release : float, from 0.01 to 1
        The share of a level below which the peak leaves the level: below 1, noise near a level does not cross it again
        and again.
    tare : Tare, or float, s, optional
        The taxels' rest and noise, or the duration of rest at the beginning of each recording. It is valid for one
        board on one day, so a saved readout has no tare; encoding requires one.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, or with another array's

    Notes
    -----
    Ours. Time: O(taxels) a stamp or frame.

    Examples
    --------
    Of two taxels with a noise of 1, one reaches 6 units, then both: together 8.5.

    >>> from taxel import Array, Frames
    >>> channels = {"unit": "N", "array": Array(1, 2)}
    >>> rest = Frames([[[9.0, 9.0]], [[11.0, 11.0]]] * 10, range(0, 20_000, 1000), **channels)
    >>> values = [[[10.0, 10.0]], [[16.0, 10.0]], [[16.0, 16.0]], [[10.0, 10.0]]]
    >>> frames = Frames(values, range(0, 4000, 1000), **channels)
    >>> spikes = Peak(levels=[5.0, 8.0], least_noise=1.0).with_tare(Tare.take(rest)).encode(frames)
    >>> [train.tolist() for train in spikes]
    [[1.0], [2.0], [3.0], [3.0]]
    """

    name = "peak"

    least_noise: float = _DEFAULT.least_noise
    levels: Sequence[float] = _DEFAULT.levels
    release: float = _DEFAULT.release
    tare: Tare | float | None = _DEFAULT.tare
