"""SKIM: the synaptic kernel inverse method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._arguments import floats, instance, number, parameters, several, text
from taxel._core import ProblemError
from taxel.learn._epochs import fitted
from taxel.learn._examples import examples
from taxel.spikes import SpikeTrains

__all__ = ["SKIM"]


class SKIM:
    """Learn by SKIM: least squares from filtered inputs to a pulse at each target, then a threshold on the output.

    Parameters
    ----------
    tau : float, ms, above 0
        Time constant of the kernel; 15, 70 and 190 are those of Tables 6.1 and 6.2.
    kernel : {"alpha", "double_exponential", "exponential"}
        As in `taxel.Neuron`; the thesis takes "alpha" (6.5.4).
    tau_s : float, ms, above 0 and below `tau`, optional
        Second time constant of "double_exponential"; ``tau / 4`` where left out.
    step_ms : float, ms, above 0
        Time between rows; 1 as the thesis samples.
    pulse_ms : float, ms, above 0
        How long the wanted output is 1 from a target on; 10 steps of 1 ms (†).
    ridge : float, 0 or more
        Added to the sum of squares, times the squares of the weights.
    branches : int, 1 or more, optional
        A wide layer of so many dendritic branches between inputs and output, each with fixed random weights of all
        trains and a fixed random delay. Without it every train is a branch of its own, as in 6.5.4, and its kernel is
        not compressed.
    spread, delay_ms : float
        Fixed weights are drawn evenly from ``-spread`` to `spread`, delays from 0 to `delay_ms`; both belong to
        `branches` and have no default.
    nonlinearity : {"tanh", "none"}
        What compresses a branch's potential; belongs to `branches`.
    thresholds : sequence of float
        Those to choose from; .1 to .9 by .1 as in 6.5.4.
    within_ms : float, ms, above 0
        A target is found where an output spike lies within this of it; 50 as in 6.5.2.
    seed : int, 0 or more
        Of fixed weights and delays.

    Attributes
    ----------
    weights_ : float64, shape (branches or trains,)
        The shortest of the least-squares solutions.
    residual_ : float
        The sum of squares that is left, ridge included.
    rows_ : int
        Rows of the least-squares problem.
    threshold_ : float
        The one with the fewest missed and false spikes on the training patterns; the lowest of several.
    scores_ : list of (threshold, found, missed, false)
        Of each threshold, on the training patterns.

    Raises
    ------
    ProblemError : a parameter that makes no sense

    Notes
    -----
    Tapson et al., Frontiers in Neuroscience 7:153, 2013: pulses of 10 steps (†) and a kernel that is then compressed
    were read in its Figure 3 and Table 1; its layer sizes, random weights and delays could not be read. An output
    spike is the first row at or above the threshold after one below it (a reading of ours: the thesis only says that
    SKIM's output needs such a step). Rows are brought to triangular form block by block, by reflections, so memory
    does not grow with the recordings' length and no digits are lost to normal equations; the rest is
    `numpy.linalg.lstsq`. Cost: O(rows * weights**2).

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

    weights_: NDArray[np.float64]
    residual_: float
    rows_: int
    threshold_: float
    scores_: list[tuple[float, int, int, int]]

    def __init__(
        self,
        *,
        tau: float = 15.0,
        kernel: Literal["alpha", "double_exponential", "exponential"] = "alpha",
        tau_s: float | None = None,
        step_ms: float = 1.0,
        pulse_ms: float = 10.0,
        ridge: float = 0.0,
        branches: int | None = None,
        spread: float | None = None,
        delay_ms: float | None = None,
        nonlinearity: Literal["tanh", "none"] = "tanh",
        thresholds: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
        within_ms: float = 50.0,
        seed: int = 0,
    ) -> None:
        self.tau = tau
        self.kernel = kernel
        self.tau_s = tau_s
        self.step_ms = step_ms
        self.pulse_ms = pulse_ms
        self.ridge = ridge
        self.branches = branches
        self.spread = spread
        self.delay_ms = delay_ms
        self.nonlinearity = nonlinearity
        self.thresholds = thresholds
        self.within_ms = within_ms
        self.seed = seed
        self._levels()
        self._window()
        _core.check_skim(self._json())

    def _json(self) -> str:
        layer = None
        if self.branches is not None:
            for name, value in (("spread", self.spread), ("delay_ms", self.delay_ms)):
                if value is None:
                    raise ProblemError(f"{name}: none was published for a layer of branches, give one")
            compressed = text("nonlinearity", self.nonlinearity, ("tanh", "none")) == "tanh"
            layer = {"count": self.branches, "spread": self.spread, "delay_ms": self.delay_ms, "tanh": compressed}
        names = ("kernel", "tau", "tau_s", "step_ms", "pulse_ms", "ridge", "seed")
        return parameters({**{name: getattr(self, name) for name in names}, "branches": layer})

    def _levels(self) -> NDArray[np.float64]:
        levels = floats("thresholds", self.thresholds)
        if not len(levels) or not np.all(np.isfinite(levels)):
            raise ProblemError("thresholds: must be finite, and at least one")
        return levels

    def _window(self) -> float:
        window = number("within_ms", self.within_ms, "ms")
        if not window > 0:
            raise ProblemError(f"within_ms is {window} ms: must be above 0")
        return window

    def fit(self, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> Self:
        """Solve for the output weights, and choose the threshold.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF. Of any length: a whole recording is a pattern.
        targets : sequence of float sequences, ms
            When the output shall be 1, one list a pattern, ascending; an empty one teaches silence.

        Returns
        -------
        SKIM
            Itself.

        Raises
        ------
        ProblemError : patterns or targets that make no sense (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second
        """
        trains, times = examples(patterns, targets)
        r, z, rest, self.rows_ = _core.reduce_skim(self._json(), trains, times)
        r = r.reshape(len(z), len(z))
        self.weights_ = np.asarray(np.linalg.lstsq(r, z, rcond=None)[0], dtype=np.float64)
        self.residual_ = float(rest + np.sum((r @ self.weights_ - z) ** 2))
        outputs = [_core.output_skim(self._json(), self.weights_, parts) for parts in trains]
        self.scores_ = []
        for level in self._levels():
            counts = np.zeros(3, dtype=int)
            for output, pattern, wanted in zip(outputs, patterns, times, strict=True):
                counts += _matched(self._crossings(output, pattern.start, float(level)), wanted, self._window())
            self.scores_.append((float(level), int(counts[0]), int(counts[1]), int(counts[2])))
        self.threshold_ = min(self.scores_, key=lambda score: (score[2] + score[3], score[0]))[0]
        return self

    def rows(self, pattern: SpikeTrains) -> NDArray[np.float64]:
        """Return the rows of the least-squares problem that a pattern gives, shape (times, branches or trains).

        Raises
        ------
        ProblemError : a pattern that makes no sense
        """
        trains = instance("pattern", pattern, SpikeTrains)
        count = len(trains) if self.branches is None else int(self.branches)
        return _core.rows_skim(self._json(), trains._parts()).reshape(-1, max(count, 1))

    def output(self, pattern: SpikeTrains) -> NDArray[np.float64]:
        """Return the output at ``start + k * step_ms``.

        Raises
        ------
        ProblemError : a pattern that makes no sense, or a learner that was not fitted
        """
        return _core.output_skim(self._json(), fitted(self), instance("pattern", pattern, SpikeTrains)._parts())

    def predict(self, patterns: Sequence[SpikeTrains], *, threshold: float | None = None) -> list[NDArray[np.float64]]:
        """Return when the output comes up to the threshold, one array a pattern, ms.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        threshold : float, optional
            `threshold_` where left out.

        Raises
        ------
        ProblemError : patterns that make no sense, or a learner that was not fitted
        """
        fitted(self)
        level = self.threshold_ if threshold is None else number("threshold", threshold)
        return [
            self._crossings(self.output(s), s.start, level)
            for s in (instance(f"pattern {p}", s, SpikeTrains) for p, s in enumerate(several("patterns", patterns)))
        ]

    def _crossings(self, output: NDArray[np.float64], start: float, level: float) -> NDArray[np.float64]:
        above = output >= level
        rows = np.flatnonzero(above & ~np.concatenate([[False], above[:-1]]))
        return floats("crossings", start + rows * float(self.step_ms))

    def __repr__(self) -> str:
        given = type(self).__init__.__kwdefaults__ or {}
        shown = (f"{name}={getattr(self, name)!r}" for name in given if getattr(self, name) != given[name])
        return f"SKIM({', '.join(shown)})"


def _matched(spikes: NDArray[np.float64], targets: NDArray[np.float64], window: float) -> tuple[int, int, int]:
    """Return how many targets are found, how many missed, how many spikes false: as many pairs, in order, as go."""
    found, next_spike = 0, 0
    for target in targets:
        while next_spike < len(spikes) and spikes[next_spike] < target - window:
            next_spike += 1
        if next_spike < len(spikes) and spikes[next_spike] <= target + window:
            found, next_spike = found + 1, next_spike + 1
    return found, len(targets) - found, len(spikes) - found
