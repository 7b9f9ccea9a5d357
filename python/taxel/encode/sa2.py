"""The SA-2 afferent: a held load, steadily."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

__all__ = ["SA2"]


_DEFAULT = defaults("sa2")


@dataclass(kw_only=True, eq=False, repr=False)
class SA2(Tared):
    """Fire while a taxel is loaded, steadily, hardly faster when it is loaded anew (Ruffini).

    It feels the stretch of skin above all, which an array of pressure does not have: what is here is its answer to
    load. Spikes have no sign; one train a taxel. It begins as if the first sample had always been.

    Parameters
    ----------
    range : float, in the sensor's unit, above 0
        The largest pressure; 150 ticks is the ramp of the board's 5.2 kHz preset.
    threshold : float, above 0
        Where it begins to fire, a share of `range`.
    onset : float, 0 or more
        How much more a pressure counts while it is new.
    onset_ms : float, ms, above 0
        How long it counts as new.
    loss : float, from 0 to 1
        Which share of a pressure that lasts is lost in the end.
    loss_ms : float, ms, above 0
        How long that takes.
    membrane_ms : float, ms, above 0
        The membrane's time constant.
    jump : float, above 0
        By how much a spike raises the threshold, a share of `range`.
    recovery_ms : float, ms, above 0
        The time constant with which it sinks again.
    refractory_ms : float, ms, 0 or more
        How long after a spike none can come.
    period_ms : float, ms, whole us
        How often events are sampled; frames must come at it, give or take half.
    tare : Tare, or float, s, optional
        The taxels' rest, or how long each recording begins with it: pressure is what stands above it (0 where a rest is
        not known). Without one it counts from 0. It belongs to a board and a day, so a saved readout has none.

    Raises
    ------
    ProblemError : a parameter that makes no sense; encoding with another array's tare

    Notes
    -----
    The equations are those of `SA1`. It is four times less sensitive than SA-1 (Table 1 of Weiss et al. 2009,
    J. Neurophysiol. 101:1033). That it answers more steadily and with less of an onset has no number there: `onset` and
    `loss` are less than half of SA-1's, our choice.

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
