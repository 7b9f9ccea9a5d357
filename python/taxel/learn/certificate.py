"""The checks of proofs: that a problem of `taxel.learn.ConeX` has no solution, how far a fit is from the best."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from fractions import Fraction
from operator import mul

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._base.arguments import flag, floats, instance
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import NotFittedError, ProblemError
from taxel.learn._checked import checked_examples, fitted
from taxel.learn._statement import Stated, pattern_rows
from taxel.learn.cone_r import ConeR
from taxel.learn.cone_x import Certificate, ConeX, ConeXProblem, Margin
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains


def check_certificate(problem: ConeXProblem, certificate: Certificate, *, margin: bool = True) -> bool:
    """Check a proof of infeasibility, with its rows computed again from spikes and kernels in plain NumPy.

    Every solution w satisfies ``row @ w == limit`` at a target and ``<= limit`` elsewhere. It follows that
    ``g @ w <= multipliers @ limits``, where g is the sum of the rows, each times its multiplier. If the minimum of
    ``g @ w`` within the bounds is larger, by more than any rounding error, there is no solution.

    In continuous time a margin is above 0. Rows that cancel without a margin, at least one of silence among them,
    therefore prove infeasibility for every margin. An example is a target in one pattern at a time at which another
    pattern with the same inputs up to then requires silence.

    Parameters
    ----------
    problem : ConeXProblem
        The problem (`ConeX.problem_`): its parameters, patterns, targets and margin are read, not its rows.
    certificate : Certificate
        The proof (`ConeX.certificate_`).
    margin : bool
        Whether rows have their margin and slope; false sets both to 0, so that the proof holds for every margin.

    Returns
    -------
    bool
        Whether the certificate is a proof.

    Raises
    ------
    ProblemError : a row that the problem does not have; multipliers that are not one per row

    Examples
    --------
    >>> import taxel
    >>> trains = taxel.SpikeTrains.from_lists([[50.0], [60.0]], stop=100.0)
    >>> cone = taxel.learn.ConeX().fit([trains], [[40.0]])
    >>> cone.status_, taxel.learn.check_certificate(cone.problem_, cone.certificate_)
    ('infeasible', True)
    """
    instance("problem", problem, ConeXProblem)
    instance("certificate", certificate, Certificate)
    flag("margin", margin)
    if len(certificate.rows) != len(certificate.multipliers):
        many = f"{counted(len(certificate.multipliers), 'multiplier')} for {counted(len(certificate.rows), 'row')}"
        raise refused("certificate", f": {many}: must be one per row")
    cone, patterns = problem._restated()
    neuron = Neuron() if cone.neuron is None else cone.neuron
    rows = pattern_rows(cone, neuron, patterns, problem.targets, margin=problem.margin)
    trains = len(patterns[0])
    lb, ub = (np.broadcast_to(np.asarray(bound, np.float64), trains) for bound in (cone.lb, cone.ub))
    most = np.maximum(np.abs(lb), np.abs(ub))
    g, size, demanded, silent, terms = np.zeros(trains), 0.0, 0.0, False, 0.0
    sides: list[list[float]] = []
    # Their scale proves nothing; the smallest of floats would lose its products.
    multipliers = np.ldexp(certificate.multipliers, -np.frexp(np.abs(certificate.multipliers).max(initial=0.0))[1])
    for (kind, pattern, at), multiplier in zip(certificate.rows, multipliers, strict=True):
        if not 0 <= pattern < len(rows):
            raise refused("certificate", f": a row is of pattern {pattern}; must be from 0 to {len(rows) - 1}")
        if multiplier < 0 and kind != "target":
            return False
        here = rows[pattern]
        coefficients, sizes, limit = here.named(kind, at, f"certificate: pattern {pattern},", margin=margin)
        g = g + multiplier * coefficients
        demanded += multiplier * limit
        sides.append([*coefficients, limit])
        silent |= kind == "silence" and multiplier > 0
        size += abs(multiplier) * (sizes @ most + abs(limit))
        terms = max(terms, here.roundings + here.counts.max(initial=0))
    least = np.minimum(lb * g, ub * g).sum()
    rounding = (len(certificate.rows) + trains + terms) * np.finfo(float).eps * size
    if silent and not margin and min(problem.margin) > 0 and demanded == 0 and not g.any():
        # In fractions, as a sum of floats loses a product that is small enough.
        exact = [Fraction(multiplier) for multiplier in multipliers]
        if not any(sum(map(mul, exact, map(Fraction, column))) for column in zip(*sides, strict=True)):
            return True
    return bool(least - demanded > rounding)


def check_gap(
    cone: ConeX | ConeR,
    patterns: Sequence[SpikeTrains],
    targets: Sequence[ArrayLike],
    *,
    silence: Sequence[ArrayLike | None] | None = None,
) -> float:
    """Check how far a fit can be from the minimum, with 6.9 to 6.14 computed again in plain NumPy.

    Each term of 6.14 (of 6.11 for `ConeX`) is at least each of its tangents. With x the excess of the potential over
    what its row requires: D of a silent row is at least ``y * x`` for a multiplier y from 0 to the factor of D, C of a
    target for a y between plus and minus the factor of C, B is at least ``y * x - y**2 / (4 * b)`` with its factor b
    (as a sum of distances: ``y * x`` for a y between plus and minus b), and the l2 term at least ``pull @ w`` for a
    pull no longer than its factor (squared: ``pull @ w - pull @ pull / (4 * l2)``). The rows of `ConeX` are hard: ``y *
    x`` is at most 0 for all weights that meet them, with any y at a target, 0 or more for silence and slopes, and takes
    the place of C and D. The sum of these tangents and of l1 is minimised within the bounds synapse by synapse, and no
    weights have a smaller objective. That holds for any multipliers: those out of their range are moved into it, and
    wrong ones prove less.

    Parameters
    ----------
    cone : ConeX or ConeR
        The fitted learner: its parameters state the problem, `weights_` and `multipliers_` are checked. Also an
        `OnlineConeR`. The bound of a `ConeX` is over all weights that keep the whole margin (`problem_.margin`);
        `check_solution` checks that its own weights are a solution, of which the gap says nothing: weights that miss
        targets may have an objective below the minimum of those that meet them, and a gap of 0.
    patterns : sequence of SpikeTrains
    targets : sequence of float sequences, ms
    silence : sequence of float sequences of shape (windows, 2), ms, optional
        As in `ConeR.fit`; for an `OnlineConeR` those of its window, the oldest first. Not for a `ConeX`.

    Returns
    -------
    float, 0 or more
        No weights have an objective smaller by more than this share of it. It contains the largest rounding error of
        all sums, and so may be above `gap_`: as a rule by less than 1e-9, by 3e-8 where a fit's objective was a
        millionth of that of zero weights. 1 or more: the multipliers prove nothing; infinite: a weight is not within
        its bounds. An objective of at most 1e-10 of that of zero weights counts as 0, and its gap is 0.

    Raises
    ------
    ProblemError : examples that cannot be those of the fit (other trains, a multiplier of a row that they do not have);
        with others that can, the gap is that of these examples
    NotFittedError : before `fit`

    Notes
    -----
    Thesis 6.3.3. Compiled code takes no part. Cost: grid points times the inputs of the last 50 `tau`.

    Examples
    --------
    >>> import taxel
    >>> trains = taxel.SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    >>> cone = taxel.learn.ConeR(neuron=taxel.Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])
    >>> taxel.learn.check_gap(cone, [trains], [[20.0]]) <= cone.tolerance
    True
    >>> cone.weights_ = 0.9 * cone.weights_
    >>> taxel.learn.check_gap(cone, [trains], [[20.0]]) > 0.1
    True
    """
    w = fitted(cone)
    hard = isinstance(cone, ConeX)
    if hard and silence is not None:
        raise refused("silence", ": must be None, because ConeX requires silence everywhere")
    trained, times, silences = checked_examples(cone, len(w), patterns, targets, silence)
    margin = cone.problem_.margin if isinstance(cone, ConeX) else Margin(cone.margin, 0.0)
    stated = Stated(cone, pattern_rows(cone, cone.neuron_, trained, times, margin=margin, windows=silences), len(w))
    sides_b, sides_c = stated.sides
    if not ((stated.lb <= w) & (w <= stated.ub)).all():
        return np.inf
    objective, rounding = stated.objective(w)
    if objective <= 1e-10 * stated.objective(np.clip(0.0, stated.lb, stated.ub))[0]:
        return 0.0
    l1, l2, b, c, d = stated.factors

    # The multipliers by row, each within its range.
    given, pull = _multipliers(cone, len(w))
    of_c, of_b = (np.array([given.pop((kind, *name), 0.0) for name in stated.names]) for kind in ("target", "behind"))
    of_c = of_c if hard else np.clip(of_c, -c, 0.0 if sides_c == "below" else c)
    steepest = b if cone.form_b == "sum" else np.inf
    of_b = np.clip(of_b, -steepest, 0.0 if sides_b == "below" else steepest) * (b > 0)
    pull, length = pull * (l2 > 0), np.linalg.norm(pull)
    if cone.norm == "norm" and length > l2:
        pull = pull * (l2 / length * (1 - len(w) * np.finfo(float).eps))

    # The sum of the tangents, slope @ w + constants.sum(), and the sizes of the terms of its slope.
    slope = of_c @ stated.at + of_b @ stated.behind + pull
    sizes = np.abs(of_c) @ stated.at_sizes + np.abs(of_b) @ stated.behind_sizes + np.abs(pull)
    constants = [*(-of_c * stated.theta), *(-of_b * stated.wanted)]
    constants += [*(-(of_b**2) / (4 * b))] if b > 0 and cone.form_b == "square" else []
    constants += [*(-(pull**2) / (4 * l2))] if cone.norm == "square" and l2 > 0 else []
    for (kind, p, t), multiplier in given.items():
        if kind not in ("silence", "slope") or (kind == "slope" and not hard) or not 0 <= p < len(stated.patterns):
            raise ProblemError(f"multiplier of {kind}, pattern {p}, {t}: the problem has no such row")
        coefficients, row_sizes, limit = stated.patterns[p].named(kind, t, f"multiplier of pattern {p},")
        of_d = max(multiplier, 0.0) if hard else min(max(multiplier, 0.0), d)
        slope, sizes = slope + of_d * coefficients, sizes + of_d * row_sizes
        constants.append(-of_d * limit)

    # Its minimum with l1, synapse by synapse; l1 and l2 alone exceed the objective beyond `reach`.
    most = (objective + rounding) * (1 + 1e-9)
    with np.errstate(divide="ignore"):
        reach = min(most / l1, np.sqrt(most / l2)) if cone.norm == "square" else most / (l1 + l2)
    low, high = np.maximum(stated.lb, -reach), np.minimum(stated.ub, reach)
    ends = np.array([low, high, np.clip(0.0, low, high)])
    least = (slope * ends + l1 * np.abs(ends)).min(axis=0)
    size = sizes @ np.maximum(np.abs(low), np.abs(high)) + np.abs(least).sum() + np.abs(constants).sum()
    rounding += (stated.terms + len(constants)) * np.finfo(float).eps * size
    # Every term is at least 0, so that 0 is a bound too.
    gap = (max(objective - max(np.sum(constants) + least.sum(), 0.0), 0.0) + rounding) / objective
    return float(gap) if gap < np.inf else np.inf


def _multipliers(cone: ConeX | ConeR, trains: int) -> tuple[dict[tuple[str, int, float], float], NDArray[np.float64]]:
    """Return the multipliers of a fit by the names of their rows, and that of the l2 term."""
    proof = cone.multipliers_
    if proof is None:
        raise NotFittedError(f"cone: has no multipliers_, because its fit is {cone.status_}; fit it again")
    values, pull = floats("multipliers_.values", proof.values), floats("multipliers_.pull", proof.pull)
    if len(values) != len(proof.rows) or len(pull) != trains:
        raise ProblemError(
            f"multipliers_: {counted(len(values), 'value')} for {counted(len(proof.rows), 'row')}, {len(pull)} of pull "
            f"for {counted(trains, 'train')}; must be one per row and one per train"
        )
    given: dict[tuple[str, int, float], float] = defaultdict(float)
    for (kind, pattern, at), value in zip(proof.rows, values, strict=True):
        given[kind, pattern, at] += value
    return given, pull
