"""Chronotron: E-learning and I-learning."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from taxel._arguments import text
from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["Chronotron"]


class Chronotron(EpochLearner):
    """Learn spike times as a Chronotron: down a distance between spike trains ("E"), or by synaptic currents ("I").

    Parameters
    ----------
    rule : {"E", "I"}
        E-learning or I-learning.
    eta : float, above 0
        Learning rate, weight a unit of `change`.
    initial : (float, float), mV
        First weights are drawn evenly between these two.
    epochs : int
        Epochs at most.
    updates : {"batch", "pattern"}
        Whether weights change once an epoch, or after each pattern in an order drawn anew.
    tau, tau_s : float, ms
        Membrane and synapse: an input of weight 1 makes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` that peaks at
        1 mV. 15 and `tau` / 4 (‡).
    theta_0 : float, mV, above 0
        Threshold.
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)``; it is put to 0 and currents go on; or
        all inputs up to the spike are lost. "subtract" for E-learning, "membrane" for I-learning, where left out.
    tau_q : float, ms, above 0, optional
        E-learning: a move over `dt` costs ``(dt / tau_q)**2 / 2``, to add or to remove a spike 1; `tau` where left
        out (‡).
    gamma_r : float, ms, above 0, optional
        E-learning: weight of the moves; `tau_q` where left out (‡).
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
    E-learning splits the way from the output train to the targets into spikes added, removed and moved, at
    least cost (ties: remove, add, move), and ``change`` is the sum over added targets of ``L(t)``, less that over
    removed spikes, plus ``gamma_r / tau_q**2`` times the sum over moves of ``(t - target) L(t)``; `L` is the
    potential that an input makes. A late spike raises weights. Read in public codes (Tempotrons.jl 8329a17, whose
    defaults are marked (‡), and nircaf/Chronotron 7781434), as was the reset.

    I-learning: ``change`` is the current ``exp(-s/tau_s)`` of earlier inputs at the targets, less that at output
    spikes, with the sign of the weight. That changes go by the current was read in the paper's abstract; the sign is
    a reading of ours.

    Florian, PLoS ONE 7(8), e40233, 2012. Learning rates, thresholds, first weights and epochs behind its loads .22
    and .02 could not be read: the caller gives them. Figure 7 trains one target at 100 ms for 400 epochs.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 60, 3)], stop=80.0)
    >>> learner = Chronotron(rule="E", eta=0.05, initial=(0.0, 0.5), epochs=300, updates="pattern", theta_0=1.0)
    >>> learner.fit([trains], [[40.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    def __init__(
        self,
        *,
        rule: Literal["E", "I"],
        eta: float,
        initial: Sequence[float],
        epochs: int,
        updates: Updates,
        theta_0: float,
        tau: float = 15.0,
        tau_s: float | None = None,
        after_spike: AfterSpike | None = None,
        tau_q: float | None = None,
        gamma_r: float | None = None,
        step_ms: float = 0.1,
        within_ms: float = 1.0,
        until_right: bool = True,
        seed: int = 0,
        max_seconds: float | None = None,
    ) -> None:
        self.rule = rule
        self.eta = eta
        self.initial = initial
        self.epochs = epochs
        self.updates: Updates = updates
        self.theta_0 = theta_0
        self.tau = tau
        self.tau_s = tau_s
        self.after_spike = after_spike
        self.tau_q = tau_q
        self.gamma_r = gamma_r
        self.step_ms = step_ms
        self.within_ms = within_ms
        self.until_right = until_right
        self.seed = seed
        self.max_seconds = max_seconds
        self._check()

    def _law(self) -> dict[str, Any]:
        if text("rule", self.rule, ("E", "I")) == "I":
            return {"i_learning": {}}
        tau_q = self.tau if self.tau_q is None else self.tau_q
        return {"e_learning": {"tau_q": tau_q, "gamma_r": tau_q if self.gamma_r is None else self.gamma_r}}

    def _neuron(self) -> dict[str, Any]:
        after_spike = self.after_spike
        if after_spike is None:
            after_spike = "membrane" if self.rule == "I" else "subtract"
        return {
            "tau": self.tau,
            "current": {"exponential": {"tau_s": self.tau / 4 if self.tau_s is None else self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": after_spike,
            "refractory": 0.0,
            "step_ms": self.step_ms,
        }
