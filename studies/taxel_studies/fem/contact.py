"""Contact with friction between the block's top and the arc: penalties at Gauss points, the tangent by complex step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

#: Gauss points on an edge of the block's top, and their weights.
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(3)
#: The step of the complex derivative; nothing is subtracted, so it may be as small as one likes.
_STEP = 1e-30
#: How many segments away from the nearest one a point's own may be, and Newton steps that find its place there.
_MOVES, _ROOTS = 3, 4


@dataclass(frozen=True, eq=False)
class Touch:
    """Hold the contact at the end of a step, by Gauss point.

    Attributes
    ----------
    traction : float64, kPa
        Along the arc; NaN where nothing touched.
    place : float64, mm
        Along the arc at rest.
    """

    traction: NDArray[np.float64]
    place: NDArray[np.float64]


class Contact:
    """Press an outline, a polyline, on edges with Gauss points.

    Parameters
    ----------
    nodes : float64, shape (nodes, 2), mm
        At rest.
    edges, arc : int64
        Nodes of the block's top and of the arc, from left to right; the arc's other side is outside.
    penalty : float, kPa/mm
        Pressure by depth of overlap, and traction by slip until it slides.
    friction : float
        Traction by pressure where it slides.
    """

    def __init__(
        self,
        nodes: NDArray[np.float64],
        edges: NDArray[np.int64],
        arc: NDArray[np.int64],
        penalty: float,
        friction: float,
    ) -> None:
        self._arc, self._penalty, self._friction = arc, penalty, friction
        self._ends = np.repeat(np.stack([edges[:-1], edges[1:]], axis=-1), len(_PLACES), axis=0)
        length = np.linalg.norm(np.diff(nodes[edges], axis=0), axis=1)
        self._weight = (length[:, None] / 2 * _WEIGHTS).ravel()
        share = np.tile((1 + _PLACES) / 2, len(length))
        self._shape = np.stack([1 - share, share], axis=-1)
        self._lengths = np.linalg.norm(np.diff(nodes[arc], axis=0), axis=1)
        self._places = np.concatenate([[0.0], np.cumsum(self._lengths)])
        self._size = 2 * len(nodes)

    def apart(self) -> Touch:
        """Return the state of no contact."""
        return Touch(np.full(len(self._weight), np.nan), np.full(len(self._weight), np.nan))

    # A Newton iterate far from any contact divides by 0; the solver discards its result and halves the step.
    @np.errstate(divide="ignore", invalid="ignore", over="ignore")
    def forces(self, x: NDArray[np.float64], before: Touch) -> tuple[NDArray[np.float64], sparse.csc_array, Touch]:
        """Return the forces that hold the bodies against the contact's, their derivative, and the touch.

        Parameters
        ----------
        x : float64, shape (nodes, 2), mm
            Where the nodes are.
        before : Touch
            At the end of the last step.

        Raises
        ------
        ArithmeticError : the contact reaches the end of the arc
        """
        points = (self._shape[..., None] * x[self._ends]).sum(1)
        outline = x[self._arc]
        near = np.flatnonzero(points[:, 1] > outline[:, 1].min())
        last = len(self._lengths) - 1
        middle = (outline[:-1] + outline[1:]) / 2
        segment = ((points[near, None] - middle) ** 2).sum(-1).argmin(1)
        for _ in range(_MOVES):
            numbers = self._nodes(near, segment)
            share, pressure = self._projected(x[numbers], near, segment)[2:4]
            segment = np.clip(segment + (share > 1).astype(int) - (share < 0).astype(int), 0, last)
        touching = pressure > 0
        near, segment, numbers, share = near[touching], segment[touching], numbers[touching], share[touching]
        if np.any((segment == 0) & (share < 0)) or np.any((segment == last) & (share > 1)):
            raise ArithmeticError("the contact reaches the end of the half disc's arc; press less deep")
        q = x[numbers].reshape(len(near), 12)
        shifted = q + 1j * _STEP * np.vstack([np.zeros(12), np.eye(12)])[:, None]
        force, traction, place = self._element(shifted, near, segment, before)
        tangent = (force[1:].imag / _STEP).transpose(1, 2, 0)
        dofs = (2 * numbers[..., None] + np.arange(2)).reshape(len(near), 12)
        total: NDArray[Any] = np.bincount(dofs[:, :8].ravel(), force[0].real.ravel(), self._size)
        rows, columns = np.repeat(dofs[:, :8], 12, axis=1).ravel(), np.tile(dofs, (1, 8)).ravel()
        matrix = sparse.coo_array((tangent.ravel(), (rows, columns)), shape=(self._size, self._size)).tocsc()
        after = self.apart()
        after.traction[near], after.place[near] = traction[0].real, place[0].real
        return total, matrix, after

    def _nodes(self, near: NDArray[np.int64], segment: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return two nodes of the top, the segment's two, the one before them and the one behind."""
        behind = np.minimum(segment + 2, len(self._arc) - 1)
        on_arc = self._arc[np.stack([segment, segment + 1, np.maximum(segment - 1, 0), behind], axis=-1)]
        return np.concatenate([self._ends[near], on_arc], axis=1)

    def _projected(
        self, nodes: NDArray[Any], near: NDArray[np.int64], segment: NDArray[np.int64]
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Return the arc's normal where a point lies on it, the segment's length, the point's share of it, pressure.

        The normal turns along a segment from one node's to the next (each the mean of its two segments'), so that
        nothing jumps where a point slides over a node.
        """
        point = (self._shape[near][..., None] * nodes[..., :2, :]).sum(-2)
        a, b = nodes[..., 2, :], nodes[..., 3, :]
        along = b - a
        before = np.where((segment == 0)[:, None], along, a - nodes[..., 4, :])
        behind = np.where((segment == len(self._lengths) - 1)[:, None], along, nodes[..., 5, :] - b)
        own = _unit(along)
        first, turn = _unit(_unit(before) + own), _unit(own + _unit(behind))
        turn = turn - first
        ahead = point - a
        # Where the tangent at the share has no part of what is left: a quadratic equation, by Newton from the chord.
        c0 = (ahead * first).sum(-1)
        c1 = (ahead * turn).sum(-1) - (along * first).sum(-1)
        c2 = -(along * turn).sum(-1)
        share = -c0 / c1
        for _ in range(_ROOTS):
            share = share - (c0 + share * (c1 + share * c2)) / (c1 + 2 * share * c2)
        tangent = _unit(first + share[..., None] * turn)
        normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=-1)
        pressure = -self._penalty * ((ahead - share[..., None] * along) * normal).sum(-1)
        return normal, np.sqrt((along**2).sum(-1)), share, pressure

    def _element(
        self, q: NDArray[np.complex128], near: NDArray[np.int64], segment: NDArray[np.int64], before: Touch
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the forces on two nodes of the top and two of the arc, traction, and place on the arc."""
        shape = self._shape[near]
        normal, length, share, pressure = self._projected(q.reshape(*q.shape[:-1], 6, 2), near, segment)
        tangent = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
        rest = self._lengths[segment]
        place = self._places[segment] + share * rest
        # Where it did not touch before there is no traction yet: an anchor that moves would stall Newton.
        old = np.isnan(before.place[near])
        slip = (place - np.where(old, 0, before.place[near])) * (length / rest)
        traction = np.where(old, 0, np.where(old, 0, before.traction[near]) - self._penalty * slip)
        most = self._friction * pressure
        traction = np.where(np.abs(traction.real) > most.real, np.sign(traction.real) * most, traction)
        push = (pressure[..., None] * normal + traction[..., None] * tangent) * self._weight[near, None]
        on_arc = np.stack([1 - share, share], axis=-1)
        force = np.concatenate(
            [-shape[..., None] * push[..., None, :], on_arc[..., None] * push[..., None, :]], axis=-2
        )
        return force.reshape(*q.shape[:-1], 8), traction, place


def _unit(vector: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(vector / np.sqrt((vector**2).sum(-1))[..., None])
