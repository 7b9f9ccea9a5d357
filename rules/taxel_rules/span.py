"""SPAN: the spike pattern association neuron."""

from __future__ import annotations

from dataclasses import dataclass

from taxel_rules._epochs import AfterSpike, EpochLearner


@dataclass(kw_only=True, eq=False, repr=False)
class SPAN(EpochLearner):
    """Learn spike times by SPAN: Widrow and Hoff's rule on trains that are all filtered by an alpha kernel.

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
    tau_a : float, ms, above 0
        Time constant of the filter; has no default.

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        As in `INST`.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    With all trains filtered by ``(e / tau_a) s exp(-s / tau_a)``, the integral of input times target less output is,
    in closed form, ``change = (e/2)^2 [sum over targets of (|s| + tau_a) exp(-|s| / tau_a) - the same over output
    spikes]``, `s` from input to spike: inputs after a spike contribute too. Mohemmed, Schliebs, Matsuda and Kasabov,
    Int J Neural Syst 22:1250012, 2012 (rule and filter; the closed form is ours). The paper's constants, epochs and
    criterion were not accessible, so the caller sets them.

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 60, 3)], stop=80.0)
    >>> learner = SPAN(
    ...     tau_a=5.0, eta=0.002, initial=(0.0, 0.5), epochs=200, updates="pattern", tau=10.0, tau_s=5.0, theta_0=1.0
    ... )
    >>> learner.fit([trains], [[40.0]]).status_
    'right'
    >>> len(learner.predict([trains])[0])
    1
    """

    _kind = "span"

    tau_a: float
    after_spike: AfterSpike = "membrane"
