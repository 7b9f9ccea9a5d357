"""SKIM: the synaptic kernel inverse method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import instance, number
from taxel._base.parameters import defaults
from taxel.learn._learner import patterns_of
from taxel.spikes import SpikeTrains
from taxel_rules import _rules
from taxel_rules._batch import BatchLearner

_DEFAULT = defaults("skim", _rules)


@dataclass(kw_only=True, eq=False, repr=False)
class SKIM(BatchLearner):
    """Learn by SKIM: least squares from filtered inputs to a pulse at each target, and a threshold on the output.

    Parameters
    ----------
    tau : float, ms, above 0
        Time constant of the kernel; 15, 70 and 190 are those of Tables 6.1 and 6.2.
    kernel : {"alpha", "double_exponential", "exponential"}
        As in `taxel.Neuron`; the thesis uses "alpha" (6.5.4).
    tau_s : float, ms, above 0 and below `tau`, optional
        Second time constant of "double_exponential"; default: ``tau / 4``.
    step_ms : float, ms, above 0
        Time between rows; 1 as the thesis samples.
    pulse_ms : float, ms, above 0
        Duration for which the target output is 1 from a target on; 10 steps of 1 ms (†).
    ridge : float, 0 or more
        Factor of the sum of the squared weights, which is added to the sum of squares.
    branches : int, from 1 to 100000, optional
        Number of dendritic branches of a layer between inputs and output, each with fixed random weights of all trains
        and a fixed random delay. Without it every train is a branch of its own, as in 6.5.4, without a nonlinearity.
    spread : float, above 0, optional
    delay_ms : float, ms, 0 or more, optional
        Fixed weights are drawn uniformly from ``-spread`` to `spread`, delays from 0 to `delay_ms`; both apply to
        `branches` only, and neither was published.
    nonlinearity : {"tanh", "none"}
        Nonlinearity of a branch's potential; applies to `branches` only.
    thresholds : sequence of float
        Thresholds to choose from; .1 to .9 in steps of .1 as in 6.5.4.
    within_ms : float, ms, above 0
        Largest distance of an output spike from a target that it finds; 50 as in 6.5.2.
    seed : int, 0 or more
        Seed of the fixed weights and delays.

    Attributes
    ----------
    weights_ : float64, shape (branches or trains,)
        The least-squares solution of least norm.
    residual_ : float
        The remaining sum of squares, ridge included.
    rows_ : int
        Rows of the least-squares problem.
    threshold_ : float
        The threshold with the fewest missed and false spikes on the training patterns; the lowest of several.
    scores_ : list of (threshold, found, missed, false)
        Counts for each threshold, on the training patterns.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Tapson et al., Frontiers in Neuroscience 7:153, 2013: pulses of 10 steps (†) and a kernel that is then compressed
    are from its Figure 3 and Table 1; its layer sizes, random weights and delays were not accessible. An output spike
    is the first row at or above the threshold after one below it (our reading: the thesis only states that SKIM's
    output needs such a step). Rows are reduced to triangular form block by block by Householder reflections, so memory
    does not grow with the length of the recordings and normal equations are avoided; the triangular system is solved by
    singular values. Cost: O(rows * weights**2).

    Examples
    --------
    >>> from taxel import SpikeTrains
    >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 120, 3)], stop=200.0)
    >>> skim = SKIM(tau=8.0).fit([trains], [[60.0]])
    >>> skim.scores_[0]
    (0.1, 1, 0, 0)
    >>> abs(skim.predict([trains])[0] - 60.0).max() < 10.0
    np.True_
    """

    _kind = "skim"

    tau: float = _DEFAULT.tau
    kernel: Literal["alpha", "double_exponential", "exponential"] = _DEFAULT.kernel
    tau_s: float | None = _DEFAULT.tau_s
    step_ms: float = _DEFAULT.step_ms
    pulse_ms: float = _DEFAULT.pulse_ms
    ridge: float = _DEFAULT.ridge
    branches: int | None = _DEFAULT.branches
    spread: float | None = _DEFAULT.spread
    delay_ms: float | None = _DEFAULT.delay_ms
    nonlinearity: Literal["tanh", "none"] = _DEFAULT.nonlinearity
    thresholds: Sequence[float] = _DEFAULT.thresholds
    within_ms: float = _DEFAULT.within_ms
    seed: int = _DEFAULT.seed

    residual_: float = field(init=False)
    rows_: int = field(init=False)
    threshold_: float = field(init=False)
    scores_: list[tuple[float, int, int, int]] = field(init=False)

    def fit(self, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> Self:
        """Solve for the output weights, and choose the threshold.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF, graded ones are refused. Of any length: a whole
            recording is a pattern.
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern, ascending; empty for a pattern without spikes.

        Returns
        -------
        SKIM
            Itself.

        Raises
        ------
        ProblemError : invalid patterns or targets (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second
        """
        super().fit(patterns, targets)
        self.scores_ = [tuple(score) for score in self._results["scores"]]
        return self

    def rows(self, pattern: SpikeTrains) -> NDArray[np.float64]:
        """Return the rows of the least-squares problem for a pattern, shape (times, branches or trains).

        Parameters
        ----------
        pattern : SpikeTrains

        Returns
        -------
        float64, shape (times, branches or trains)
            A row every `step_ms` from the start of the pattern on.

        Raises
        ------
        ProblemError : an invalid pattern
        """
        trains = instance("pattern", pattern, SpikeTrains)
        count = len(trains) if self.branches is None else int(self.branches)
        return _rules.rows_skim(self._json(), trains._parts()).reshape(-1, max(count, 1))

    def output(self, pattern: SpikeTrains) -> NDArray[np.float64]:
        """Return the output at ``start + k * step_ms``.

        Parameters
        ----------
        pattern : SpikeTrains

        Returns
        -------
        float64, shape (times,)

        Raises
        ------
        ProblemError : an invalid pattern
        NotFittedError : before `fit`

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[float(t)] for t in range(0, 120, 3)], stop=200.0)
        >>> int(SKIM(tau=8.0).fit([trains], [[60.0]]).output(trains).argmax())
        63
        """
        return _rules.output_skim(self._json(), self._fitted(), instance("pattern", pattern, SpikeTrains)._parts())

    def predict(self, patterns: Sequence[SpikeTrains], *, threshold: float | None = None) -> list[NDArray[np.float64]]:
        """Return the times at which the output reaches the threshold, one array a pattern, ms.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        threshold : float, in units of the output, at most 1 at a target, optional
            Default: `threshold_`.

        Returns
        -------
        list of float64, shape (spikes,), ms

        Raises
        ------
        ProblemError : invalid patterns
        NotFittedError : before `fit`
        """
        instead = {} if threshold is None else {"threshold": number("threshold", threshold)}
        return self._fired(patterns_of(patterns), instead)
