"""The base of learners by epochs: fit, predict, one presentation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from inspect import Parameter, signature
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import callback, floats, instance, optional
from taxel.learn._examples import examples
from taxel.learn._learner import SpikeLearner
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_rules import _rules

AfterSpike = Literal["subtract", "membrane", "reset"]
Updates = Literal["batch", "pattern"]
#: How a training ended.
Status = Literal["right", "epochs", "stopped", "assigned"]


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
    step_ms: float = 0.1
    within_ms: float = 1.0
    until_right: bool = True
    seed: int = 0
    max_seconds: float | None = None

    weights_: NDArray[np.float64] = field(init=False)
    right_: NDArray[np.float64] = field(init=False)
    epochs_: int = field(init=False)
    best_epoch_: int = field(init=False)
    status_: Status = field(init=False)
    neuron_: Neuron | None = field(init=False)

    @classmethod
    def _described(cls) -> dict[str, Any]:
        """Return what is known of the parameters: names and defaults are the class's, whose source publishes them."""
        ranges = super()._described()["ranges"]
        defaults = {name: entry.default for name, entry in signature(cls).parameters.items()}
        return {
            "defaults": {name: default for name, default in defaults.items() if default is not Parameter.empty},
            "required": [name for name, default in defaults.items() if default is Parameter.empty],
            "ranges": {name: ranges[name] for name in defaults if name in ranges},
        }

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
        return [_rules.run_epochs(rule, weights, pattern) for pattern in patterns]

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
        trains = instance("pattern", pattern, SpikeTrains)
        change, spikes = _rules.change_epochs(
            self._json(), floats("weights", weights), trains, floats("targets", targets)
        )
        return change, spikes

    def _fitted_neuron(self) -> Neuron | None:
        given = _rules.check_parameters(self._kind, self._json())
        if given["after_spike"] != "reset" or given["tau_s"] is None:
            return None
        return Neuron(
            tau=given["tau"],
            kernel="double_exponential",
            tau_s=given["tau_s"],
            theta_0=given["theta_0"],
            theta_plus=0.0,
            refractory=0.0,
            after_spike="reset",
            time="grid",
            step_ms=given["step_ms"],
        )


def keep(learner: Any, trained: _rules.Trained, *, before: int) -> None:
    """Set the results on the learner, of which `before` precede the first epoch; raise a Ctrl-C again."""
    learner.weights_, learner.right_ = trained.weights, trained.right
    learner.best_epoch_, learner.status_ = trained.best_epoch, trained.ended
    learner.epochs_ = max(len(trained.right) - before, 0)
    if trained.raised is not None:
        raise trained.raised
