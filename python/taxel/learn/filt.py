"""FILT: weights by filtered differences of output spikes and targets."""

from __future__ import annotations

from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.learn.inst import INST

__all__ = ["FILT"]


_DEFAULT = defaults("filt")


@dataclass(kw_only=True, eq=False, repr=False)
class FILT(INST):
    """Learn spike times by FILT: INST with output spikes and targets filtered by an exponential.

    Parameters
    ----------
    tau_q : float, ms, above 0
        Time constant of the filter (†).
    eta, initial, epochs, updates, tau, tau_s, theta_0, after_spike, step_ms, within_ms, until_right, seed, max_seconds
        As in `INST`.

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        What was learnt, as `INST` has it.

    Raises
    ------
    ProblemError : a parameter that makes no sense

    Notes
    -----
    An input counts, `s` ms before a spike, by ``eps_0 (C_m exp(-s/tau) - C_s exp(-s/tau_s))``, and after it by
    ``eps_0 (C_m - C_s) exp(s/tau_q)``, with ``C = tau / (tau + tau_q)``. Values marked (†) were read in the paper:
    Gardner and Grüning, "Supervised learning in spiking neural networks for precise temporal encoding", PLoS ONE
    11(8), e0161335, 2016.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(100)], stop=120.0)
    >>> learner = FILT(epochs=200)
    >>> learner.fit([trains], [[60.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    _kind = "filt"

    tau_q: float = _DEFAULT.tau_q
