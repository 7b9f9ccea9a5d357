"""CONE-R: the best weights when no weights satisfy all targets and all silence."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import callback, floats, instance, optional, parameters, several
from taxel._base.errors import refused
from taxel._base.messages import counted, warn
from taxel._base.parameters import defaults
from taxel._core import NotFittedError
from taxel.learn._examples import examples, windows
from taxel.learn._learner import SpikeLearner, Status
from taxel.learn.cone_x import Multipliers, _multipliers
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains

_DEFAULT = defaults("cone_r")
#: The most trains with spikes in a fit: their Hessian needs 1.6 GB, and a step half a minute.
_MOST_TRAINS = 10_000


@dataclass(kw_only=True, eq=False, repr=False)
class ConeR(SpikeLearner):
    """Learn weights by CONE-R: minimise norms, lack of potential after targets, missed targets and violated silence.

    The defaults are those of Tables 6.1 and 6.2. The neuron runs on a grid, as 6.13 is a sum over grid points; targets
    keep their true times.

    Parameters
    ----------
    neuron : Neuron, optional
        The neuron to be trained; default: ``Neuron()``. Whatever its `time`, it is trained on the grid of its
        `step_ms`, which is also the step of the silent rows. With `rearm` it is trained as without, since no row can
        tell when it is armed again; `refires_`, `predict` and `neuron_` run with it.
    kappa : float, above 0
        The potential after a target that the term B requires, in thresholds.
    delta_t_ms : float, ms, 0 or more, optional
        Delay of that potential after the target; default: ``0.1 * tau``.
    lambdas : five floats, 0 or more
        Weights of l1, l2, B, C, D in the objective; only their ratios matter.
    lb, ub : float, or float sequence of shape (trains,), mV
        Least and largest weight, for all synapses or one per synapse. All normalisers are computed at
        ``-max(|lb|, |ub|)`` and ``+max(|lb|, |ub|)``, synapse by synapse.
    form_b : {"square", "sum"}
        B as the sum of squared distances, as printed, or of the distances, which a large factor brings to 0 exactly.
    divide_b_by : {"B_max", "targets"}
        Divisor of B: its largest value, as printed, or the number of targets.
    divide_c_by : {"C_max", "targets"}
        Divisor of C, likewise; C over the number of targets is in mV.
    divide_d_by : {"D_max", "targets"}
        Divisor of D, likewise (1 if there are no targets).
    sides_b : {"both", "below"}
        The potentials after a target that count in B: all that differ from what `kappa` requires, as printed, or only
        those below.
    sides_c : {"both", "below"}
        The potentials at a target that count in C, likewise.
    norm : {"norm", "square"}
        The l2 term as printed, or squared.
    margin : float, mV, 0 or more
        Distance below the threshold that silence requires.
    horizon : float, ms, optional
        End of the silent rows; default: the later of the pattern's stop and its last target + `tau`.
    tolerance : float, from 1e-10 to 0.1
        The proven relative gap at which a fit counts as solved.
    max_seconds : float, s, above 0, optional
        Time limit of a fit, which then ends with the best weights so far and their proven gap.

    Attributes
    ----------
    weights_ : float64, shape (trains,), mV
    objective_ : float
        6.14 at these weights.
    parts_ : dict of float
        Its terms "l1", "l2", "B", "C", "D", weighted and normalised: their sum is the objective.
    gap_ : float
        A proven bound of the distance of the objective from its minimum over all weights within the bounds, relative to
        the objective; 1 if nothing is proven yet, as when a fit is stopped before its first round. It says nothing of
        the rows: the minimum itself may miss targets and break silence (`parts_`, `check_solution`).
    multipliers_ : Multipliers
        The proof of it, which `taxel.learn.check_gap` checks in plain NumPy.
    status_ : {"solved", "stopped", "assigned"}
        "solved": no weights have an objective smaller by more than `tolerance` of it; these may miss targets and break
        silence, which are costs here and conditions in `ConeX`. "stopped": the gap is above `tolerance`, as
        `max_seconds` or Ctrl-C ended the fit, or rounding did. "assigned": as in `ConeX`.
    rounds_, rows_ : int
        Rounds of multipliers; rows on their kink in the last one.
    silent_rows_ : int
        Rows of 6.13 at which some input has not decayed.
    unreachable_ : list of (pattern, target)
        Targets at which no weights within the bounds reach the threshold; the other targets are fitted.
    refires_ : int
        Output spikes on the training patterns within `tau` of another output spike, with no target between.
    fired_ : (int, int)
        How many targets of the training patterns an output spike is paired with, as in `score`, and how many there are.
    neuron_ : Neuron
        The trained neuron: a copy with ``time="grid"``.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 6.3.3, equations 6.12 to 6.14. Solved by a proximal augmented Lagrangian with semismooth Newton steps, in
    which only rows near threshold are computed. The gap is computed independently of it, over all rows. A target that
    the optimum meets is met to 1e-12 mV, the tolerance within which a neuron fires (both for a `theta_0` of 0.3 mV,
    else in proportion), and an active silent row stays 1e-9 of `theta_0` below its limit, as far as the objective stays
    within the tolerance. The page *Readings* lists the choices that the thesis leaves open.

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = ConeR(neuron=Neuron(tau=10.0, after_spike="reset"), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> cone.status_
    'solved'
    >>> cone.neuron_.run(cone.weights_, trains)
    array([20.])
    """

    _kind = "cone_r"
    _nested: ClassVar = {"neuron": Neuron}

    neuron: Neuron | None = _DEFAULT.neuron
    kappa: float = _DEFAULT.kappa
    delta_t_ms: float | None = _DEFAULT.delta_t_ms
    lambdas: Sequence[float] = _DEFAULT.lambdas
    lb: float | Sequence[float] = _DEFAULT.lb
    ub: float | Sequence[float] = _DEFAULT.ub
    form_b: Literal["square", "sum"] = _DEFAULT.form_b
    divide_b_by: Literal["B_max", "targets"] = _DEFAULT.divide_b_by
    divide_c_by: Literal["C_max", "targets"] = _DEFAULT.divide_c_by
    divide_d_by: Literal["D_max", "targets"] = _DEFAULT.divide_d_by
    sides_b: Literal["both", "below"] = _DEFAULT.sides_b
    sides_c: Literal["both", "below"] = _DEFAULT.sides_c
    norm: Literal["norm", "square"] = _DEFAULT.norm
    margin: float = _DEFAULT.margin
    horizon: float | None = _DEFAULT.horizon
    tolerance: float = _DEFAULT.tolerance
    max_seconds: float | None = _DEFAULT.max_seconds

    weights_: NDArray[np.float64] = field(init=False)
    objective_: float = field(init=False)
    parts_: dict[str, float] = field(init=False)
    gap_: float = field(init=False)
    multipliers_: Multipliers = field(init=False)
    status_: Status = field(init=False)
    rounds_: int = field(init=False)
    rows_: int = field(init=False)
    silent_rows_: int = field(init=False)
    unreachable_: list[tuple[int, int]] = field(init=False)
    refires_: int = field(init=False)
    fired_: tuple[int, int] = field(init=False)
    neuron_: Neuron = field(init=False)
    #: What a start's multipliers belong to (the number of rows and their kinds), and these, as shares of their range.
    _multipliers: tuple[tuple[int | str, ...], tuple[NDArray[np.int64], NDArray[np.float64]]] = field(init=False)

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        silence: Sequence[ArrayLike | None] | None = None,
        start: ConeR | ArrayLike | None = None,
        progress: Callable[[int, int, float, float], object] | None = None,
    ) -> Self:
        """Learn the weights that fire the neuron at the targets and nowhere else.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each, unsigned or graded; signed ones split into ON and OFF.
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern; empty for a pattern without spikes.
        silence : sequence of float sequences of shape (windows, 2), ms, optional
            The windows in which silence counts, one list of (start, stop) a pattern, ascending, ends included; None
            for one pattern, or for all: everywhere. Points outside have no row in D.
        start : ConeR, or float64 of shape (trains,), mV, optional
            A similar fit (other `lambdas`, other `kappa`), or its weights, as the starting point; it changes the run
            time, not the result. The multipliers of a fit to the same rows are used too.
        progress : function of (round, rows, objective, gap), optional
            Called after each round.

        Returns
        -------
        ConeR
            Itself.

        Raises
        ------
        ProblemError : invalid patterns, targets or windows (names pattern and target or window)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the weights are the best so far

        Warns
        -----
        UserWarning : unreachable targets; a neuron that fires repeatedly after its own spikes; a gap above the
        tolerance
        """
        self.prepare(patterns, targets, silence=silence).fit(self, start=start, progress=progress)
        return self

    def prepare(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        silence: Sequence[ArrayLike | None] | None = None,
    ) -> ConeRProblem:
        """Compute the rows of these examples, for fits with different `lambdas`, `kappa`, bounds, divisors and sides.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
        targets : sequence of float sequences, ms
        silence : sequence of float sequences of shape (windows, 2), ms, optional
            As in `fit`.

        Returns
        -------
        ConeRProblem

        Raises
        ------
        ProblemError : invalid patterns, targets or windows (names pattern and target or window), or more than 10 000
            trains with spikes
        """
        return ConeRProblem(self, patterns, targets, silence)

    def _on_grid(self) -> Neuron:
        """Return the neuron that is trained: the given one, on the grid of its step."""
        neuron = copy.copy(Neuron() if self.neuron is None else instance("neuron", self.neuron, Neuron))
        return neuron if neuron.time == "grid" else neuron.set_params(time="grid")

    def _plain(self) -> dict[str, Any]:
        return super()._plain() | {"neuron": self._on_grid()._plain()}


class ConeRProblem:
    """The rows of one set of examples; made by `ConeR.prepare`.

    Parameters
    ----------
    cone : ConeR
        The learner whose neuron, margin and horizon define the rows.
    patterns : sequence of SpikeTrains
    targets : sequence of float sequences, ms
    silence : sequence of float sequences of shape (windows, 2), ms, optional
        As in `ConeR.fit`.

    Attributes
    ----------
    silent_rows : int
        Number of rows that require silence.

    Raises
    ------
    ProblemError : as `ConeR.prepare`

    Examples
    --------
    >>> from taxel import Neuron
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = ConeR(neuron=Neuron(tau=10.0, after_spike="reset"), lb=-1.0, ub=1.0)
    >>> rows = cone.prepare([trains], [[20.0]])
    >>> [round(rows.fit(cone.set_params(kappa=kappa)).objective_, 4) for kappa in (1.1, 1.2)]
    [0.0046, 0.0055]
    """

    def __init__(
        self,
        cone: ConeR,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        silence: Sequence[ArrayLike | None] | None = None,
    ) -> None:
        trains, times = examples(patterns, targets)
        each = [None] * len(trains) if silence is None else several("silence", silence)
        silences = [windows(f"silence of pattern {p}", silence) for p, silence in enumerate(each)]
        self._trains = len(trains[0]) if trains else 0
        self._counted = _counted(instance("cone", cone, ConeR), trains)
        if self._counted is not None:
            trains = [_chosen(pattern, self._counted) for pattern in trains]
        _weighed("patterns", self._trains if self._counted is None else len(self._counted), "trains have spikes")
        self._problem = _core.ConeRProblem(self._handed(cone)[0], trains, times, silences)
        self.silent_rows: int = self._problem.silent_rows

    def _handed(self, cone: ConeR) -> tuple[str, NDArray[np.float64]]:
        """Return a learner's parameters for the trains in the fit, and the largest weights of the others."""
        if self._counted is None:
            return cone._json(), np.zeros(0)
        cone._check()
        plain = cone._plain()
        silent = np.ones(self._trains, bool)
        silent[self._counted] = False
        largest = np.zeros(silent.sum())
        for name, away in (("lb", np.greater), ("ub", np.less)):
            bound = np.asarray(plain[name], np.float64)
            if bound.ndim and len(bound) != self._trains:
                raise refused(
                    name, f": {len(bound)} bounds for {self._trains} trains; must be one per train, or one for all"
                )
            if away(bound, 0.0)[silent if bound.ndim else ...].any():
                raise refused(
                    name,
                    ": forbids the weight 0 of a train without spikes; prepare the rows with a ConeR that has "
                    "these bounds",
                )
            largest = np.maximum(largest, np.abs(bound[silent] if bound.ndim else bound))
            if bound.ndim:
                plain[name] = bound[self._counted].tolist()
        return parameters(plain), largest

    def fit(
        self,
        cone: ConeR,
        *,
        start: ConeR | ArrayLike | None = None,
        progress: Callable[[int, int, float, float], object] | None = None,
    ) -> ConeR:
        """Fit a learner on these rows.

        Parameters
        ----------
        cone : ConeR
            May differ from the learner of the rows in `lambdas`, `kappa`, `lb`, `ub`, `form_b`, `divide_b_by`,
            `divide_c_by`, `divide_d_by`, `sides_b`, `sides_c`, `norm`, `tolerance` and `max_seconds`.
        start : ConeR, or float64 of shape (trains,), mV, optional
        progress : function of (round, rows, objective, gap), optional
            As in `ConeR.fit`.

        Returns
        -------
        ConeR
            The learner, fitted.

        Raises
        ------
        ProblemError : a learner that needs other rows
        """
        first = None if start is None else self._start(start, cone)
        report = optional(callback, "progress", progress)
        fit = self._problem.fit(*self._handed(instance("cone", cone, ConeR)), first, report)
        _keep(cone, fit, self.silent_rows, self._problem.rows, self._for_all)
        _warn(cone)
        return cone

    def _start(self, start: ConeR | ArrayLike, cone: ConeR) -> tuple[NDArray[np.float64], Any]:
        if not isinstance(start, ConeR):
            return self._weighed(floats("start", start)), None
        if not hasattr(start, "weights_"):
            raise NotFittedError("start: not fitted yet, call fit first")
        start_rows, multipliers = start._multipliers
        same = start_rows == _kinds(self._problem.rows, instance("cone", cone, ConeR))
        return self._weighed(start.weights_), multipliers if same else None

    def _for_all(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the trains in the fit with a 0 for each of the others."""
        if self._counted is None:
            return values
        all_values = np.zeros(self._trains)
        all_values[self._counted] = values
        return all_values

    def _weighed(self, weights: NDArray[np.float64]) -> NDArray[np.float64]:
        if self._counted is None:
            return weights
        if weights.shape != (self._trains,):
            raise refused("weights", f": {weights.size} weights for {self._trains} trains; must be one per train")
        return weights[self._counted]


def _weighed(name: str, count: int, trains: str) -> None:
    """Refuse more trains than a fit can have."""
    if count > _MOST_TRAINS:
        raise refused(
            name,
            f": {count} {trains}; must be at most {_MOST_TRAINS}, because memory grows with the square of this number "
            "and time with its cube; use an encoder that pools taxels (taxel train --recipe touch, or --encoder "
            "contact_area), fewer levels, or a part of the array",
        )


def _chosen(pattern: SpikeTrains, counted: NDArray[np.int64]) -> SpikeTrains:
    """Return those trains of a pattern; the others have no spikes."""
    offsets = np.append(pattern.offsets[counted], pattern.offsets[-1])
    return SpikeTrains(pattern.times, offsets, pattern.start, pattern.stop, pattern.values, kind=pattern.kind)


def _counted(cone: ConeR, trains: Sequence[SpikeTrains]) -> NDArray[np.int64] | None:
    """Return the trains with a spike in some pattern, or with bounds that exclude 0; None if these are all trains.

    The weight of any other train is 0 in every solution, and nearly all trains of a whole array are of this kind.
    """
    if len({len(pattern) for pattern in trains}) != 1:
        return None
    cone._check()
    plain = cone._plain()
    counted = np.logical_or.reduce([pattern.counts > 0 for pattern in trains])
    low, high = (np.asarray(plain[name], np.float64) for name in ("lb", "ub"))
    if any(bound.ndim and len(bound) != len(counted) for bound in (low, high)):
        return None
    counted |= (low > 0) | (high < 0)
    return None if counted.all() or not counted.any() else np.flatnonzero(counted)


def _keep(
    cone: ConeR,
    fit: _core.ConeRFit,
    silent_rows: int,
    all_rows: int,
    for_all: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> None:
    """Set the results of a fit on the learner, those of trains `for_all`; raise what ended the fit."""
    cone.weights_ = for_all(fit.weights)
    for name in ("objective", "gap", "status", "rounds", "rows", "unreachable", "refires", "fired"):
        setattr(cone, f"{name}_", getattr(fit, name))
    cone.parts_ = dict(zip(("l1", "l2", "B", "C", "D"), fit.parts, strict=True))
    of_rows, of_behind, pull = fit.proof
    cone.multipliers_ = _multipliers((of_rows, of_behind, for_all(pull)))
    cone.silent_rows_ = silent_rows
    cone.neuron_ = cone._on_grid()
    cone._multipliers = (_kinds(all_rows, cone), fit.multipliers)
    if fit.raised is not None:
        raise fit.raised


def _kinds(rows: int, cone: ConeR) -> tuple[int | str, ...]:
    """Return what the numbers and the ranges of a fit's multipliers depend on."""
    return rows, cone.sides_c, cone.form_b, cone.sides_b


def _shown(bound: float | Sequence[float]) -> str:
    return f"{bound}" if np.ndim(bound) == 0 else "their own bounds"


def _warn(cone: ConeR) -> None:
    if cone.unreachable_:
        listed = ", ".join(f"pattern {p} target {k}" for p, k in cone.unreachable_[:5])
        more = f" and {len(cone.unreachable_) - 5} more" if len(cone.unreachable_) > 5 else ""
        within = f"within {_shown(cone.lb)} to {_shown(cone.ub)} mV"
        warn(
            f"no weights {within} raise the potential to the threshold at {listed}{more}; the other targets "
            f"were fitted",
            stacklevel=4,
        )
    if cone.refires_:
        neuron = cone.neuron_
        others = [] if neuron.after_spike == "reset" else ['after_spike "reset"']
        others += [f"a refractory above {neuron.refractory:g} ms", f"a theta_plus above {neuron.theta_plus:g} mV"]
        warn(
            f"on its training patterns, the trained neuron fires {counted(cone.refires_, 'extra spike')} within tau of "
            f"another spike, without a target between; to prevent this, use {', '.join(others[:-1])} or {others[-1]}",
            stacklevel=4,
        )
    if cone.status_ != "solved":
        warn(
            f"the objective is only proven to be within {cone.gap_:.1e} of its minimum (tolerance "
            f"{cone.tolerance:.1e})",
            stacklevel=4,
        )
