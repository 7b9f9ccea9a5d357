"""INST: weights by instantaneous differences of output spikes and targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel_rules._epochs import AfterSpike, EpochLearner, Updates


@dataclass(kw_only=True, eq=False, repr=False)
class INST(EpochLearner):
    """Learn spike times by INST: weights change by the potential of inputs at targets less that at output spikes.

    Parameters
    ----------
    eta : float, above 0, optional
        Learning rate, weight a unit of `change`; default: ``600 / (trains * targets of all patterns)`` (†).
    initial : (float, float), mV, optional
        Range of the initial weights, which are drawn uniformly; default: ``(0, 200 / trains)`` (†).
    epochs : int, 1 or more
        Largest number of epochs (†).
    updates : {"batch", "pattern"}
        Whether weights change once an epoch (†), or after each pattern in random order.
    tau, tau_s : float, ms, above 0
        Membrane and synapse: an input of weight 1 causes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` with a peak
        of 1 mV. (†)
    theta_0 : float, mV, above 0
        Threshold. (†)
    after_spike : {"subtract", "membrane", "reset"}
        Effect of an output spike: the potential falls by ``theta_0 exp(-s/tau)`` (†); it is set to 0 and currents
        continue (leaky integrate and fire); or all inputs up to the spike are dropped.
    step_ms : float, ms, above 0
        Interval between comparisons of potential and threshold; inputs keep their exact times.
    within_ms : float, ms, above 0
        A pattern is right if it has exactly one output spike a target, each within this distance of its target.
    until_right : bool
        Whether to end as soon as every pattern is right.
    seed : int, 0 or more
        Seed of the initial weights and of the order of patterns.
    max_seconds : float, s, above 0, optional
        Ends the training with the best weights so far.

    Attributes
    ----------
    weights_ : float64, shape (trains,), mV
        The weights with the most patterns right; the latest in case of a tie.
    right_ : float64, shape (epochs done + 1,)
        The share of patterns right after 0, 1, 2 ... epochs.
    epochs_, best_epoch_ : int
        Number of epochs, and the epoch after which the weights were `weights_`.
    status_ : {"right", "epochs", "stopped"}
        Every pattern was right; all epochs were run; Ctrl-C or `max_seconds` ended the training.
    neuron_ : Neuron or None
        The equivalent `taxel.Neuron`; None if there is none (`after_spike` other than "reset").

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    ``change`` is the sum over targets of ``eps(t - t_ij)``, less the same over output spikes. Values marked (†)
    are from the paper: Gardner and Grüning, "Supervised learning in spiking neural networks for precise temporal
    encoding", PLoS ONE 11(8), e0161335, 2016. ``taxel study rivals`` repeats its capacities, 15, 30, 40 patterns at
    200, 400, 600 inputs.

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

    eta: float | None = None
    initial: Sequence[float] | None = None
    epochs: int = 500
    updates: Updates = "batch"
    tau: float = 10.0
    tau_s: float = 5.0
    theta_0: float = 15.0
    after_spike: AfterSpike = "subtract"
