"""ReSuMe: the remote supervised method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["ReSuMe"]


class ReSuMe(EpochLearner):
    """Learn spike times by ReSuMe: an exponential window before targets raises, the same before output spikes lowers.

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
    tau, tau_s : float, ms
        Membrane and synapse: an input of weight 1 makes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` that peaks at
        1 mV.
    theta_0 : float, mV, above 0
        Threshold.
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)``; it is put to 0 and currents go on; or
        all inputs up to the spike are lost. Leaky integrate and fire ("membrane") was used.
    a : float
        What every synapse gets at each spike, input or not (‡).
    amplitude : float, above 0
        Height of the window (‡).
    tau_w : float, ms, above 0, optional
        Time constant of the window; `tau` where left out (‡).
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
    ``change`` is the sum over targets of ``a + sum of amplitude * exp(-(t - t_ij) / tau_w)`` over earlier
    inputs, less the same over output spikes: equation 2.10 of Ponulak and Kasiński, Neural Computation 22:467, 2010,
    as the public code Tempotrons.jl (8329a17) cites it; values marked (‡) are that code's defaults. The paper's own
    constants, protocol and epochs could not be read: the caller gives them. Its load .04 was measured by Florian
    (2012), not by its authors.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 60, 3)], stop=80.0)
    >>> learner = ReSuMe(eta=0.02, initial=(0.0, 0.5), epochs=200, updates="pattern", tau=10.0, tau_s=5.0, theta_0=1.0)
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
        tau: float,
        tau_s: float,
        theta_0: float,
        after_spike: AfterSpike = "membrane",
        a: float = 0.0,
        amplitude: float = 1.0,
        tau_w: float | None = None,
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
        self.tau = tau
        self.tau_s = tau_s
        self.theta_0 = theta_0
        self.after_spike: AfterSpike = after_spike
        self.a = a
        self.amplitude = amplitude
        self.tau_w = tau_w
        self.step_ms = step_ms
        self.within_ms = within_ms
        self.until_right = until_right
        self.seed = seed
        self.max_seconds = max_seconds
        self._check()

    def _law(self) -> dict[str, Any]:
        return {"resume": {"a": self.a, "amplitude": self.amplitude, "tau_w": self.tau_w}}

    def _neuron(self) -> dict[str, Any]:
        return {
            "tau": self.tau,
            "current": {"exponential": {"tau_s": self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": self.after_spike,
            "refractory": 0.0,
            "step_ms": self.step_ms,
        }
