"""INST: weights by instantaneous differences of output spikes and targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel._base.parameters import defaults
from taxel.learn._epochs import AfterSpike, EpochLearner, Updates

__all__ = ["INST"]


_DEFAULT = defaults("inst")


@dataclass(kw_only=True, eq=False, repr=False)
class INST(EpochLearner):
    """Learn spike times by INST: inputs count by the potential that they make at targets less that at output spikes.

    Parameters
    ----------
    eta : float, above 0, optional
        Learning rate, weight a unit of `change`; ``600 / (trains * targets of all patterns)`` where left out (†).
    initial : (float, float), mV, optional
        First weights are drawn evenly between these two; ``(0, 200 / trains)`` where left out (†).
    epochs : int, 1 or more
        Epochs at most (†).
    updates : {"batch", "pattern"}
        Whether weights change once an epoch (†), or after each pattern in an order drawn anew.
    tau, tau_s : float, ms, above 0
        Membrane and synapse: an input of weight 1 makes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` that peaks at
        1 mV. (†)
    theta_0 : float, mV, above 0
        Threshold. (†)
    after_spike : {"subtract", "membrane", "reset"}
        What an output spike does: the potential falls by ``theta_0 exp(-s/tau)`` (†); it is put to 0 and currents go on
        (leaky integrate and fire); or all inputs up to the spike are lost.
    step_ms : float, ms, above 0
        Time between two comparisons of potential and threshold; inputs keep their true times.
    within_ms : float, ms, above 0
        A pattern is right where it has one output spike a target, each within this of its own.
    until_right : bool
        Whether to end as soon as every pattern is right.
    seed : int, 0 or more
        Seed of the first weights and of the order of patterns.
    max_seconds : float, s, above 0, optional
        Ends the training with the best weights so far.

    Attributes
    ----------
    weights_ : float64, shape (trains,), mV
        The weights with most patterns right; the latest of several.
    right_ : float64, shape (epochs done + 1,)
        The share of patterns right after 0, 1, 2 ... epochs.
    epochs_, best_epoch_ : int
        Epochs done, and the epoch after which `weights_` held.
    status_ : {"right", "epochs", "stopped"}
        Every pattern was right; all epochs were used up; Ctrl-C or `max_seconds`.
    neuron_ : Neuron or None
        The neuron as `taxel.Neuron` has it, where it can (`after_spike` "reset").

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    ``change`` is the sum over targets of ``eps(t - t_ij)``, less the same over output spikes. Values marked (†)
    were read in the paper: Gardner and Grüning, "Supervised learning in spiking neural networks for precise temporal
    encoding", PLoS ONE 11(8), e0161335, 2016. Its capacities, 15, 30, 40 patterns at 200, 400, 600 inputs, are rerun
    by ``taxel study rivals``.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(100)], stop=120.0)
    >>> learner = INST(epochs=200)
    >>> learner.fit([trains], [[60.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    _kind = "inst"

    eta: float | None = _DEFAULT.eta
    initial: Sequence[float] | None = _DEFAULT.initial
    epochs: int = _DEFAULT.epochs
    updates: Updates = _DEFAULT.updates
    tau: float = _DEFAULT.tau
    tau_s: float = _DEFAULT.tau_s
    theta_0: float = _DEFAULT.theta_0
    after_spike: AfterSpike = _DEFAULT.after_spike
