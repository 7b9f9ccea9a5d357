"""The FA-2 afferent: vibration, and the moment of contact."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._encoder import Encoder

_DEFAULT = defaults("fa2")


@dataclass(kw_only=True, eq=False, repr=False)
class FA2(Encoder):
    """Fire while the pressure on a taxel changes fast: one spike a cycle at 200 to 250 Hz, none for constant pressure.

    This is the model of a Pacinian afferent. Spikes have no sign; there is one train for each taxel. The initial state
    is the steady state of the first sample. A value that a state of version 2 repaired is not a change.

    Parameters
    ----------
    range : float, in the sensor's unit, above 0
        The largest pressure; 150 ticks is the ramp of the board's 5.2 kHz preset.
    threshold : float, above 0
        Threshold of firing, a share of `range`.
    corner_ms : float, ms, above 0
        The time constant of the two high passes.
    membrane_ms : float, ms, above 0
        The membrane's time constant.
    jump : float, above 0
        Increase of the threshold by a spike, a share of `range`.
    recovery_ms : float, ms, above 0
        Time constant with which the increase decays.
    refractory_ms : float, ms, 0 or more
        Absolute refractory time after a spike.
    period_ms : float, ms, whole us, at most 1
        Sampling period of events; frames must arrive at this period within one half.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    With x the pressure as a share of `range` (below 0 counts as 0), H_tau a high pass and L_tau a low pass of first
    order::

        u = L_membrane(H_corner(H_corner(x)))

    and the threshold of `SA1`. Thresholds therefore fall by 12 dB an octave up to the best frequency, as those of the
    Pacinian channel do (Bolanowski et al. 1988, J. Acoust. Soc. Am. 84:1680). `corner_ms`, `membrane_ms`, `jump` and
    `recovery_ms` are fitted by us to a threshold of one spike a cycle that is least between 200 and 250 Hz. `threshold`
    is limited by the sensor: a step of one tick in 150 stays below it; a finger is far more sensitive. Thresholds at
    periods of 0.05 to 0.2 ms agree within 5 % of each other; at periods above 0.5 ms there is no best frequency.

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
