"""The forces inside meshed solids in plane stress, and their tangent: bilinear quadrilaterals, 2 x 2 Gauss points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from taxel_studies.fem.material import Yeoh
from taxel_studies.fem.mesh import Mesh

_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)


def _gradients(nodes: NDArray[np.float64], at: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how shape functions change by the place at rest, (elements, points, 4, 2), and the Jacobian."""
    xi, eta = at[:, 0, None], at[:, 1, None]
    local = np.stack([_CORNERS[:, 0] * (1 + eta * _CORNERS[:, 1]), _CORNERS[:, 1] * (1 + xi * _CORNERS[:, 0])], axis=-1)
    local /= 4
    jacobian = np.einsum("eai,gaj->egij", nodes, local)
    return np.einsum("gaj,egji->egai", local, np.linalg.inv(jacobian)), np.linalg.det(jacobian)


class Solids:
    """Assemble bodies into one vector of forces and one matrix; the unknowns are x and y of each node in turn.

    Parameters
    ----------
    bodies : sequence of (Mesh, Yeoh)
        Their nodes follow each other.

    Attributes
    ----------
    nodes : float64, shape (nodes, 2), mm
        At rest.
    first : list of int
        Each body's first node.
    """

    def __init__(self, bodies: Sequence[tuple[Mesh, Yeoh]]) -> None:
        self.nodes = np.concatenate([mesh.nodes for mesh, _ in bodies])
        self.first = [0, *np.cumsum([len(mesh.nodes) for mesh, _ in bodies]).tolist()]
        self._quads = np.concatenate([mesh.quads + k for (mesh, _), k in zip(bodies, self.first, strict=False)])
        ends = np.cumsum([0, *(len(mesh.quads) for mesh, _ in bodies)])
        self._parts = [(slice(a, b), law) for a, b, (_, law) in zip(ends[:-1], ends[1:], bodies, strict=True)]
        slopes, weights = _gradients(self.nodes[self._quads], _CORNERS / np.sqrt(3))
        # Per element (16, 8): the gradient's four entries at four points from the eight displacements.
        self._b = np.zeros((len(self._quads), 4, 4, 8))
        self._b[..., 0, 0::2] = self._b[..., 2, 1::2] = slopes[..., 0]
        self._b[..., 1, 0::2] = self._b[..., 3, 1::2] = slopes[..., 1]
        self._weights = weights
        self._dofs = (2 * self._quads[..., None] + np.arange(2)).reshape(len(self._quads), 8)
        rows = np.repeat(self._dofs, 8, axis=1).ravel()
        columns = np.tile(self._dofs, (1, 8)).ravel()
        size = 2 * len(self.nodes)
        keys, slot = np.unique(columns * size + rows, return_inverse=True)
        self._slot = slot
        self._indices = (keys % size).astype(np.int32)
        self._pointers = np.searchsorted(keys, np.arange(size + 1) * size).astype(np.int32)

    def gradient(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the deformation gradients (11, 12, 21, 22), shape (elements, points, 4)."""
        local = u[self._dofs]
        b = self._b.reshape(len(local), 16, 8)
        return np.asarray((b @ local[..., None])[..., 0].reshape(-1, 4, 4) + np.array([1.0, 0.0, 0.0, 1.0]))

    def forces(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], sparse.csc_array]:
        """Return the forces (mN by mm of thickness) that hold a displacement, and their derivative by it.

        Raises
        ------
        ArithmeticError : an element is turned inside out
        """
        f = self.gradient(u)
        if not np.all(f[..., 0] * f[..., 3] - f[..., 1] * f[..., 2] > 0):
            raise ArithmeticError("an element is turned inside out")
        stress, tangent = np.empty_like(f), np.empty((*f.shape, 4))
        for part, law in self._parts:
            stress[part], tangent[part] = law.tangent(f[part])
        b = self._b.reshape(len(f), 16, 8)
        weighed = (stress * self._weights[..., None]).reshape(len(f), 1, 16)
        force: NDArray[Any] = np.bincount(self._dofs.ravel(), (weighed @ b).ravel(), 2 * len(self.nodes))
        tangent *= self._weights[..., None, None]
        stiffness = b.transpose(0, 2, 1) @ (tangent @ self._b).reshape(len(f), 16, 8)
        values = np.bincount(self._slot, stiffness.ravel(), len(self._indices))
        size = 2 * len(self.nodes)
        return force, sparse.csc_array((values, self._indices, self._pointers), shape=(size, size))

    def energy(self, u: NDArray[np.float64]) -> float:
        """Return the energy of a displacement, uJ by mm of thickness (mN mm)."""
        f = self.gradient(u)
        return sum(float((law.energy(f[part]) * self._weights[part]).sum()) for part, law in self._parts)
