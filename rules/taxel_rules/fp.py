"""FP-learning: finite precision, the first error of a trial."""

from __future__ import annotations

from dataclasses import dataclass

from taxel_rules._epochs import AfterSpike, EpochLearner


@dataclass(kw_only=True, eq=False, repr=False)
class FP(EpochLearner):
    """Learn spike times by FP-learning: only the first error of a trial changes weights.

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
    after_spike : {"subtract", "reset"}
        As in `INST`. "membrane" is refused: the rule needs a potential linear in the weights.
    step_ms, within_ms : float, ms, above 0
    until_right : bool
    seed : int, 0 or more
    max_seconds : float, s, above 0, optional
        As in `INST`, from `step_ms` on.
    window_ms : float, ms, above 0
        Largest distance of an output spike from its target; has no default.

    Attributes
    ----------
    weights_, right_, epochs_, best_epoch_, status_, neuron_
        As in `INST`.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    An output spike outside every target's window, or a second one in a window, lowers each weight by the potential of
    its inputs at that time; a target whose window ends without a spike raises it by the potential at the window's end.
    With `after_spike` "reset" inputs before the last output spike have no effect. Memmesheimer, Rubin, Ölveczky and
    Sompolinsky, Neuron 82:925, 2014. The use of only the first error follows Gardner and Grüning (2016); the time at
    which an error is corrected is our reading. The paper's constants were not accessible, so the caller sets them.

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

    _kind = "fp"

    window_ms: float
    after_spike: AfterSpike = "reset"
