"""Tempotron: a neuron that fires on some patterns, at any time, and not on others."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import callback, flag, floats, instance, optional, several
from taxel._base.errors import refused
from taxel._base.parameters import defaults
from taxel.learn._learner import Learner, patterns_of
from taxel.spikes import SpikeTrains
from taxel_rules import _rules
from taxel_rules._epochs import Status, keep

_DEFAULT = defaults("tempotron", _rules)


@dataclass(kw_only=True, eq=False, repr=False)
class Tempotron(Learner):
    """Learn to fire, at any time, on the patterns with a true label and on no other.

    Parameters
    ----------
    tau, tau_s : float, ms, above 0
        Membrane and synapse: an input of weight 1 causes a potential ``V0 (exp(-s/tau) - exp(-s/tau_s))`` with a peak
        of 1. Default: 15, and `tau` / 4 for `tau_s` (†).
    theta_0 : float, above 0
        Threshold, in the unit of the weights. An output spike shunts inputs: those at or after it have no effect.
    eta : float, above 0, optional
        Learning rate; default: ``3e-3 * T / (tau * trains * V0)`` (†), `T` being the patterns' mean length.
    momentum : float, 0 or more, below 1
        Share of the last change that is added to the next one, from error to error (†).
    initial_sd : float, 0 or more
        Standard deviation of the initial weights, which are drawn from a normal distribution around 0 (†).
    epochs : int, 1 or more
        Largest number of epochs.
    seed : int, 0 or more
        Seed of the initial weights and of the order of patterns.
    max_seconds : float, s, above 0, optional
        Ends the training with the best weights so far.

    Attributes
    ----------
    weights_ : float64, shape (trains,)
        The weights after the epoch with the fewest errors; the latest in case of a tie.
    right_ : float64, shape (epochs done,)
        The share of patterns right at their presentation, epoch by epoch.
    epochs_, best_epoch_ : int
        Number of epochs, and the epoch after which the weights were `weights_`.
    status_ : {"right", "epochs", "stopped"}
        An epoch had no error; all epochs were run; Ctrl-C or `max_seconds` ended the training.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Gütig and Sompolinsky, Nature Neuroscience 9:420, 2006; weights change after each wrong pattern. Values
    marked (†) are those of its capacity runs, from secondary sources and public code (laboratory e89a73a, Tempotrons.jl
    8329a17), not from the paper. The paper's supplement adds a small constant potential, which is omitted here; if the
    potential never rises above rest, the peak of the last input is corrected, as there. Peaks are exact: between inputs
    there is at most one maximum, and its time has a closed form. Cost of a presentation: O(1) an input.

    Examples
    --------
    >>> up = SpikeTrains.from_lists([[10.0], [20.0], [30.0]], stop=60.0)
    >>> down = SpikeTrains.from_lists([[30.0], [20.0], [10.0]], stop=60.0)
    >>> tempotron = Tempotron(eta=0.02, seed=1).fit([up, down], [True, False])
    >>> tempotron.status_, tempotron.predict([up, down])
    ('right', array([ True, False]))
    """

    _kind = "tempotron"
    _compiled: ClassVar[Any] = _rules

    tau: float = _DEFAULT.tau
    tau_s: float | None = _DEFAULT.tau_s
    theta_0: float = _DEFAULT.theta_0
    eta: float | None = _DEFAULT.eta
    momentum: float = _DEFAULT.momentum
    initial_sd: float = _DEFAULT.initial_sd
    epochs: int = _DEFAULT.epochs
    seed: int = _DEFAULT.seed
    max_seconds: float | None = _DEFAULT.max_seconds

    weights_: NDArray[np.float64] = field(init=False)
    right_: NDArray[np.float64] = field(init=False)
    epochs_: int = field(init=False)
    best_epoch_: int = field(init=False)
    status_: Status = field(init=False)

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        labels: ArrayLike,
        *,
        start: ArrayLike | None = None,
        progress: Callable[[int, float], object] | None = None,
    ) -> Self:
        """Learn weights that fire the neuron on the patterns with a true label, and on no other.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF, graded ones are refused.
        labels : bool, shape (patterns,), one or more
            Whether the neuron should fire.
        start : float64, shape (trains,), in thresholds of 1 mV, optional
            Initial weights, instead of random ones.
        progress : function of (epochs done, share of patterns right), optional
            Called after each epoch; an exception that it raises ends the training.

        Returns
        -------
        Tempotron
            Itself; ``max_seconds`` ends it with the best weights so far and `status_` "stopped".

        Raises
        ------
        ProblemError : invalid patterns, labels or first weights
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the weights are the best so far
        """
        trains = patterns_of(patterns)
        truth = _labels(labels)
        first = None if start is None else floats("start", start)
        trained = _rules.fit_tempotron(self._json(), trains, truth, first, optional(callback, "progress", progress))
        keep(self, trained, before=0)
        return self

    def predict(self, patterns: Sequence[SpikeTrains]) -> NDArray[np.bool_]:
        """Return whether the trained neuron fires, pattern by pattern.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each.

        Returns
        -------
        bool, shape (patterns,)

        Raises
        ------
        ProblemError : invalid patterns
        NotFittedError : before `fit`
        """
        weights = self._fitted()
        return np.array([np.isfinite(self.peak(weights, s)[2]) for s in several("patterns", patterns)], dtype=bool)

    def score(self, patterns: Sequence[SpikeTrains], labels: ArrayLike) -> float:
        """Return the share of patterns on which the trained neuron agrees with the label.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each.
        labels : bool, shape (patterns,), one or more
            Whether the neuron should fire.

        Returns
        -------
        float, from 0 to 1

        Raises
        ------
        ProblemError : invalid patterns or labels
        NotFittedError : before `fit`
        """
        fired, truth = self.predict(patterns), _labels(labels)
        if len(truth) != len(fired) or not truth:
            raise refused("labels", f": {len(truth)} for {len(fired)} patterns, must be one per pattern")
        return float(np.mean(fired == np.array(truth)))

    def peak(self, weights: ArrayLike, pattern: SpikeTrains) -> tuple[float, float, float]:
        """Return the largest potential, its time, and the time of the output spike.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        pattern : SpikeTrains

        Returns
        -------
        potential : float, mV
        time : float, ms
        spike : float, ms
            Infinite if the neuron does not fire.

        Raises
        ------
        ProblemError : invalid weights or an invalid pattern

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[10.0], [20.0]], stop=60.0)
        >>> [round(value, 3) for value in Tempotron().peak([0.5, 0.25], trains)]
        [0.614, 24.05, inf]
        """
        trains = instance("pattern", pattern, SpikeTrains)
        return _rules.peak_tempotron(self._json(), floats("weights", weights), trains)

    def change(self, weights: ArrayLike, pattern: SpikeTrains, label: bool) -> NDArray[np.float64]:
        """Return the change of the weights by one presentation, divided by the learning rate: 0 if the neuron is right.

        Parameters
        ----------
        weights : float64, shape (trains,), mV
        pattern : SpikeTrains
        label : bool
            Whether the neuron should fire.

        Returns
        -------
        float64, shape (trains,)
            The potential of each input at the peak: negative for a false spike, positive for a missed one.

        Raises
        ------
        ProblemError : invalid weights, pattern or label
        """
        trains = instance("pattern", pattern, SpikeTrains)
        return _rules.change_tempotron(self._json(), floats("weights", weights), trains, flag("label", label))


def _labels(labels: ArrayLike) -> list[bool]:
    return [flag(f"labels[{p}]", label) for p, label in enumerate(several("labels", labels))]
