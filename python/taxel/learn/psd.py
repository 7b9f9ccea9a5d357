"""PSD: precise-spike-driven plasticity."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["PSD"]


class PSD(EpochLearner):
    """Learn spike times by PSD: inputs count by the current that they make at targets less that at output spikes.

    Parameters
    ----------
    eta : float, above 0
        Learning rate, weight a unit of `change`.
    initial : (float, float), mV
        First weights are drawn evenly between these two.
    epochs : int
        Epochs at most.
    updates : {"batch", "pattern"}
        Whether weights change once an epoch, or after each pattern in an order drawn anew.
    tau, tau_1, tau_2 : float, ms
        Membrane; slow and fast time constant of the current ``V0 (exp(-s/tau_1) - exp(-s/tau_2))``, peak 1, which the
        membrane filters once more, over 1 MOhm (‡).
    theta_0 : float, mV, above 0
        Threshold.
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)``; it is put to 0 and currents go on
        (leaky integrate and fire); or all inputs up to the spike are lost.
    refractory : float, ms, 0 or more
        How long the membrane stays at 0 after a spike.
    tau_s : float, ms, above 0 and below `tau`, optional
        Where given, the neuron is that of INST and FILT, driven by a current ``exp(-s/tau_s)`` whose potential peaks at
        1 mV, and the rule's current serves the rule alone.
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
    ``change`` is the sum over targets of the current of earlier inputs, less the same over output spikes: Yu,
    Tang, Tan and Li, PLoS ONE 8(11), e78318, 2013. Values marked (‡), and the step, were read in public MATLAB code
    of the field (Zyj061/SNN_Sparse_temporal_coding, cf813da), not in the paper, whose protocol and criterion could
    not be read: the rest the caller gives.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 60, 3)], stop=80.0)
    >>> learner = PSD(eta=0.01, initial=(0.0, 1.0), epochs=200, updates="pattern", theta_0=1.0)
    >>> learner.fit([trains], [[40.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    def __init__(
        self,
        *,
        eta: float,
        initial: Sequence[float],
        epochs: int,
        updates: Updates,
        theta_0: float,
        tau: float = 10.0,
        tau_1: float = 10.0,
        tau_2: float = 2.5,
        after_spike: AfterSpike = "membrane",
        refractory: float = 0.0,
        tau_s: float | None = None,
        step_ms: float = 0.1,
        within_ms: float = 1.0,
        until_right: bool = True,
        seed: int = 0,
        max_seconds: float | None = None,
    ) -> None:
        self.eta = eta
        self.initial = initial
        self.epochs = epochs
        self.updates: Updates = updates
        self.theta_0 = theta_0
        self.tau = tau
        self.tau_1 = tau_1
        self.tau_2 = tau_2
        self.after_spike: AfterSpike = after_spike
        self.refractory = refractory
        self.tau_s = tau_s
        self.step_ms = step_ms
        self.within_ms = within_ms
        self.until_right = until_right
        self.seed = seed
        self.max_seconds = max_seconds
        self._check()

    def _law(self) -> dict[str, Any]:
        return {"psd": {"tau_1": self.tau_1, "tau_2": self.tau_2}}

    def _neuron(self) -> dict[str, Any]:
        return {
            "tau": self.tau,
            "current": {"double_exponential": {"tau_1": self.tau_1, "tau_2": self.tau_2}}
            if self.tau_s is None
            else {"exponential": {"tau_s": self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": self.after_spike,
            "refractory": self.refractory,
            "step_ms": self.step_ms,
        }
