"""FILT: weights by filtered differences of output spikes and targets."""

from __future__ import annotations

from dataclasses import dataclass

from taxel_rules.inst import INST


@dataclass(kw_only=True, eq=False, repr=False)
class FILT(INST):
    """Learn spike times by FILT: INST with output spikes and targets filtered by an exponential.

    Parameters
    ----------
    eta : float, above 0, optional
    initial : (float, float), mV, optional
    epochs : int, 1 or more
    updates : {"batch", "pattern"}
    tau, tau_s : float, ms, above 0
    theta_0 : float, mV, above 0
    after_spike : {"subtract", "membrane", "reset"}
    step_ms, within_ms : float, ms, above 0
    until_right : bool
    seed : int, 0 or more
    max_seconds : float, s, above 0, optional
        All up to here as in `INST`.
    tau_q : float, ms, above 0
        Time constant of the filter (†).

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        As in `INST`.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    The contribution of an input `s` ms before a spike is ``eps_0 (C_m exp(-s/tau) - C_s exp(-s/tau_s))``, and after it
    ``eps_0 (C_m - C_s) exp(s/tau_q)``, with ``C = tau / (tau + tau_q)``. Values marked (†) are from the paper: Gardner
    and Grüning, "Supervised learning in spiking neural networks for precise temporal encoding", PLoS ONE 11(8),
    e0161335, 2016.

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

    tau_q: float = 10.0
