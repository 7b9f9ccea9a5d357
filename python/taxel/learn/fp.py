"""FP-learning: finite precision, the first error of a trial."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["FP"]


class FP(EpochLearner):
    """Learn spike times by FP-learning: only the first error of a trial changes weights.

    Parameters
    ----------
    window_ms : float, ms, above 0
        How far from its target an output spike may lie.
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
        1 mV.
    theta_0 : float, mV, above 0
        Threshold.
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)``; it is put to 0 and currents go on; or
        all inputs up to the spike are lost. "membrane" is refused: the rule needs a potential linear in the weights.
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
    An output spike outside every target's window, or a second one in it, lowers by the potential that each
    input makes at its time; a target whose window ends without a spike raises by the potential at the window's end.
    With `after_spike` "reset" inputs before the last output spike count for nothing. Memmesheimer, Rubin, Ölveczky
    and Sompolinsky, Neuron 82:925, 2014: that only the first error counts was read in Gardner and Grüning (2016);
    where an error is corrected is a reading of ours, and the paper's constants could not be read: the caller gives
    them.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 60, 3)], stop=80.0)
    >>> learner = FP(
    ...     window_ms=1.0, eta=0.02, initial=(0.0, 0.5), epochs=500, updates="pattern", tau=10.0, tau_s=5.0, theta_0=1.0
    ... )
    >>> learner.fit([trains], [[40.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    def __init__(
        self,
        *,
        window_ms: float,
        eta: float,
        initial: Sequence[float],
        epochs: int,
        updates: Updates,
        tau: float,
        tau_s: float,
        theta_0: float,
        after_spike: AfterSpike = "reset",
        step_ms: float = 0.1,
        within_ms: float = 1.0,
        until_right: bool = True,
        seed: int = 0,
        max_seconds: float | None = None,
    ) -> None:
        self.window_ms = window_ms
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
        return {"fp": {"window_ms": self.window_ms}}

    def _neuron(self) -> dict[str, Any]:
        return {
            "tau": self.tau,
            "current": {"exponential": {"tau_s": self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": self.after_spike,
            "refractory": 0.0,
            "step_ms": self.step_ms,
        }
