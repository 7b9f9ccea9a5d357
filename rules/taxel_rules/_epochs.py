"""The base of learners by epochs: fit, predict, one presentation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import callback, floats, instance, optional
from taxel._base.parameters import defaults
from taxel.learn._examples import examples
from taxel.learn._learner import SpikeLearner
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_rules import _rules

AfterSpike = Literal["subtract", "membrane", "reset"]
Updates = Literal["batch", "pattern"]
#: How a training ended.
Status = Literal["right", "epochs", "stopped", "assigned"]

#: The defaults of all rules.
_DEFAULT = defaults("inst", _rules)


@dataclass(kw_only=True, eq=False, repr=False)
class EpochLearner(SpikeLearner):
    """Learn spike times in epochs: present each pattern, compare its output spikes with the targets, change weights.

    Defaults are the published values of a rule. `INST`, whose values were all published, documents each parameter.
    """

    _compiled: ClassVar[Any] = _rules

    eta: float | None
    initial: Sequence[float] | None
    epochs: int
    updates: Updates
    tau: float
    tau_s: float | None
    theta_0: float
    after_spike: AfterSpike | None
    step_ms: float = _DEFAULT.step_ms
    within_ms: float = _DEFAULT.within_ms
    until_right: bool = _DEFAULT.until_right
    seed: int = _DEFAULT.seed
    max_seconds: float | None = _DEFAULT.max_seconds

    weights_: NDArray[np.float64] = field(init=False)
    right_: NDArray[np.float64] = field(init=False)
    epochs_: int = field(init=False)
    best_epoch_: int = field(init=False)
    status_: Status = field(init=False)
    neuron_: Neuron | None = field(init=False)

    def _plain(self) -> dict[str, Any]:
        return {"name": self._kind} | super()._plain()

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        start: ArrayLike | None = None,
        progress: Callable[[int, float], object] | None = None,
    ) -> Self:
        """Learn weights that fire the neuron at the targets and nowhere else.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF, graded ones are refused.
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern; empty for a pattern without spikes.
        start : float64, shape (trains,), mV, optional
            Initial weights, instead of random ones.
        progress : function of (epochs done, share of patterns right), optional
            Called after each epoch; an exception that it raises ends the training.

        Returns
        -------
        EpochLearner
            Itself; ``max_seconds`` ends it with the best weights so far and `status_` "stopped".

        Raises
        ------
        ProblemError : invalid patterns, targets or first weights (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the weights are the best so far
        """
        trains, times = examples(patterns, targets)
        first = None if start is None else floats("start", start)
        self.neuron_ = self._fitted_neuron()
        trained = _rules.fit_epochs(self._json(), trains, times, first, optional(callback, "progress", progress))
        keep(self, trained, before=1)
        return self

    def _fired(self, patterns: list[SpikeTrains]) -> list[NDArray[np.float64]]:
        rule, weights = self._json(), self._fitted()
        return [_rules.run_epochs(rule, weights, pattern._parts()) for pattern in patterns]

    def change(
        self, weights: ArrayLike, pattern: SpikeTrains, targets: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the change of the weights by one presentation, divided by the learning rate, and its output spikes.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        pattern : SpikeTrains
        targets : float64, shape (targets,), ms, ascending

        Returns
        -------
        change : float64, shape (trains,)
        spikes : float64, ms

        Raises
        ------
        ProblemError : invalid weights, pattern or targets
        """
        trains = instance("pattern", pattern, SpikeTrains)._parts()
        change, spikes = _rules.change_epochs(
            self._json(), floats("weights", weights), trains, floats("targets", targets, "ms")
        )
        return change, spikes

    def _fitted_neuron(self) -> Neuron | None:
        stepped = _rules.check_parameters(self._kind, self._json())["neuron"]
        if stepped["after_spike"] != "reset" or "exponential" not in stepped["current"]:
            return None
        return Neuron(
            tau=stepped["tau"],
            kernel="double_exponential",
            tau_s=stepped["current"]["exponential"]["tau_s"],
            theta_0=stepped["theta_0"],
            theta_plus=0.0,
            refractory=0.0,
            after_spike="reset",
            time="grid",
            step_ms=stepped["step_ms"],
        )


def keep(learner: Any, trained: _rules.Trained, *, before: int) -> None:
    """Set the results on the learner, of which `before` precede the first epoch; raise a Ctrl-C again."""
    learner.weights_, learner.right_ = trained.weights, trained.right
    learner.best_epoch_, learner.status_ = trained.best_epoch, trained.ended
    learner.epochs_ = max(len(trained.right) - before, 0)
    if trained.raised is not None:
        raise trained.raised
