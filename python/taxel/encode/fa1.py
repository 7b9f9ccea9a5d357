"""The FA-1 afferent of chapter 5."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

_DEFAULT = defaults("fa1")


@dataclass(kw_only=True, eq=False, repr=False)
class FA1(Encoder):
    """Integrate each taxel's change of compressed pressure; fire with its sign when it crosses an adaptive threshold.

    The equations are exactly 5.1 to 5.5 (and 5.7 for more than one bit), with polarity; the constants are those of
    Table 5.3. There is one signed train for each taxel. The initial state is the steady state of the first sample.
    Computed in float64; pressure below 0 counts as 0.

    Parameters
    ----------
    alpha : float, above 0, at most 4
        Exponent of the compression 5.1.
    a : float, 1/ms, 0 or more
        A spike raises the threshold by ``period_ms * a * theta_0``.
    b : float, 0 or more
        A sample without a spike lowers it by ``b * theta_0``.
    decay : {"sample", "ms"}
        Whether `b` applies to each sample, as 5.5 is printed, or to each ms (``b * period_ms * theta_0`` for a sample).
    theta_0 : float, 0 or more, optional
        The baseline threshold, in compressed units; with the 0 of Table 5.3 every change fires.
    range : float, in the sensor's unit, above 0, optional
        Instead of `theta_0`, the largest pressure: ``theta_0 = range ** alpha / 1024``. 150 (ticks of the 5.2 kHz
        preset's ramp) if neither is given.
    bits : int, from 1 to 10
        Bits of a spike's value, by 5.7: U in units of `theta_0`, rounded towards zero, from 1 to 2^bits - 1 with its
        sign. The condition for a spike remains 5.4.
    period_ms : float, ms, whole us
        T, the sampling period of events and of frames; frames must arrive at this period within one half.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 5.4.2. The page *Readings* lists the choices that the thesis leaves open. The rise of the threshold by one
    spike takes ``period_ms * a / b`` samples to decay (0.4 s at 1 ms, 1.6 s at 2 ms), so spikes of the last seconds
    still have an effect: touches in one long recording cause fewer spikes than the same touches in separate recordings.

    Examples
    --------
    >>> from taxel import Frames
    >>> frames = Frames([[[50.0]], [[60.0]], [[60.0]]], [0, 1000, 2000], unit="ticks")
    >>> FA1().encode(frames)[0]
    array([1.])
    """

    name = "fa1"

    alpha: float = _DEFAULT.alpha
    a: float = _DEFAULT.a
    b: float = _DEFAULT.b
    decay: Literal["sample", "ms"] = _DEFAULT.decay
    theta_0: float | None = _DEFAULT.theta_0
    range: float | None = _DEFAULT.range
    bits: int = _DEFAULT.bits
    period_ms: float = _DEFAULT.period_ms
