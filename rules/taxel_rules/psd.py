"""PSD: precise-spike-driven plasticity."""

from __future__ import annotations

from dataclasses import dataclass

from taxel_rules._epochs import AfterSpike, EpochLearner


@dataclass(kw_only=True, eq=False, repr=False)
class PSD(EpochLearner):
    """Learn spike times by PSD: weights change by the current of inputs at targets less that at output spikes.

    Parameters
    ----------
    eta : float, above 0
        Learning rate, weight a unit of `change`; `eta`, `initial`, `epochs` and `updates` have no default.
    initial : (float, float), mV
        Range of the initial weights, which are drawn uniformly.
    epochs : int, 1 or more
        Largest number of epochs.
    updates : {"batch", "pattern"}
        Whether weights change once an epoch, or after each pattern in random order.
    tau : float, ms, above 0
        Membrane (‡).
    tau_s : float, ms, above 0 and below `tau`, optional
        If given, the neuron is that of `INST`, driven by a current ``exp(-s/tau_s)`` whose potential has a peak of 1
        mV, and the current of `tau_1` and `tau_2` is used by the rule only.
    theta_0 : float, mV, above 0
        Threshold; has no default.
    after_spike : {"subtract", "membrane", "reset"}
        As in `INST`; the paper used leaky integrate and fire ("membrane").
    step_ms, within_ms : float, ms, above 0
    until_right : bool
    seed : int, 0 or more
    max_seconds : float, s, above 0, optional
        As in `INST`, from `step_ms` on.
    tau_1, tau_2 : float, ms, above 0
        Slow and fast time constant of the current ``V0 (exp(-s/tau_1) - exp(-s/tau_2))``, peak 1, which the membrane
        filters once more, over 1 MOhm (‡).
    refractory : float, ms, 0 or more
        Time at which the membrane stays at 0 after a spike; with "membrane" only.

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        As in `INST`.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    ``change`` is the sum over targets of the current of earlier inputs, less the same over output spikes: Yu,
    Tang, Tan and Li, PLoS ONE 8(11), e78318, 2013. Values marked (‡), and the step, are from public MATLAB code
    (Zyj061/SNN_Sparse_temporal_coding, cf813da), not from the paper, whose protocol and criterion were not accessible;
    the caller sets the other parameters.

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

    _kind = "psd"

    tau: float = 10.0
    tau_s: float | None = None
    tau_1: float = 10.0
    tau_2: float = 2.5
    after_spike: AfterSpike = "membrane"
    refractory: float = 0.0
