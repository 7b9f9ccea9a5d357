"""The FA-2 afferent: vibration, and the moment of contact."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

__all__ = ["FA2"]


_DEFAULT = defaults("fa2")


@dataclass(kw_only=True, eq=False, repr=False)
class FA2(Encoder):
    """Fire where pressure on a taxel moves fast: a spike a cycle at 200 to 250 Hz, none while it is held (Pacini).

    Spikes have no sign; one train a taxel. It begins as if the first sample had always been. A value that a state of
    version 2 repaired is no change.

    Parameters
    ----------
    range : float, in the sensor's unit, above 0
        The largest pressure; 150 ticks is the ramp of the board's 5.2 kHz preset.
    threshold : float, above 0
        Where it begins to fire, a share of `range`.
    corner_ms : float, ms, above 0
        The time constant of the two high passes.
    membrane_ms : float, ms, above 0
        The membrane's time constant.
    jump : float, above 0
        By how much a spike raises the threshold, a share of `range`.
    recovery_ms : float, ms, above 0
        The time constant with which it sinks again.
    refractory_ms : float, ms, 0 or more
        How long after a spike none can come.
    period_ms : float, ms, whole us, at most 1
        How often events are sampled; frames must come at it, give or take half.

    Raises
    ------
    ProblemError : a parameter that makes no sense

    Notes
    -----
    With x the pressure as a share of `range` (below 0 counts as 0), H_tau a high pass and L_tau a low pass of first
    order::

        u = L_membrane(H_corner(H_corner(x)))

    and the threshold of `SA1`. So thresholds fall by 12 dB an octave up to the best frequency, as those of the channel
    that it carries do (Bolanowski et al. 1988, J. Acoust. Soc. Am. 84:1680). `corner_ms`, `membrane_ms`, `jump` and
    `recovery_ms` are fitted by us to a threshold of one spike a cycle that is least between 200 and 250 Hz.
    `threshold` is what a sensor allows: a step of one tick in 150 stays below it; a finger is far more sensitive.
    Thresholds at periods of 0.05 to 0.2 ms agree within 5 % of each other; at periods above 0.5 ms no
    best frequency is left.

    Examples
    --------
    >>> from taxel import Frames
    >>> struck = Frames([[[0.0]]] + [[[75.0]]] * 50, range(0, 10_200, 200), unit="ticks")
    >>> FA2().encode(struck)[0]
    array([0.2])
    """

    name = "fa2"

    range: float = _DEFAULT.range
    threshold: float = _DEFAULT.threshold
    corner_ms: float = _DEFAULT.corner_ms
    membrane_ms: float = _DEFAULT.membrane_ms
    jump: float = _DEFAULT.jump
    recovery_ms: float = _DEFAULT.recovery_ms
    refractory_ms: float = _DEFAULT.refractory_ms
    period_ms: float = _DEFAULT.period_ms
