"""Encoder of loads that are apart: when one begins, and when one ends, while others last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("separate_loads")


@dataclass(kw_only=True, eq=False, repr=False)
class SeparateLoads(Tared):
    """Fire when a load begins, and when one ends, while other loads last, as of two feet on one plate.

    Taxels are loaded and count as for `ContactArea`. Those that are at most a gap apart, in rows and in columns, are
    one load; so are those of one stamp and the stamp before. A load begins if none of its taxels was loaded at the
    stamp before, and ends if none is loaded any more.

    Trains are unsigned: first one per gap, which fires when a load begins, then one per gap, which fires when a load
    ends. They are computed once for each stamp, after the last event with it.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        The noise floor of the board; 3 in its fast presets.
    gaps : sequence of int, ascending, 1 or more, in taxels
        1 joins neighbours alone. A heel and a forefoot are one load by a gap that is longer than the arch of the foot.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording. It is valid for one board on one
        day, so a saved readout has no tare; encoding requires one.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, with another array's, or of channels

    Notes
    -----
    Ours. Time: O(taxels) a stamp with one load; O(loaded taxels squared) while several are apart.

    Examples
    --------
    While two taxels at the left stay loaded, two at the right are loaded for a frame.

    >>> from taxel import Array, Frames
    >>> row = {"unit": "N", "array": Array(1, 8, pitch_mm=2.0)}
    >>> rest = Frames([[[0.0] * 8]] * 2, [0, 1000], **row)
    >>> left, both = [9.0, 9.0, 0, 0, 0, 0, 0, 0], [9.0, 9.0, 0, 0, 0, 0, 9.0, 9.0]
    >>> frames = Frames([[left], [both], [left]], [0, 1000, 2000], **row)
    >>> spikes = SeparateLoads(gaps=[1, 8], tare=Tare.take(rest)).encode(frames)
    >>> [train.tolist() for train in spikes]
    [[0.0, 1.0], [0.0], [2.0], []]
    """

    name = "separate_loads"
    _needs_neighbours = True
    _learns_one = True

    noise_floor: float = _DEFAULT.noise_floor
    gaps: Sequence[int] = _DEFAULT.gaps
    tare: Tare | float | None = _DEFAULT.tare
