"""SKIM: the synaptic kernel inverse method."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import lfilter

from taxel._base.arguments import instance, number
from taxel._base.errors import refused
from taxel._base.parameters import defaults
from taxel.learn._examples import examples
from taxel.learn._learner import SpikeLearner, patterns_of
from taxel.metrics import matching
from taxel.spikes import SpikeTrains
from taxel_rules import _rules

_DEFAULT = defaults("skim", _rules)

#: Rows that are computed and reduced at once.
_BLOCK = 4096


@dataclass(kw_only=True, eq=False, repr=False)
class SKIM(SpikeLearner):
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
    _compiled: ClassVar[Any] = _rules

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

    weights_: NDArray[np.float64] = field(init=False)
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
        parts, wanted = examples(patterns, targets)
        rows, trains = _rules.rows_skim(self._json(), parts, wanted), patterns_of(patterns)
        triangle = self._reduced(trains, wanted, rows)
        factor, right_side = triangle[:, :-1], triangle[:, -1]
        self.weights_ = np.asarray(np.linalg.lstsq(factor, right_side, rcond=None)[0], np.float64)
        self.residual_, self.rows_ = float(np.sum((factor @ self.weights_ - right_side) ** 2)), sum(rows)
        outputs = [self._output(self.weights_, *of_one) for of_one in zip(trains, rows, strict=True)]
        self.scores_ = []
        for threshold in self.thresholds:
            fired = [self._crossings(*of_one, threshold) for of_one in zip(trains, outputs, strict=True)]
            counts = matching(fired, wanted, window_ms=self.within_ms)
            self.scores_.append((float(threshold), counts.found, counts.missed, counts.false))
        self.threshold_ = min(self.scores_, key=lambda score: (score[2] + score[3], score[0]))[0]
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
        (rows,) = _rules.rows_skim(self._json(), [trains], None)
        return np.concatenate(list(self._blocks(trains, rows)))

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
        weights, trains = self._fitted(), instance("pattern", pattern, SpikeTrains)
        (rows,) = _rules.rows_skim(self._json(), [trains], None)
        return self._output(weights, trains, rows)

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
        weights = self._fitted()
        at = vars(self).get("threshold_") if threshold is None else number("threshold", threshold)
        if at is None:
            raise refused("threshold", ": must be given, because no fit has chosen one")
        trains = patterns_of(patterns)
        rows = _rules.rows_skim(self._json(), trains, None)
        outputs = [self._output(weights, *of_one) for of_one in zip(trains, rows, strict=True)]
        return [self._crossings(*of_one, at) for of_one in zip(trains, outputs, strict=True)]

    def _reduced(
        self, patterns: Sequence[SpikeTrains], targets: Sequence[NDArray[np.float64]], rows: Sequence[int]
    ) -> NDArray[np.float64]:
        """Return the rows, with the wanted output as their last column, brought to triangular form."""
        given = self._given()
        columns = len(patterns[0]) if given.branches is None else given.branches
        triangle = np.zeros((0, columns + 1))
        for pattern, times, count in zip(patterns, targets, rows, strict=True):
            wanted, first = np.zeros(count), 0
            begins, ends = (_first_row(times + later, pattern.start, given.step_ms) for later in (0.0, given.pulse_ms))
            for begin, end in zip(begins, ends, strict=True):
                wanted[begin:end] = 1.0
            for block in self._blocks(pattern, count):
                more = np.column_stack([block, wanted[first : first + len(block)]])
                triangle = _upper(np.vstack([triangle, more]))
                first += len(block)
        if given.ridge:
            triangle = _upper(np.vstack([triangle, np.sqrt(given.ridge) * np.eye(columns, columns + 1)]))
        return triangle

    def _blocks(self, pattern: SpikeTrains, rows: int) -> Iterator[NDArray[np.float64]]:
        """Yield the rows of a pattern, block by block: two numbers of the last one hold all inputs before it."""
        given = self._given()
        step, layer, columns, longest = given.step_ms, None, len(pattern), 0.0
        if given.branches is not None:
            random = np.random.default_rng(given.seed)
            columns, longest = given.branches, given.delay_ms
            weights = random.uniform(-given.spread, given.spread, (len(pattern), columns))
            layer = weights, random.uniform(0.0, longest, columns)
        times, trains = pattern.to_numpy()
        order = np.argsort(times, kind="stable")
        times, trains = times[order], trains[order]
        aa, ba, bb = _decays(given, step)
        a, b = np.zeros((2, columns))
        for first in range(0, rows, _BLOCK):
            count = min(_BLOCK, rows - first)
            begin, end = pattern.start + step * np.array([first - 2, first + count])
            near = slice(*np.searchsorted(times, [begin - longest, end]))
            at, column, weight = _inputs(times[near], trains[near], layer)
            row = _first_row(at, pattern.start, step)
            here = (row >= first) & (row < first + count)
            age = np.maximum(pattern.start + row * step - at, 0.0)[here]
            place, weight = ((row - first) * columns + column)[here], weight[here]
            to_a, to_b, alone = _decays(given, age)
            to_b = alone if given.kernel == "exponential" else to_b
            # Without spikes bincount returns whole numbers.
            added_a, added_b = (
                np.bincount(place, weight * to, count * columns).reshape(count, columns).astype(np.float64)
                for to in (to_a, to_b)
            )
            after, _ = lfilter([1.0], [1.0, -aa], added_a, axis=0, zi=aa * a[None])
            added_b[0] += ba * a
            added_b[1:] += ba * after[:-1]
            potential, _ = lfilter([1.0], [1.0, -bb], added_b, axis=0, zi=bb * b[None])
            a, b = after[-1], potential[-1]
            yield np.tanh(potential) if layer is not None and given.nonlinearity == "tanh" else potential

    def _output(self, weights: NDArray[np.float64], pattern: SpikeTrains, rows: int) -> NDArray[np.float64]:
        columns = len(pattern) if self.branches is None else self.branches
        if len(weights) != columns:
            raise refused("weights_", f" has {len(weights)} entries: must have {columns}, one per column")
        return np.concatenate([block @ weights for block in self._blocks(pattern, rows)])

    def _crossings(self, pattern: SpikeTrains, output: NDArray[np.float64], threshold: float) -> NDArray[np.float64]:
        """Return the times at which the output reaches a threshold from below, ms."""
        above = output >= threshold
        rises = above & ~np.concatenate([[False], above[:-1]])
        return np.asarray(pattern.start + self._given().step_ms * np.flatnonzero(rises), np.float64)

    def _given(self) -> SimpleNamespace:
        """Return the parameters as plain numbers and words."""
        return SimpleNamespace(**self._plain())


def _upper(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the upper triangle of the QR factors of the rows."""
    return np.asarray(np.linalg.qr(rows, mode="r"), np.float64)


def _first_row(times: NDArray[np.float64], start: float, step: float) -> NDArray[np.int64]:
    """Return the first row at or after each time, within rounding."""
    near = np.round((times - start) / step)
    now = start + near * step
    return (near + (times > now + np.maximum(1e-9, 4.0 * np.finfo(np.float64).eps * np.abs(now)))).astype(np.int64)


def _inputs(
    times: NDArray[np.float64], trains: NDArray[np.int64], layer: tuple[NDArray[np.float64], NDArray[np.float64]] | None
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return each input's time, column and weight; a layer, of weights and delays, repeats it in every branch."""
    if layer is None:
        return times, trains, np.ones(len(times))
    weights, delays = layer
    return (times[:, None] + delays).ravel(), np.tile(np.arange(len(delays)), len(times)), weights[trains].ravel()


def _decays(given: SimpleNamespace, ms: Any) -> tuple[Any, Any, Any]:
    """Return what is left after some time of what drives the potential, what that adds to it, what is left of it."""
    decay = np.exp(-ms / given.tau)
    if given.kernel == "alpha":
        return decay, ms / given.tau * decay, decay
    if given.kernel == "exponential":
        return decay, 0.0 * decay, decay
    tau_s = given.tau / 4.0 if given.tau_s is None else given.tau_s
    rate = 1.0 / tau_s - 1.0 / given.tau
    peak = np.log(given.tau / tau_s) / rate
    scale = 1.0 / (np.exp(-peak / given.tau) - np.exp(-peak / tau_s))
    return decay, -scale * decay * np.expm1(-ms * rate), np.exp(-ms / tau_s)
