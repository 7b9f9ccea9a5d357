"""Encoder of a threshold and a pair of phasic Izhikevich neurons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

_DEFAULT = defaults("threshold_izhikevich")


@dataclass(eq=False, repr=False)
class ThresholdIzhikevich(Encoder):
    """Fire two Izhikevich neurons for each level: one when a taxel reaches the level (+1), one when it leaves it (-1).

    The input of one neuron is the thresholded signal, that of the other its inverse; each fires once for each step of
    its input, and repeated crossings within some 10 ms are suppressed. Trains: ``taxel * len(levels) + level``, signed.

    Parameters
    ----------
    levels : sequence of float, ascending
        In the sensor's unit; the thesis has one, 0.4 V.
    published : {"6.5.1", "3.4.3"}
        The published parameter set: a = 0.005, I = 0.6 (6.5.1, latency 15.8 ms) or a = 0.02, I = 0.5 (3.4.3, latency
        20.2 ms); b = 0.25, c = -65 mV, d = 6 in both.
    begin : {"settled", "rest"}
        The steady state of the first sample; or rest without input, from which the ON neuron of each active channel and
        the OFF neuron of each idle channel fire once.
    period_ms : float, ms, whole us
        Sampling period of events.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 3.4.3 and 6.5.1; Izhikevich (2003), IEEE Trans. Neural Networks 14:1569. Forward Euler in float64, both
    equations from the old state, in steps of 0.1 ms that count from the first sample: the step is part of the
    definition, as the latency depends on it. A spike has the time at the end of its step.

    Examples
    --------
    >>> from taxel import Frames
    >>> frames = Frames([[[0.0]], [[1.0]], [[1.0]]], [0, 10_000, 50_000], unit="V")
    >>> ThresholdIzhikevich([0.4]).encode(frames)[0]
    array([25.8])
    """

    name = "threshold_izhikevich"

    levels: Sequence[float]
    _: KW_ONLY
    published: Literal["6.5.1", "3.4.3"] = _DEFAULT.published
    begin: Literal["settled", "rest"] = _DEFAULT.begin
    period_ms: float = _DEFAULT.period_ms
