"""CONE-R: the best weights where targets and silence cannot all be met."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._arguments import callback, floats, instance, parameters, several
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains

__all__ = ["ConeR", "ConeRProblem"]

_NEURON = (
    "tau",
    "theta_0",
    "theta_plus",
    "tau_rec",
    "refractory",
    "after_spike",
    "first_threshold",
    "step_ms",
    "kernel",
    "tau_s",
)


class ConeR:
    """Learn weights by CONE-R: minimise norms, missed lift behind targets, missed targets and broken silence.

    The defaults are those of Tables 6.1 and 6.2. The neuron runs on a grid, as 6.13 is a sum over grid points; targets
    keep their true times.

    Parameters
    ----------
    tau, theta_0, theta_plus, tau_rec, refractory, after_spike, first_threshold, step_ms, kernel, tau_s
        The neuron, as in `taxel.Neuron`; `step_ms` is also the step of the silent rows.
    kappa : float, above 0
        What the potential shall reach behind a target, in thresholds.
    delta_t_ms : float, ms, optional
        How far behind; ``0.1 * tau`` where left out.
    lambdas : five floats, 0 or more
        Shares of l1, l2, B, C, D in the objective; only their ratios matter.
    lb, ub : float, mV
        Least and largest weight. All normalisers are taken at ``-max(|lb|, |ub|)`` and ``+max(|lb|, |ub|)``.
    divide_b_by : {"B_max", "targets"}
        B over its largest value, as printed, or over the number of targets.
    norm : {"norm", "square"}
        The l2 term as printed, or squared.
    margin : float, mV, 0 or more
        How far below the threshold silence shall stay.
    horizon : float, ms, optional
        Where silent rows end; the later of the pattern's stop and its last target + `tau` where left out.
    tolerance : float
        The proven relative gap at which a fit counts as solved.

    Attributes
    ----------
    weights_ : float64, shape (trains,), mV
    objective_ : float
        6.14 at these weights.
    parts_ : dict of float
        Its terms "l1", "l2", "B", "C", "D", weighted and normalised: their sum is the objective.
    gap_ : float
        How far, relative to it, the objective can lie above the least one: a proven bound.
    status_ : {"solved", "stopped"}
        "stopped": the gap is above `tolerance`.
    rounds_, rows_ : int
        Rounds of row generation, rows in the last one.
    silent_rows_ : int
        Rows of 6.13.
    unreachable_ : list of (pattern, target)
        Targets that no weights within the bounds bring to the threshold; the rest is fitted.
    refires_ : int
        Output spikes on the training patterns within `tau` of another one, with no target between.
    neuron_ : Neuron
        The neuron that the weights are for.

    Raises
    ------
    ProblemError : a parameter that makes no sense

    Notes
    -----
    Thesis 6.3.3, equations 6.12 to 6.14. Solved by row generation around the cone solver Clarabel; the gap is computed
    apart from it, over all rows. Choices that the thesis leaves open stand on the page *Readings*.

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = ConeR(tau=10.0, lb=-1.0, ub=1.0, after_spike="reset").fit([trains], [[20.0]])
    >>> cone.status_
    'solved'
    >>> cone.neuron_.run(cone.weights_, trains, threshold=0.999)  # a target is met to rounding, from below as well
    array([20.])
    """

    weights_: NDArray[np.float64]
    objective_: float
    parts_: dict[str, float]
    gap_: float
    status_: Literal["solved", "stopped"]
    rounds_: int
    rows_: int
    silent_rows_: int
    unreachable_: list[tuple[int, int]]
    refires_: int
    neuron_: Neuron

    def __init__(
        self,
        *,
        tau: float = 15.0,
        theta_0: float = 0.3,
        theta_plus: float = 0.2,
        tau_rec: float | None = None,
        refractory: float = 3.0,
        after_spike: Literal["keep", "ignore", "reset"] = "keep",
        first_threshold: Literal["theta_0", "printed"] = "theta_0",
        step_ms: float = 1.0,
        kernel: Literal["alpha", "double_exponential", "exponential"] = "alpha",
        tau_s: float | None = None,
        kappa: float = 1.2,
        delta_t_ms: float | None = None,
        lambdas: Sequence[float] = (2.8, 1.2, 100.0, 100.0, 80.0),
        lb: float = -0.3,
        ub: float = 0.3,
        divide_b_by: Literal["B_max", "targets"] = "B_max",
        norm: Literal["norm", "square"] = "norm",
        margin: float = 0.0,
        horizon: float | None = None,
        tolerance: float = 1e-6,
    ) -> None:
        self.tau = tau
        self.theta_0 = theta_0
        self.theta_plus = theta_plus
        self.tau_rec = tau_rec
        self.refractory = refractory
        self.after_spike: Literal["keep", "ignore", "reset"] = after_spike
        self.first_threshold: Literal["theta_0", "printed"] = first_threshold
        self.step_ms = step_ms
        self.kernel: Literal["alpha", "double_exponential", "exponential"] = kernel
        self.tau_s = tau_s
        self.kappa = kappa
        self.delta_t_ms = delta_t_ms
        self.lambdas = lambdas
        self.lb = lb
        self.ub = ub
        self.divide_b_by = divide_b_by
        self.norm = norm
        self.margin = margin
        self.horizon = horizon
        self.tolerance = tolerance
        _core.check_cone_r(self._json())

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        start: ArrayLike | None = None,
        progress: Callable[[int, int, float, float], object] | None = None,
    ) -> Self:
        """Learn the weights that fire the neuron at the targets and nowhere else.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each; signed ones split into ON and OFF.
        targets : sequence of float sequences, ms
            When the neuron shall fire, one list a pattern; an empty one teaches silence.
        start : float64, shape (trains,), mV, optional
            Weights of a similar fit (other `lambdas`, other `kappa`): the closer, the quicker. The result is the same.
        progress : function of (round, rows, objective, gap), optional
            Called after each round.

        Returns
        -------
        ConeR
            Itself.

        Raises
        ------
        ProblemError : patterns or targets that make no sense (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second

        Warns
        -----
        UserWarning : targets out of reach; a neuron that fires again and again after its own spikes; a gap left open
        """
        self.prepare(patterns, targets).fit(self, start=start, progress=progress)
        return self

    def prepare(self, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> ConeRProblem:
        """Lay out the rows of these examples, to be fitted with many `lambdas`, `kappa`, bounds and divisors.

        Parameters
        ----------
        patterns, targets
            As in `fit`.

        Returns
        -------
        ConeRProblem

        Raises
        ------
        ProblemError : patterns or targets that make no sense (names pattern and target)
        """
        return ConeRProblem(self, patterns, targets)

    def _json(self) -> str:
        values = {name: value for name, value in vars(self).items() if not name.endswith("_")}
        neuron = {name: values.pop(name) for name in _NEURON}
        return parameters({"neuron": {**neuron, "time": "grid"}, **values})

    def __repr__(self) -> str:
        default = ConeR.__init__.__kwdefaults__ or {}
        values = ((name, getattr(self, name)) for name in default)
        return f"ConeR({', '.join(f'{name}={value!r}' for name, value in values if value != default[name])})"


class ConeRProblem:
    """The rows of one set of examples; made by `ConeR.prepare`.

    Attributes
    ----------
    silent_rows : int
        Rows that demand silence.
    """

    def __init__(self, cone: ConeR, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> None:
        trains = [
            instance(f"pattern {p}", pattern, SpikeTrains) for p, pattern in enumerate(several("patterns", patterns))
        ]
        times = [floats(f"targets of pattern {p}", t) for p, t in enumerate(several("targets", targets))]
        self._problem = _core.ConeRProblem(instance("cone", cone, ConeR)._json(), [p._parts() for p in trains], times)
        self.silent_rows: int = self._problem.silent_rows

    def fit(
        self,
        cone: ConeR,
        *,
        start: ArrayLike | None = None,
        progress: Callable[[int, int, float, float], object] | None = None,
    ) -> ConeR:
        """Fit a learner on these rows.

        Parameters
        ----------
        cone : ConeR
            May differ from the one that laid out the rows in `lambdas`, `kappa`, `lb`, `ub`, `divide_b_by`, `norm` and
            `tolerance`.
        start, progress
            As in `ConeR.fit`.

        Returns
        -------
        ConeR
            The learner, fitted.

        Raises
        ------
        ProblemError : a learner that needs other rows
        """
        first = None if start is None else floats("start", start)
        if progress is not None:
            callback("progress", progress)
        instance("cone", cone, ConeR)
        found = self._problem.fit(cone._json(), first, progress)
        weights, objective, parts, gap, rounds, rows, solved, unreachable, refires = found
        cone.weights_ = weights
        cone.objective_ = objective
        cone.parts_ = dict(zip(("l1", "l2", "B", "C", "D"), parts, strict=True))
        cone.gap_ = gap
        cone.status_ = "solved" if solved else "stopped"
        cone.rounds_, cone.rows_, cone.silent_rows_ = rounds, rows, self.silent_rows
        cone.unreachable_ = unreachable
        cone.refires_ = refires
        cone.neuron_ = Neuron(**{name: getattr(cone, name) for name in _NEURON}, time="grid")
        _warn(cone)
        return cone


def _warn(cone: ConeR) -> None:
    if cone.unreachable_:
        named = ", ".join(f"pattern {p} target {k}" for p, k in cone.unreachable_[:5])
        more = f" and {len(cone.unreachable_) - 5} more" if len(cone.unreachable_) > 5 else ""
        warnings.warn(
            f"no weights within {cone.lb} to {cone.ub} mV bring {named}{more} to the threshold; the rest was fitted",
            stacklevel=4,
        )
    if cone.refires_:
        warnings.warn(
            f"the trained neuron fires again {cone.refires_} times after its own spikes on its training patterns: "
            f'after_spike is "{cone.after_spike}"; "reset", a longer refractory or a larger theta_plus would end that',
            stacklevel=4,
        )
    if cone.status_ != "solved":
        warnings.warn(
            f"the objective is only proven to lie within {cone.gap_:.1e} of its least value (tolerance "
            f"{cone.tolerance:.1e})",
            stacklevel=4,
        )
