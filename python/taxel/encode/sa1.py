"""The SA-1 afferent: the strength of a sustained pressure."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("sa1")


@dataclass(kw_only=True, eq=False, repr=False)
class SA1(Tared):
    """Fire while a taxel is pressed: fastest at the onset of pressure, then with a slowly falling rate (Merkel).

    Spikes have no sign; there is one train for each taxel. The initial state is the steady state of the first sample.

    Parameters
    ----------
    range : float, in the sensor's unit, above 0
        The largest pressure; 150 ticks is the ramp of the board's 5.2 kHz preset.
    threshold : float, above 0
        Threshold of firing, a share of `range`.
    onset : float, 0 or more
        Additional gain of a new pressure.
    onset_ms : float, ms, above 0
        Time constant with which that gain decays.
    loss : float, from 0 to 1
        The share of a constant pressure that adaptation removes in the end.
    loss_ms : float, ms, above 0
        Time constant of that adaptation.
    membrane_ms : float, ms, above 0
        The membrane's time constant.
    jump : float, above 0
        Increase of the threshold by a spike, a share of `range`.
    recovery_ms : float, ms, above 0
        Time constant with which the increase decays.
    refractory_ms : float, ms, 0 or more
        Absolute refractory time after a spike.
    period_ms : float, ms, whole us
        Sampling period of events; frames must arrive at this period within one half.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording: pressure is the value above it (0
        if a rest is unknown). Default: a rest of 0. It is valid for one board on one day, so a saved readout has no
        tare.

    Raises
    ------
    ProblemError : an invalid parameter; encoding with another array's tare

    Notes
    -----
    With x the pressure as a share of `range` (below 0 counts as 0), and L_tau a low pass of first order::

        u = L_membrane((1 + onset) x - onset L_onset(x) - loss L_loss(x))
        spike where u >= threshold + a, and none came for refractory_ms;  a += jump at it
        da/dt = -a / recovery_ms

    Between samples x is interpolated linearly, and the time of a crossing within a sample is used: with periods of 0.1
    to 2 ms rates agree within 2 % of each other. A spike has the time of its sample; there is at most one a sample.

    The threshold is that of Kobayashi, Tsubota and Shinomoto (2009), Front. Comput. Neurosci. 3:9, with one time
    constant; `refractory_ms` is theirs. With it the rate grows linearly with pressure, as SA-1's does
    (Vega-Bermudez and Johnson 1999, J. Neurophysiol. 81:2701). `onset_ms` is the slower inactivation in the generator
    of Gerling et al. (2018), PLoS Comput. Biol. 14:e1006264, figure 2. The others are fitted by us: `loss` to a rate
    that falls by 38 % in the first 12 s of holding (Burgess et al. 1983, J. Neurosci. 3:2652, mean of 21 fibres);
    `onset`, `membrane_ms` and `recovery_ms` to a threshold of one spike a cycle that is least near 5 Hz; `jump` to
    some 200 spikes/s at the onset of half of `range`; `threshold` to the least pressure that exceeds a noise of 3 ticks
    in 150.

    Examples
    --------
    >>> from taxel import Frames
    >>> held = Frames([[[0.0]]] + [[[75.0]]] * 50, range(0, 51_000, 1000), unit="ticks")
    >>> SA1().encode(held)[0]
    array([ 1.,  3.,  5.,  7.,  9., 11., 13., 15., 17., 21., 26., 31., 36.,
           41., 46.])
    """

    name = "sa1"

    range: float = _DEFAULT.range
    threshold: float = _DEFAULT.threshold
    onset: float = _DEFAULT.onset
    onset_ms: float = _DEFAULT.onset_ms
    loss: float = _DEFAULT.loss
    loss_ms: float = _DEFAULT.loss_ms
    membrane_ms: float = _DEFAULT.membrane_ms
    jump: float = _DEFAULT.jump
    recovery_ms: float = _DEFAULT.recovery_ms
    refractory_ms: float = _DEFAULT.refractory_ms
    period_ms: float = _DEFAULT.period_ms
    tare: Tare | float | None = _DEFAULT.tare
