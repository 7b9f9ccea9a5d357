"""ReSuMe: the remote supervised method."""

from __future__ import annotations

from dataclasses import dataclass

from taxel_rules._epochs import AfterSpike, EpochLearner


@dataclass(kw_only=True, eq=False, repr=False)
class ReSuMe(EpochLearner):
    """Learn spike times by ReSuMe: an exponential window before targets raises, the same before output spikes lowers.

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
    tau, tau_s : float, ms, above 0
        Membrane and synapse, as in `INST`; neither has a default.
    theta_0 : float, mV, above 0
        Threshold; has no default.
    after_spike : {"subtract", "membrane", "reset"}
        As in `INST`; the paper used leaky integrate and fire ("membrane").
    step_ms, within_ms : float, ms, above 0
    until_right : bool
    seed : int, 0 or more
    max_seconds : float, s, above 0, optional
        As in `INST`, from `step_ms` on.
    a : float, 0 or more
        Change of every weight for each spike, with or without inputs (‡).
    amplitude : float, above 0
        Height of the window (‡).
    tau_w : float, ms, above 0, optional
        Time constant of the window; default: `tau` (‡).

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        As in `INST`.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    ``change`` is the sum over targets of ``a + sum of amplitude * exp(-(t - t_ij) / tau_w)`` over earlier
    inputs, less the same over output spikes: equation 2.10 of Ponulak and Kasiński, Neural Computation 22:467, 2010,
    as the public code Tempotrons.jl (8329a17) cites it; values marked (‡) are that code's defaults. The paper's own
    constants, protocol and epochs were not accessible, so the caller sets them. Its load .04 was measured by Florian
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

    _kind = "resume"

    after_spike: AfterSpike = "membrane"
    a: float = 0.0
    amplitude: float = 1.0
    tau_w: float | None = None
