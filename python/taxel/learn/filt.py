"""FILT: weights by filtered differences of output spikes and targets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["FILT"]


class FILT(EpochLearner):
    """Learn spike times by FILT: INST with output spikes and targets filtered by an exponential.

    Parameters
    ----------
    tau_q : float, ms, above 0
        Time constant of the filter (†).
    eta : float, above 0, optional
        Learning rate, weight a unit of `change`; ``600 / (trains * targets of all patterns)`` where left out (†).
    initial : (float, float), mV, optional
        First weights are drawn evenly between these two; ``(0, 200 / trains)`` where left out (†).
    epochs : int
        Epochs at most (†).
    updates : {"batch", "pattern"}
        Whether weights change once an epoch (†), or after each pattern in an order drawn anew.
    tau, tau_s : float, ms
        Membrane and synapse: an input of weight 1 makes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` that peaks at
        1 mV. (†)
    theta_0 : float, mV, above 0
        Threshold. (†)
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)``; it is put to 0 and currents go on; or
        all inputs up to the spike are lost. (†: "subtract")
    step_ms : float, ms, above 0
        The neuron is looked at every so often; inputs keep their true times.
    within_ms : float, ms, above 0
        A pattern is right where it has one output spike a target, each within this of its own.
    until_right : bool
        Whether to end as soon as every pattern is right.
    seed : int, 0 or more
        Of the first weights and the order of patterns.
    max_seconds : float, above 0, optional
        Ends the training with the best weights so far.

    Attributes
    ----------
    weights_ : float64, shape (trains,), mV
        Those with most patterns right, the latest such.
    right_ : float64, shape (epochs done + 1,)
        The share of patterns right after 0, 1, 2 ... epochs.
    epochs_, best_epoch_ : int
        Epochs done; after how many the weights were those.
    status_ : {"right", "epochs", "stopped"}
        Every pattern was right; all epochs were used up; Ctrl-C or `max_seconds`.
    neuron_ : Neuron or None
        The neuron as `taxel.Neuron` has it, where it can (`after_spike` "reset").

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

    def __init__(
        self,
        *,
        tau_q: float = 10.0,
        eta: float | None = None,
        initial: Sequence[float] | None = None,
        epochs: int = 500,
        updates: Updates = "batch",
        tau: float = 10.0,
        tau_s: float = 5.0,
        theta_0: float = 15.0,
        after_spike: AfterSpike = "subtract",
        step_ms: float = 0.1,
        within_ms: float = 1.0,
        until_right: bool = True,
        seed: int = 0,
        max_seconds: float | None = None,
    ) -> None:
        self.tau_q = tau_q
        self.eta = eta
        self.initial = initial
        self.epochs = epochs
        self.updates: Updates = updates
        self.tau = tau
        self.tau_s = tau_s
        self.theta_0 = theta_0
        self.after_spike: AfterSpike = after_spike
        self.step_ms = step_ms
        self.within_ms = within_ms
        self.until_right = until_right
        self.seed = seed
        self.max_seconds = max_seconds
        self._check()

    def _law(self) -> dict[str, Any]:
        return {"filt": {"tau_q": self.tau_q}}

    def _neuron(self) -> dict[str, Any]:
        return {
            "tau": self.tau,
            "current": {"exponential": {"tau_s": self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": self.after_spike,
            "refractory": 0.0,
            "step_ms": self.step_ms,
        }
