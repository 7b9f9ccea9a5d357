"""Spiking neurons as classifiers, one per class."""

from __future__ import annotations

import sys
from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib.metadata import entry_points
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, number, several, shown, text
from taxel._base.errors import refused
from taxel._base.parameters import Parameters
from taxel._core import NotFittedError
from taxel.information._labels import labelled, words
from taxel.information.sampling import SampledEvents
from taxel.learn import ConeR
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains, to_ms

__all__ = ["ConeRReadout", "NeuronPerClass", "patterns_of", "readout_names", "readout_responses"]


class NeuronPerClass(Parameters, ABC):
    """Classify by one neuron per class: the class of the highest potential is predicted.

    scikit-learn's `clone` and `cross_val_score` accept it; Python checks the parameters.
    """

    classes_: NDArray[np.generic]
    learners_: list[Any]

    def __init__(self) -> None:
        self._check()

    def fit(self, patterns: Sequence[SpikeTrains], y: ArrayLike) -> Self:
        """Train one neuron per class.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains and window in each.
        y : labels, shape (patterns,)

        Raises
        ------
        ProblemError : patterns or labels that are invalid

        Examples
        --------
        >>> patterns = [SpikeTrains.from_lists([[t], [9.0 - t]], stop=9.0) for t in (1.0, 8.0, 2.0, 7.0)]
        >>> ConeRReadout(tau=3.0, bound=3.0).fit(patterns, ["a", "b"] * 2).classes_.tolist()
        ['a', 'b']
        """
        trains = _listed(self, patterns)
        self.classes_, row = labelled(y, len(trains))
        self.learners_ = [self._trained(trains, row == k) for k in range(len(self.classes_))]
        return self

    def decision_function(self, patterns: Sequence[SpikeTrains]) -> NDArray[np.float64]:
        """Return the potential of each class' neuron that is compared, mV, shape (patterns, classes).

        Parameters
        ----------
        patterns : sequence of SpikeTrains

        Raises
        ------
        ProblemError : not fitted, or patterns that are invalid
        """
        if not hasattr(self, "learners_"):
            raise NotFittedError(f"{type(self).__name__} not fitted yet, call fit first")
        trains = _listed(self, patterns)
        return np.array([[self._potential(learner, s) for learner in self.learners_] for s in trains]).reshape(
            len(trains), len(self.learners_)
        )

    def predict(self, patterns: Sequence[SpikeTrains]) -> NDArray[Any]:
        """Return a label for each pattern.

        Parameters
        ----------
        patterns : sequence of SpikeTrains

        Returns
        -------
        shape (patterns,), of the kind of the labels

        Raises
        ------
        ProblemError : not fitted, or patterns that are invalid

        Examples
        --------
        >>> patterns = [SpikeTrains.from_lists([[t], [9.0 - t]], stop=9.0) for t in (1.0, 8.0, 2.0, 7.0)]
        >>> ConeRReadout(tau=3.0, bound=3.0).fit(patterns, ["a", "b"] * 2).predict(patterns).tolist()
        ['a', 'b', 'a', 'b']
        """
        best = self.decision_function(patterns).argmax(1)
        return np.asarray(self.classes_[best])

    def score(self, patterns: Sequence[SpikeTrains], y: ArrayLike) -> float:
        """Return the share of patterns that are classified correctly.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        y : labels, shape (patterns,)

        Raises
        ------
        ProblemError : not fitted, no pattern, or patterns or labels that are invalid

        Examples
        --------
        >>> patterns = [SpikeTrains.from_lists([[t], [9.0 - t]], stop=9.0) for t in (1.0, 8.0, 2.0, 7.0)]
        >>> ConeRReadout(tau=3.0, bound=3.0).fit(patterns, ["a", "b"] * 2).score(patterns, ["a", "b"] * 2)
        1.0
        """
        found, labels = self.predict(patterns), words("y", y)
        if not 0 < len(labels) == len(found):
            raise refused("y", f" has {len(labels)} entries: must be {max(1, len(found))}, one per pattern")
        return float(np.mean(found == labels))

    def __sklearn_tags__(self) -> Any:
        # Only scikit-learn calls this, so it is installed.
        tags = sys.modules["sklearn.utils"]
        return tags.Tags(
            estimator_type="classifier",
            target_tags=tags.TargetTags(required=True),
            classifier_tags=tags.ClassifierTags(),
            input_tags=tags.InputTags(),
        )

    @abstractmethod
    def _trained(self, trains: list[SpikeTrains], is_of_class: NDArray[np.bool_]) -> Any:
        """Return the trained neuron of one class, given which patterns are of that class."""

    @abstractmethod
    def _potential(self, learner: Any, trains: SpikeTrains) -> float:
        """Return the potential that is compared between classes, mV."""


class ConeRReadout(NeuronPerClass):
    """Classify by one neuron for each class, which `ConeR` trains to fire at the window's end on its class only.

    Parameters
    ----------
    tau : float, ms, above 0
        Time constant of the neurons.
    bound : float, mV, above 0
        The largest absolute weight.
    max_seconds : float, above 0
        Time limit for training a neuron; then the best weights so far are kept.

    Attributes
    ----------
    classes_ : shape (classes,)
    learners_ : list of ConeR

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    Thesis 6.3.3. The class whose neuron's potential is highest at the window's end is predicted.
    """

    learners_: list[ConeR]

    def __init__(self, *, tau: float = 15.0, bound: float = 0.3, max_seconds: float = 10.0) -> None:
        self.tau = tau
        self.bound = bound
        self.max_seconds = max_seconds
        super().__init__()

    def _check(self) -> None:
        for name in ("tau", "bound", "max_seconds"):
            if not 0 < number(name, getattr(self, name)) < np.inf:
                raise refused(name, f" is {shown(getattr(self, name))}: must be above 0, and finite")

    def _trained(self, trains: list[SpikeTrains], is_of_class: NDArray[np.bool_]) -> ConeR:
        targets = [[train.stop] if fires else [] for train, fires in zip(trains, is_of_class, strict=True)]
        neuron = Neuron(tau=self.tau, after_spike="keep", step_ms=1.0)
        learner = ConeR(neuron=neuron, lb=-self.bound, ub=self.bound, max_seconds=self.max_seconds)
        return learner.fit(trains, targets)

    def _potential(self, learner: ConeR, trains: SpikeTrains) -> float:
        return float(learner.neuron_.potential(learner.weights_, trains, [trains.stop])[0])


def patterns_of(spikes: SampledEvents, window_us: float) -> list[SpikeTrains]:
    """Return each trial's events as spike trains, ON and OFF of each taxel that ever sends one.

    Parameters
    ----------
    spikes : SampledEvents
    window_us : float, us

    Returns
    -------
    list of SpikeTrains
        Time 0 is the trial's first event.
    """
    inside = np.flatnonzero(spikes.bin < spikes.bins_to(window_us)[spikes.trial])
    sign = (spikes.value[inside] < 0).astype(np.int64)
    active, train = np.unique(2 * spikes.taxel[inside] + sign, return_inverse=True)
    trial, times = spikes.trial[inside], spikes.bin[inside] * (to_ms(spikes.period_us))
    order = np.lexsort((times, train, trial))
    key = trial[order] * len(active) + train[order]
    offsets = np.searchsorted(key, np.arange(spikes.trials * len(active) + 1))
    times, patterns = times[order], []
    for k in range(spikes.trials):
        of_trial = offsets[k * len(active) : (k + 1) * len(active) + 1]
        patterns.append(SpikeTrains(times[of_trial[0] : of_trial[-1]], of_trial - of_trial[0], 0.0, to_ms(window_us)))
    return patterns


def readout_names() -> tuple[str, ...]:
    """Return the names of classifiers of spikes: "cone_r" and the entry points of the group ``taxel.classifiers``.

    Such an entry point names a `NeuronPerClass` whose time constant is the argument `tau`, ms.
    """
    return ("cone_r", *sorted(entry_points(group="taxel.classifiers").names))


def readout_responses(
    name: str, spikes: SampledEvents, window_us: float, labels: NDArray[np.generic], folds: NDArray[np.int64]
) -> NDArray[np.generic]:
    """Predict each trial's label by neurons that were trained on the other folds.

    Parameters
    ----------
    name : str
        One of `readout_names`.
    spikes : SampledEvents
    window_us : float, us
    labels : labels, shape (trials,)
    folds : int64, shape (trials,), counted from 0

    Returns
    -------
    shape (trials,)
    """
    text("name", name, readout_names())
    kind = ConeRReadout if name == "cone_r" else entry_points(group="taxel.classifiers")[name].load()
    patterns = patterns_of(spikes, window_us)
    responses = np.empty_like(labels)
    # With a far shorter constant the potential at the window's end would hold nothing of its beginning.
    tau = max(1.0, to_ms(window_us) / 3)
    for fold in np.unique(folds):
        train, test = np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)
        model = kind(tau=tau).fit([patterns[k] for k in train], labels[train])
        responses[test] = model.predict([patterns[k] for k in test])
    return responses


def _listed(reader: object, patterns: object) -> list[SpikeTrains]:
    """Return the patterns; refuse graded ones on behalf of `reader`."""
    name = type(reader).__name__
    return [
        instance(f"pattern {k}", pattern, SpikeTrains)._ungraded(name)
        for k, pattern in enumerate(several("patterns", patterns))
    ]
