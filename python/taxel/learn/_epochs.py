"""What learners by epochs share: fit, predict, one presentation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._arguments import callback, floats, instance, parameters, several
from taxel.learn._examples import examples, seconds
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains

__all__ = ["AfterSpike", "EpochLearner", "Updates", "fitted", "keep"]

AfterSpike = Literal["subtract", "membrane", "reset"]
Updates = Literal["batch", "pattern"]

#: Arguments that every rule hands to its training; the rest belong to its neuron or to itself.
_TRAINING = ("eta", "epochs", "updates", "initial", "within_ms", "until_right", "seed")


@dataclass(kw_only=True, eq=False, repr=False)
class EpochLearner(ABC):
    """Learn spike times by epochs: present each pattern, compare the output spikes with the targets, correct.

    What a rule's source gives is its default; `INST`, of which everything was published, says what each parameter is.
    """

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
    status_: Literal["right", "epochs", "stopped"] = field(init=False)
    neuron_: Neuron | None = field(init=False)

    #: Entries of `right_` before the first epoch.
    _LOOKS_BEFORE_THE_FIRST = 1

    def __post_init__(self) -> None:
        seconds(self.max_seconds)
        _core.check_rival(self._json())

    @abstractmethod
    def _law(self) -> dict[str, Any]:
        """Return the rule's own constants, by its name."""

    def _neuron(self) -> dict[str, Any]:
        """Return the stepped neuron."""
        return {
            "tau": self.tau,
            "current": {"exponential": {"tau_s": self.tau_s}},
            "theta_0": self.theta_0,
            "after_spike": self.after_spike,
            "refractory": 0.0,
            "step_ms": self.step_ms,
        }

    def _json(self) -> str:
        training = {name: getattr(self, name) for name in _TRAINING}
        return parameters({"law": self._law(), "neuron": self._neuron(), "training": training})

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
            The same trains in each; signed ones split into ON and OFF.
        targets : sequence of float sequences, ms
            When the neuron shall fire, one list a pattern; an empty one teaches silence.
        start : float64, shape (trains,), mV, optional
            First weights, instead of drawn ones.
        progress : function of (epochs done, share of patterns right), optional
            Called after each epoch; what it raises ends the training.

        Returns
        -------
        EpochLearner
            Itself; ``max_seconds`` ends it with the best weights so far and `status_` "stopped".

        Raises
        ------
        ProblemError : patterns, targets or first weights that make no sense (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the best weights so far are kept
        """
        trains, times = examples(patterns, targets)
        first = None if start is None else floats("start", start)
        if progress is not None:
            callback("progress", progress)
        self.neuron_ = self._fitted_neuron()
        keep(self, _core.fit_rival(self._json(), trains, times, first, seconds(self.max_seconds), progress))
        return self

    def predict(self, patterns: Sequence[SpikeTrains]) -> list[NDArray[np.float64]]:
        """Return the output spikes of the trained neuron, one array a pattern, ms.

        Raises
        ------
        ProblemError : patterns that make no sense, or a learner that was not fitted
        """
        neuron, weights = parameters(self._neuron()), fitted(self)
        given = enumerate(several("patterns", patterns))
        return [_core.run_stepped(neuron, weights, instance(f"pattern {p}", s, SpikeTrains)._parts()) for p, s in given]

    def change(
        self, weights: ArrayLike, pattern: SpikeTrains, targets: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what one presentation asks of the weights, over the learning rate, and the output spikes in it.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        pattern : SpikeTrains
        targets : float64, ms, ascending

        Returns
        -------
        change : float64, shape (trains,)
        spikes : float64, ms

        Raises
        ------
        ProblemError : weights, a pattern or targets that make no sense
        """
        trains = instance("pattern", pattern, SpikeTrains)._parts()
        change, spikes = _core.change_rival(
            self._json(), floats("weights", weights), trains, floats("targets", targets, "ms")
        )
        return change, spikes

    def _fitted_neuron(self) -> Neuron | None:
        stepped = self._neuron()
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

    def __repr__(self) -> str:
        given = type(self).__init__.__kwdefaults__ or {}
        names = type(self).__init__.__annotations__
        values = ((name, getattr(self, name)) for name in names if name != "return")
        shown = (f"{name}={value!r}" for name, value in values if name not in given or value != given[name])
        return f"{type(self).__name__}({', '.join(shown)})"


def keep(learner: Any, trained: tuple[Any, ...]) -> None:
    """Put what was learnt on the learner, then raise the Ctrl-C that may have come meanwhile."""
    weights, right, best_epoch, status, interrupt = trained
    learner.weights_, learner.right_ = weights, right
    learner.best_epoch_, learner.status_ = best_epoch, status
    learner.epochs_ = max(len(right) - learner._LOOKS_BEFORE_THE_FIRST, 0)
    if interrupt is not None:
        raise interrupt


def fitted(learner: Any) -> NDArray[np.float64]:
    """Return the weights of a learner; refuse one that was not fitted."""
    weights = getattr(learner, "weights_", None)
    if weights is None:
        raise _core.ProblemError(f"{type(learner).__name__}: not fitted yet, call fit first")
    return floats("weights_", weights)
