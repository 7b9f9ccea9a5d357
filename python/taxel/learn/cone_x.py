"""CONE-X: weights with which a neuron fires exactly at its targets and nowhere else, or a proof that none do."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import callback, flag, floats, instance, integer, number, optional, several, shown
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._base.parameters import defaults
from taxel._core import NotFittedError
from taxel.learn._examples import examples
from taxel.learn._learner import SpikeLearner, Status
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains


class Row(NamedTuple):
    """Name a row of a problem by pattern and time.

    Parameters
    ----------
    kind : {"target", "silence", "slope", "behind"}
        The potential at a target equals the threshold (6.9a); it stays below the threshold at a time (6.9b); it reaches
        a target from below. Behind a target it reaches `kappa` thresholds (6.10; in `multipliers_` only).
    pattern : int, 0 or more
    at : int, 0 or more, or float, ms
        The number of the target in its pattern; the time of a row of silence.

    Examples
    --------
    >>> Row("silence", 0, 17.5)
    Row(kind='silence', pattern=0, at=17.5)
    """

    kind: Literal["target", "silence", "slope", "behind"]
    pattern: int
    at: float


@dataclass(frozen=True, eq=False, repr=False)
class Certificate:
    """Prove that no weights within the bounds meet the named rows together (Farkas).

    Parameters
    ----------
    rows : list of Row
    multipliers : float64, shape (rows,), of any sign at targets, else 0 or more
    gap : float, mV
        The difference between the requirement of the rows and the most that the bounds allow.
    at_all : bool
        Whether it also holds with margin and slope 0 in its rows: then the problem is infeasible for every margin.
    text : str
        Description of the conflicting patterns, targets and silences.

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[50.0], [60.0]], stop=100.0)
    >>> print(str(ConeX().fit([trains], [[40.0]]).certificate_)[:87])
    with weights within the bounds, the neuron cannot fire in pattern 0 at target 0 (40 ms)
    """

    rows: list[Row]
    multipliers: NDArray[np.float64]
    gap: float
    at_all: bool
    text: str

    def to_dict(self) -> dict[str, Any]:
        """Return the proof as plain lists, numbers and text, ready for JSON.

        Returns
        -------
        dict
            By the names of the attributes; a row is ``[kind, pattern, at]``.

        Examples
        --------
        >>> Certificate([Row("target", 0, 0)], np.array([-1.0]), 0.3, True, "no input").to_dict()["rows"]
        [['target', 0, 0]]
        """
        rows, multipliers = [list(row) for row in self.rows], self.multipliers.tolist()
        return {"rows": rows, "multipliers": multipliers, "gap": self.gap, "at_all": self.at_all, "text": self.text}

    @classmethod
    def from_dict(cls, held: Mapping[str, Any]) -> Self:
        """Return the proof that `to_dict` gave.

        Parameters
        ----------
        held : dict
            As from `to_dict`, also by way of JSON.

        Returns
        -------
        Certificate

        Raises
        ------
        ProblemError : not such a dict

        Examples
        --------
        >>> proof = Certificate([Row("target", 0, 0)], np.array([-1.0]), 0.3, True, "no input")
        >>> Certificate.from_dict(proof.to_dict()).rows
        [Row(kind='target', pattern=0, at=0)]
        """
        names = ("rows", "multipliers", "gap", "at_all", "text")
        if not isinstance(held, Mapping) or set(held) != set(names):
            raise refused("certificate", f": must be a dict of {', '.join(names)}, as to_dict gives it")
        rows = [_row(_name(row)) for row in several("rows", held["rows"])]
        multipliers = floats("multipliers", held["multipliers"])
        if len(rows) != len(multipliers):
            raise refused("certificate", f": {counted(len(multipliers), 'multiplier')} for {counted(len(rows), 'row')}")
        gap = number("gap", held["gap"])
        return cls(rows, multipliers, gap, flag("at_all", held["at_all"]), str(held["text"]))

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return f"<Certificate of {counted(len(self.rows), 'row')}: {self.text}>"


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers:
    """Prove that no weights within the bounds have an objective below that of a fit by more than its gap.

    `taxel.learn.check_gap` explains and checks the proof.

    Parameters
    ----------
    rows : list of Row
        The rows with a multiplier: of silence (kind "silence"), of targets ("target"), of B ("behind"), and of `ConeX`
        those of slopes ("slope").
    values : float64, shape (rows,), 1/mV
        Of silence 0 or more, of `ConeR` up to the factor of D. Of targets any; of `ConeR` from minus the factor of C
        up to it, up to 0 if `sides_c` is "below". Of slopes 0 or more, ms/mV. Of B any, at most 0 if `sides_b` is
        "below"; if `form_b` is "sum", from minus the factor of B up to it.
    pull : float64, shape (trains,), 1/mV
        The multiplier of the l2 term: a slope no longer than its factor, of any length if `norm` is "square".

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = ConeX(neuron=Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> cone.multipliers_.rows
    [Row(kind='target', pattern=0, at=0), Row(kind='slope', pattern=0, at=0)]
    """

    rows: list[Row]
    values: NDArray[np.float64]
    pull: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"<Multipliers of {counted(len(self.rows), 'row')}>"


class Margin(NamedTuple):
    """The distance below the threshold that silence keeps.

    Parameters
    ----------
    mv : float, mV
        Distance away from targets.
    slope : float, mV/ms
        Slope with which the distance falls to 0 at a target; 0 on the grid, where it is constant.
    """

    mv: float
    slope: float


_DEFAULT = defaults("cone_x")


@dataclass(kw_only=True, eq=False, repr=False)
class ConeX(SpikeLearner):
    """Learn weights by CONE-X: exact at every target, silent elsewhere, with least norms and lack of potential.

    In continuous time (the default) silence holds at every instant. On the grid it is the thesis' problem 6.11, which
    requires silence at 1 ms points only: most such weights fire early or once more between them.

    Parameters
    ----------
    neuron : Neuron, optional
        The neuron to be trained; default: ``Neuron()``. With ``time="grid"`` its `step_ms` is also the step of the
        silent rows.
    kappa : float, above 0
        The potential after a target that the term B requires, in thresholds.
    delta_t_ms : float, ms, 0 or more, optional
        Delay of that potential after the target; default: ``0.1 * tau``.
    lambdas : three floats, 0 or more
        Weights of l1, l2, B in the objective; only their ratios matter. All 0: any feasible weights.
    lb, ub : float or float64 of shape (trains,), mV
        Least and largest weight, finite. All normalisers are computed at ``-max(|lb|, |ub|)`` and ``+max(|lb|, |ub|)``.
    form_b : {"square", "sum"}
        B as the sum of squared distances, as printed, or of the distances, which a large factor brings to 0 exactly.
    divide_b_by : {"B_max", "targets"}
        Divisor of B: its largest value, as printed, or the number of targets.
    norm : {"norm", "square"}
        The l2 term as printed, or squared.
    margin : float, mV, 0 or more, optional
        Distance below the threshold that silence requires; default: ``theta_0 / 300`` (1e-3 mV for the default neuron)
        in continuous time, 0 on the grid. If neither it nor `slope` is given and no weights keep it, in continuous time
        a tenth, a hundredth and a thousandth of both are tried (`problem_.margin` is the last one), so that
        "infeasible" holds for any margin (``certificate_.at_all``); a given margin is used as it is. On the grid the
        best weights reach the threshold at many points, and a neuron on the grid fires there: set 1e-9 or more.
    slope : float, mV/ms, 0 or more, optional
        Slope with which that margin falls to 0 at a target, and by which the potential rises more steeply than the
        threshold there; default: ``theta_0 / 300`` a ms. Continuous time only.
    horizon : float or float64 of shape (patterns,), ms, optional
        End of the required silence; default: the later of a pattern's stop and its last target + `tau`.
    tolerance : float, from 1e-12 to 0.1
        The proven relative gap at which the search ends.
    max_seconds : float, s, above 0, optional
        Time limit of a fit, which then ends with the best weights so far.

    Attributes
    ----------
    status_ : {"solved", "feasible", "infeasible", "stopped", "assigned"}
        "solved" and "feasible": silence keeps at least half its margin, and the neuron, run on the patterns, fires
        within 1e-6 ms of every target and nowhere else (on the grid: every target row is met to 1e-12 mV, in proportion
        where theta_0 is not 0.3 mV). "solved": these weights are also the best, as no weights that keep the whole
        margin have an objective smaller by more than `tolerance` of it, or by more than 1e-10 of the value of B for
        zero weights. "feasible": the search ended before that was proven (`reason_`). "infeasible": `certificate_`
        proves it. "stopped": none of these is known. "assigned": `weights_` was assigned after the fit, and
        the results about the weights of that fit are gone (`objective_`, `parts_`, `gap_`, `margin_`, `reason_`,
        `violation_`).
    weights_ : float64, shape (trains,), mV
        The best so far if stopped, which may miss any row; NaN if infeasible, if only the least margin tried is proven
        to be, or if rounding left none.
    objective_ : float
        6.11 at these weights; infinite if infeasible.
    parts_ : dict
        Its terms: l1, l2, B.
    gap_ : float
        A proven bound, independent of the engine: no weights that keep the whole margin have an objective smaller by
        more than this share of it. (In continuous time these weights keep `margin_`, which is slightly smaller.) It
        bounds in this direction only and says nothing of the rows: a fit that was stopped early may miss every target
        with a gap of 0, as its objective is below the minimum of the weights that meet them. `status_` and `violation_`
        tell. NaN if infeasible; infinite if stopped without weights.
    multipliers_ : Multipliers or None
        The proof of it, which `taxel.learn.check_gap` checks in plain NumPy; None if there are no weights.
    margin_ : Margin
        The margin that holds, at least half of that of the problem (`problem_.margin`); on the grid, as `mv`, the least
        threshold - potential over the silent points.
    reason_ : str or None
        If stopped: the violated row or the wrong spike, with its pattern and time. If feasible: why `gap_` is above
        `tolerance`: the search was ended by `max_seconds`, Ctrl-C or rounding. Else None.
    violation_ : float, mV
        The largest violation of a row: of a target, or of silence with half its margin.
    certificate_ : Certificate or None
        The proof, if infeasible.
    problem_ : ConeXProblem
        The problem, which returns its rows one by one.
    rounds_ : int
        Rounds of row generation.
    held_ : list of (Row, float)
        The active rows, with their multipliers.
    neuron_ : Neuron
        The trained neuron.

    Raises
    ------
    ProblemError : an invalid parameter

    Notes
    -----
    Thesis 6.3.2, equations 6.9 to 6.11. Violations of silence are found over all patterns by recursion; the violated
    rows go to a dual active-set method (Goldfarb and Idnani 1983), which also returns the proof. Cost: about 2.5
    `trains` steps of O(rows^2). The page *Readings* lists the choices that the thesis leaves open.

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = ConeX(neuron=Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> cone.status_
    'solved'
    >>> cone.neuron_.run(cone.weights_, trains).round(6)
    array([20.])
    """

    #: An exact target is met or not; 1 ms leaves room for targets and spikes that were rounded.
    _WINDOW_MS = 1.0

    _kind = "cone_x"
    _nested: ClassVar = {"neuron": Neuron}
    neuron: Neuron | None = _DEFAULT.neuron
    kappa: float = _DEFAULT.kappa
    delta_t_ms: float | None = _DEFAULT.delta_t_ms
    lambdas: Sequence[float] = _DEFAULT.lambdas
    lb: float | ArrayLike = _DEFAULT.lb
    ub: float | ArrayLike = _DEFAULT.ub
    form_b: Literal["square", "sum"] = _DEFAULT.form_b
    divide_b_by: Literal["B_max", "targets"] = _DEFAULT.divide_b_by
    norm: Literal["norm", "square"] = _DEFAULT.norm
    margin: float | None = _DEFAULT.margin
    slope: float | None = _DEFAULT.slope
    horizon: float | ArrayLike | None = _DEFAULT.horizon
    tolerance: float = _DEFAULT.tolerance
    max_seconds: float | None = _DEFAULT.max_seconds

    status_: Status = field(init=False)
    weights_: NDArray[np.float64] = field(init=False)
    objective_: float = field(init=False)
    parts_: dict[str, float] = field(init=False)
    gap_: float = field(init=False)
    multipliers_: Multipliers | None = field(init=False)
    margin_: Margin = field(init=False)
    reason_: str | None = field(init=False)
    violation_: float = field(init=False)
    certificate_: Certificate | None = field(init=False)
    problem_: ConeXProblem = field(init=False)
    rounds_: int = field(init=False)
    held_: list[tuple[Row, float]] = field(init=False)
    neuron_: Neuron = field(init=False)

    def fit(
        self,
        patterns: Sequence[SpikeTrains],
        targets: Sequence[ArrayLike],
        *,
        start: ConeX | None = None,
        progress: Callable[[int, int, int, float], object] | None = None,
    ) -> Self:
        """Find the weights, or a proof that there are none.

        Parameters
        ----------
        patterns : sequence of SpikeTrains
            The same trains in each, unsigned or graded; signed ones split into ON and OFF.
        targets : sequence of float sequences, ms
            Target spike times, one list per pattern; empty for a pattern without spikes. At the end of a refractory
            time too the potential must equal the threshold (6.9a), though a neuron fires there above it too.
        start : ConeX, optional
            An earlier fit of a similar problem, whose active rows and multipliers are the starting point. The result is
            the same; in continuous time `margin_` may differ.
        progress : function of (round, rows, broken, objective), optional
            Called after each round; `broken` is the number of intervals in which silence is violated.

        Returns
        -------
        ConeX
            Itself.

        Raises
        ------
        ProblemError : invalid patterns or targets (names pattern and target)
        KeyboardInterrupt : Ctrl-C, within a fraction of a second; the weights are the best so far
        """
        known_rows = [] if start is None else _held(instance("start", start, ConeX))
        neuron = Neuron() if self.neuron is None else copy.copy(self.neuron)
        problem = ConeXProblem(self, patterns, targets)
        multipliers = np.array([multiplier for _, multiplier in known_rows], dtype=np.float64)
        first = [tuple(row) for row, _ in known_rows]
        fit = problem._problem.fit(first, multipliers, optional(callback, "progress", progress))
        for name in ("weights", "status", "objective", "gap", "violation", "reason", "rounds"):
            setattr(self, f"{name}_", getattr(fit, name))
        self.parts_ = dict(zip(("l1", "l2", "B"), fit.parts, strict=True))
        self.multipliers_ = None if fit.proof is None else _multipliers(fit.proof)
        self.margin_ = Margin(*fit.margin)
        rows, values = fit.held
        self.held_ = list(zip(map(_row, rows), values.tolist(), strict=True))
        self.certificate_ = None
        if fit.certificate is not None:
            found = fit.certificate
            rows, values = found.rows
            self.certificate_ = Certificate([_row(row) for row in rows], values, found.gap, found.at_all, found.text)
        self.problem_ = problem._with_margin(fit.asked)
        self.neuron_ = neuron
        if fit.raised is not None:
            raise fit.raised
        return self


class ConeXProblem:
    """Return the rows of a problem one by one, by pattern and time; never all of them at once.

    Parameters
    ----------
    cone : ConeX
        The learner whose parameters define the problem.
    patterns : sequence of SpikeTrains
    targets : sequence of float sequences, ms
        As in `ConeX.fit`.

    Attributes
    ----------
    lb, ub : float64, shape (trains,), mV
    targets : list of float64, ms
        One array a pattern.
    margin : Margin
        The distance below the threshold that its rows of silence require.

    Raises
    ------
    ProblemError : as `ConeX.fit`

    Examples
    --------
    >>> trains = SpikeTrains.from_lists([[5.0], [12.0]], stop=60.0)
    >>> problem = ConeXProblem(ConeX(), [trains], [[20.0]])
    >>> coefficients, threshold = problem.target(0, 0)
    >>> coefficients.round(3), threshold
    (array([0.368, 0.313]), 0.3)
    """

    def __init__(self, cone: ConeX, patterns: Sequence[SpikeTrains], targets: Sequence[ArrayLike]) -> None:
        trains, self.targets = examples(patterns, targets)
        self._stated = instance("cone", cone, ConeX)._json(), trains
        self._lay_out()

    def _lay_out(self) -> None:
        self._problem = _core.ConeXProblem(*self._stated, self.targets)
        self.lb, self.ub = self._problem.bounds()
        self.margin = Margin(*self._problem.margin())

    def _with_margin(self, margin: tuple[float, float]) -> Self:
        if self.margin != margin:
            self._problem = self._problem.with_margin(*margin)
            self.margin = Margin(*margin)
        return self

    def _restated(self) -> tuple[ConeX, list[SpikeTrains]]:
        """Return the learner's parameters and the patterns that state the problem."""
        json_text, trains = self._stated
        return ConeX._from_values(json.loads(json_text)), trains

    def __getstate__(self) -> dict[str, Any]:
        return {"_stated": self._stated, "targets": self.targets, "margin": self.margin}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._lay_out()
        self._with_margin(state["margin"])

    def row(self, row: Row | tuple[str, int, float], *, margin: bool = True) -> tuple[NDArray[np.float64], float]:
        """Return the row of this name: ``coefficients @ w == limit`` at a target, else ``<= limit``.

        Parameters
        ----------
        row : Row, or (kind, pattern, at)
        margin : bool
            Whether the row has its margin and slope; false sets both to 0.

        Returns
        -------
        coefficients : float64, shape (trains,)
            Of the potential; in a slope row (kind "slope") of its slope, 1/ms, negated.
        limit : float, mV (in a slope row mV/ms)

        Raises
        ------
        ProblemError : no such row
        """
        return self._problem.row(_name(row), flag("margin", margin))

    def target(self, pattern: int, target: int) -> tuple[NDArray[np.float64], float]:
        """Return the row of a target (6.9a): the coefficients of the potential, which must equal the threshold.

        Parameters
        ----------
        pattern, target : int, 0 or more

        Returns
        -------
        coefficients : float64, shape (trains,)
        threshold : float, mV

        Raises
        ------
        ProblemError : no such target
        """
        return self.row(("target", pattern, integer("target", target, 0)))

    def silence(self, pattern: int, t: float, *, margin: bool = True) -> tuple[NDArray[np.float64], float]:
        """Return the row of silence at a time (6.9b): coefficients of the potential, and its limit.

        Parameters
        ----------
        pattern : int, 0 or more
        t : float, ms
        margin : bool
            Whether the limit has its margin; false sets it to 0.

        Returns
        -------
        coefficients : float64, shape (trains,)
        limit : float, mV
            The threshold less the margin.

        Raises
        ------
        ProblemError : a time at which silence is not required

        Examples
        --------
        >>> trains = SpikeTrains.from_lists([[5.0], [12.0]], stop=60.0)
        >>> coefficients, limit = ConeXProblem(ConeX(), [trains], [[20.0]]).silence(0, 50.0)
        >>> coefficients.round(3), round(limit, 3)
        (array([0.149, 0.201]), 0.38)
        """
        return self.row(("silence", pattern, t), margin=margin)

    def slope(self, pattern: int, target: int, *, margin: bool = True) -> tuple[NDArray[np.float64], float]:
        """Return the row of the slope at a target, where the potential rises to the threshold (continuous time only).

        Parameters
        ----------
        pattern, target : int, 0 or more
        margin : bool
            Whether the limit has its slope; false sets it to 0.

        Returns
        -------
        coefficients : float64, shape (trains,), 1/ms
            Of the potential's slope just before the target, negated.
        limit : float, mV/ms
            The threshold's slope and the margin's, negated.

        Raises
        ------
        ProblemError : no such target, or a grid
        """
        return self.row(("slope", pattern, integer("target", target, 0)), margin=margin)

    def behind(self, pattern: int, target: int) -> tuple[NDArray[np.float64], float]:
        """Return the row of B after a target (6.10): the coefficients of the potential, and the required value.

        Parameters
        ----------
        pattern, target : int, 0 or more

        Returns
        -------
        coefficients : float64, shape (trains,)
        wanted : float, mV
            `kappa` thresholds.

        Raises
        ------
        ProblemError : no such target
        """
        return self._problem.behind(integer("pattern", pattern, 0), integer("target", target, 0))


def _name(row: object) -> tuple[str, int, float]:
    """Return the name of a row; refuse what is none."""
    try:
        given: Any = row
        kind, pattern, at = given
    except (TypeError, ValueError):
        raise refused("row", f" is {shown(row)}: must be kind, pattern and target or time") from None
    if not isinstance(kind, str):
        raise refused("row", f" is {shown(row)}: its kind must be a text")
    return kind, integer("pattern", pattern, 0), number("target or time", at)


def _multipliers(proof: Any) -> Multipliers:
    """Return the proof of a gap as the compiled part gives it."""
    (named, values), (behind, slopes), pull = proof
    rows_of_b = [Row("behind", pattern, target) for pattern, target in behind]
    return Multipliers([*map(_row, named), *rows_of_b], np.append(values, slopes), pull)


def _row(name: tuple[str, int, float]) -> Row:
    kind, pattern, at = name
    return Row(kind, pattern, at if kind == "silence" else int(at))  # type: ignore[arg-type]


def _held(start: ConeX) -> list[tuple[Row, float]]:
    rows: Any = getattr(start, "held_", None)
    if rows is None:
        raise NotFittedError("start: not fitted yet, call fit first")
    return list(rows)
