"""How large a touch is, how hard, and where its centre has gone since it began."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

__all__ = ["Moments"]


_DEFAULT = defaults("moments")


@dataclass(kw_only=True, eq=False, repr=False)
class Moments(Tared):
    """Say where area, total, peak and the way of the centre of a touch pass levels that stand in equal ratios.

    Of the taxels that count as `ContactArea` counts them: how many (area), the sum and the largest of their values
    above rest (total, peak), and how far their centre, weighted by these values, has moved to the right and downwards
    since the present touch began. A touch begins where area rises above 0 and ends where it is 0; between touches all
    are 0. A level of the displacement stands on both sides of 0 and is passed outwards. Nothing here depends on where
    on the array the touch began, so what is learnt at one place holds at others.

    Trains, unsigned, one a level in the order area, total, peak, x right, x left, y down, y up, each from its least
    level on: first where each level is reached, then where each is left, then (with `tonic_ms`) one that spikes while
    beyond. It begins settled: the first sample makes no crossing. Reckoned in float64.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        That of the board; 3 in its fast presets.
    levels : int, from 1 to 1000
        Levels a moment, for a displacement on each side of 0.
    area : (float, float), taxels, above 0, optional
        Least and largest level; None leaves the moment out.
    total, peak : (float, float), in the sensor's unit, above 0, optional
        The same of the sum and of the largest value above rest.
    displacement_mm : (float, float), mm, above 0, optional
        The same of the centre's way, for x and for y.
    tonic_ms : float, ms, whole us, optional
        While beyond a level: a spike when it is reached, then one every `tonic_ms`. None for crossings alone.
    period_ms : float, ms, whole us
        How often events are sampled; the step of the wire's stamps loses nothing.
    tare : Tare, or float, s, optional
        The taxels' rest, or how long each recording begins with it. It belongs to a board and a day, so a saved readout
        has none; without it nothing is encoded.

    Raises
    ------
    ProblemError : a parameter that makes no sense; encoding without a tare, or with another array's

    Examples
    --------
    A touch of two taxels, then of three; nothing reaches the largest level, 4.

    >>> from taxel import Frames
    >>> rest = Frames([[[50.0, 50.0, 50.0]]] * 2, [0, 1000], unit="ticks")
    >>> frames = Frames([[[50.0, 50, 50]], [[58.0, 58, 50]], [[58.0, 58, 58]]], [0, 200, 400], unit="ticks")
    >>> encoder = Moments(levels=3, area=(1, 4), total=None, peak=None, displacement_mm=(0.3, 5), tonic_ms=None)
    >>> [reached.tolist() for reached in encoder.with_tare(Tare.take(rest)).encode(frames)][:4]
    [[0.2], [0.2], [], [0.4]]
    """

    name = "moments"

    noise_floor: float = _DEFAULT.noise_floor
    levels: int = _DEFAULT.levels
    area: tuple[float, float] | None = _DEFAULT.area
    total: tuple[float, float] | None = _DEFAULT.total
    peak: tuple[float, float] | None = _DEFAULT.peak
    displacement_mm: tuple[float, float] | None = _DEFAULT.displacement_mm
    tonic_ms: float | None = _DEFAULT.tonic_ms
    period_ms: float = _DEFAULT.period_ms
    tare: Tare | float | None = _DEFAULT.tare
