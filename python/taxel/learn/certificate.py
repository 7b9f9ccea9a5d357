"""The check of a proof that a problem of `taxel.learn.ConeX` has no solution."""

from __future__ import annotations

import numpy as np

from taxel._base.arguments import flag, instance
from taxel.learn.cone_x import Certificate, ConeXProblem

__all__ = ["check_certificate"]


def check_certificate(problem: ConeXProblem, certificate: Certificate, *, margin: bool = True) -> bool:
    """Check a proof of infeasibility against the stated rows, in plain NumPy.

    Every solution w satisfies ``row @ w == limit`` at a target and ``<= limit`` elsewhere. It follows that
    ``g @ w <= multipliers @ limits``, where g is the sum of the rows, each times its multiplier. If the minimum of
    ``g @ w`` within the bounds is larger, by more than any rounding error, there is no solution.

    In continuous time a margin is above 0. Rows that cancel without a margin, at least one of silence among them,
    therefore prove infeasibility for every margin. An example is a target in one pattern at a time at which another
    pattern with the same inputs up to then requires silence.

    Parameters
    ----------
    problem : ConeXProblem
        The problem (`ConeX.problem_`).
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
    ProblemError : a row that the problem does not have

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
    g, size, demanded, silent = np.zeros(len(problem.lb)), 0.0, 0.0, False
    most = np.maximum(np.abs(problem.lb), np.abs(problem.ub))
    # Values of both signs may cancel in a coefficient, whose rounding is then that of the spikes' own sizes.
    sizes, spikes = problem._without_signs()
    for row, multiplier in zip(certificate.rows, certificate.multipliers, strict=True):
        if multiplier < 0 and row.kind != "target":
            return False
        coefficients, limit = problem.row(row, margin=margin)
        g = g + multiplier * coefficients
        demanded += multiplier * limit
        silent |= row.kind == "silence" and multiplier > 0
        whole = coefficients if sizes is problem else sizes.row(row, margin=margin)[0]
        size += abs(multiplier) * (np.maximum(np.abs(coefficients), np.abs(whole)) @ most + abs(limit))
    least = np.minimum(problem.lb * g, problem.ub * g).sum()
    rounding = (len(certificate.rows) + len(most) + spikes) * np.finfo(float).eps * size
    cancels = silent and not margin and min(problem.margin) > 0 and demanded == 0 and not g.any()
    return bool(cancels or least - demanded > rounding)
