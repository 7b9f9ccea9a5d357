"""Newton's method on two solids that touch, one prescribed step after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from taxel_studies.fem.contact import Contact, Touch
from taxel_studies.fem.solids import Solids

#: A residual below this, mN by mm of thickness, counts as none.
_TOLERANCE = 1e-8
_ITERATIONS = 15
#: Newton's first steps are whole; then the part of a step that leaves the least residual.
_FULL_STEPS = 3
_PARTS = (1.0, 0.5, 0.25, 0.1)
#: How often a step may be halved.
_HALVINGS, _FIRST_HALVINGS = 9, 3


class Stopped(ArithmeticError):  # noqa: N818  no error of the caller's
    """Raised where no equilibrium was found further on; its text holds the path so far."""


@dataclass(frozen=True, eq=False)
class State:
    """Hold an equilibrium.

    Attributes
    ----------
    path : float, mm
    u : float64, shape (2 * nodes,), mm
    touch : Touch
    force : float64, shape (2 * nodes,)
        What must hold each node from outside, mN by mm of thickness: nothing but where it is held.
    contact : float64, shape (2 * nodes,)
        The contact's share of it.
    factorisations, cuts : int
        So far.
    """

    path: float
    u: NDArray[np.float64]
    touch: Touch
    force: NDArray[np.float64]
    contact: NDArray[np.float64]
    factorisations: int = 0
    cuts: int = 0


def march(
    solids: Solids,
    contact: Contact,
    held: NDArray[np.int64],
    prescribed: Callable[[float], NDArray[np.float64]],
    paths: NDArray[np.float64],
) -> Iterator[State]:
    """Give the equilibrium at each path in turn.

    Parameters
    ----------
    solids, contact
    held : int64
        The unknowns that are prescribed.
    prescribed : function of the path
        Their values.
    paths : float64, mm, rising

    Raises
    ------
    Stopped : no equilibrium was found from some path on, however small the step
    """
    size = 2 * len(solids.nodes)
    free = np.setdiff1d(np.arange(size), held)
    state = State(float(paths[0]), np.zeros(size), contact.apart(), np.zeros(size), np.zeros(size))
    yield state
    # Newton's method fails most easily at the first contact, of a point or two.
    last, cut = state, _FIRST_HALVINGS
    for goal in paths[1:]:
        begun = state.path
        done = 0
        while done < 2**cut:
            done += 1
            path = float(goal) if done == 2**cut else begun + (goal - begun) * done / 2**cut
            try:
                reached = _equilibrium(solids, contact, held, free, prescribed(path), path, state, last)
            except ArithmeticError as fault:
                if cut == _HALVINGS:
                    raise Stopped(f"stopped at {state.path:.4f} mm: {fault}") from None
                cut, done = cut + 1, 2 * (done - 1)
                state = State(**{**vars(state), "cuts": state.cuts + 1})
                continue
            last, state = state, reached
            if cut and done % 2 == 0:
                cut, done = cut - 1, done // 2
        yield state


@dataclass(frozen=True, eq=False)
class _Residual:
    """Hold the residual forces of a displacement, and their derivative."""

    u: NDArray[np.float64]
    total: NDArray[np.float64]
    pushed: NDArray[np.float64]
    matrix: sparse.csc_array
    touch: Touch


def _equilibrium(
    solids: Solids,
    contact: Contact,
    held: NDArray[np.int64],
    free: NDArray[np.int64],
    prescribed: NDArray[np.float64],
    path: float,
    state: State,
    last: State,
) -> State:
    u = state.u.copy()
    if state.path > last.path:
        u += (state.u - last.u) * ((path - state.path) / (state.path - last.path))
    u[held] = prescribed
    count = state.factorisations

    def at(u: NDArray[np.float64]) -> _Residual:
        inner, stiffness = solids.forces(u)
        pushed, tangent, touch = contact.forces(solids.nodes + u.reshape(-1, 2), state.touch)
        return _Residual(u, inner + pushed, pushed, stiffness + tangent, touch)

    here = at(u)
    for iteration in range(_ITERATIONS):
        if np.abs(here.total[free]).max() < _TOLERANCE:
            return State(path, here.u, here.touch, here.total, here.pushed, count, state.cuts)
        step = _solved(here.matrix[:, free][free], here.total[free])
        count += 1
        here = _along(at, here, step, free, patient=iteration < _FULL_STEPS)
    left = np.abs(here.total[free]).max()
    raise ArithmeticError(f"no equilibrium after {_ITERATIONS} iterations, {left:.2g} mN/mm are left")


def _solved(matrix: sparse.csc_array, right: NDArray[np.float64]) -> NDArray[np.float64]:
    try:
        factor = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01, options={"SymmetricMode": True})
        return np.asarray(factor.solve(right))
    except RuntimeError:
        raise ArithmeticError("a singular matrix") from None


def _along(
    at: Callable[[NDArray[np.float64]], _Residual],
    here: _Residual,
    step: NDArray[np.float64],
    free: NDArray[np.int64],
    *,
    patient: bool,
) -> _Residual:
    """Take a Newton step, shortened only where the full one fails: where contacts open and close, Newton may cycle."""
    norm = np.linalg.norm(here.total[free])
    best, fault = None, None
    for part in _PARTS:
        u = here.u.copy()
        u[free] -= part * step
        try:
            there = at(u)
        except ArithmeticError as error:
            fault = error
            continue
        residual = np.linalg.norm(there.total[free])
        if patient or residual < (1 - part / 4) * norm:
            return there
        if best is None or residual < best[0]:
            best = residual, there
    if best is None:
        raise ArithmeticError(str(fault))
    return best[1]
