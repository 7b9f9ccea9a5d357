"""The SA-2 afferent: steady firing under a sustained load."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("sa2")


@dataclass(kw_only=True, eq=False, repr=False)
class SA2(Tared):
    """Fire steadily while a taxel is loaded, hardly faster at the onset of the load (Ruffini).

    SA-2 afferents respond mainly to stretch of the skin, which a pressure array does not measure; this is a model of
    their response to load. Spikes have no sign; there is one train for each taxel. The initial state is the steady
    state of the first sample.

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
    The equations are those of `SA1`. It is four times less sensitive than SA-1 (Table 1 of Weiss et al. 2009,
    J. Neurophysiol. 101:1033). That source has no number for its steadier response and smaller onset: that `onset` and
    `loss` are less than half of SA-1's is our choice.

    Examples
    --------
    >>> from taxel import Frames
    >>> held = Frames([[[0.0]]] + [[[75.0]]] * 50, range(0, 51_000, 1000), unit="ticks")
    >>> SA2().encode(held)[0]
    array([ 2.,  4.,  7., 11., 16., 24., 33., 42.])
    """

    name = "sa2"

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
