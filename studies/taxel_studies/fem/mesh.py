"""Meshes of four-node quadrilaterals: a block, fine where it is touched, and a half disc (an O-grid)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: How much longer an element may be than its neighbour towards the finer side.
_GROWTH = 1.15
#: Length of the block's elements at its sides, mm.
_SIDE_MM = 0.4
#: Half width of the half disc's square core, as a share of the radius.
_CORE = 0.5


@dataclass(frozen=True, eq=False)
class Mesh:
    """Hold nodes and quadrilaterals, and two of the outlines by name.

    Attributes
    ----------
    nodes : float64, shape (nodes, 2), mm
    quads : int64, shape (elements, 4)
        Counter-clockwise.
    held : int64
        Nodes whose displacement is given, from left to right: the block's base, the half disc's flat top.
    touching : int64
        Nodes of the outline that may touch, from left to right: the block's top, the half disc's arc.
    """

    nodes: NDArray[np.float64]
    quads: NDArray[np.int64]
    held: NDArray[np.int64]
    touching: NDArray[np.int64]


def block(width: float, height: float, fine: float, h: float, base_h: float) -> Mesh:
    """Mesh a block whose base lies on y = 0, centred on x = 0.

    Parameters
    ----------
    width, height : float, mm
    fine : float, mm
        Within this of the middle the elements at the top are `h` wide; from there they grow to the sides.
    h, base_h : float, mm
        Length of the elements at the top, and their height at the base.
    """
    half = width / 2
    inner = min(fine, half)
    count = max(1, round(inner / h))
    middle = np.linspace(-inner, inner, 2 * count + 1)
    outer = inner + _grown(half - inner, inner / count, max(_SIDE_MM, inner / count))[1:]
    x = np.concatenate([-outer[::-1], middle, outer])
    y = height - _grown(height, h, max(h, base_h))[::-1]
    y[0] = 0.0
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    numbers = np.arange(len(nodes)).reshape(len(y), len(x))
    return Mesh(nodes, _quads(numbers), numbers[0], numbers[-1])


def half_disc(radius: float, h: float, centre_y: float) -> Mesh:
    """Mesh the lower half of a disc of centre (0, `centre_y`): a square core and rings around it, `h` on the arc."""
    side = max(2, round(np.pi * radius / h / 4))
    core = _CORE * radius
    x = np.linspace(-core, core, 2 * side + 1)
    y = np.linspace(0, -core, side + 1)
    inside = np.stack(np.meshgrid(x, y), axis=-1)
    # The core's lower sides bulge a little, so that no element at its corners is flat.
    bulge = 0.15 * np.outer(y / -core, 1 - (x / core) ** 2) * core
    inside[..., 1] -= bulge
    inside[..., 0] *= 1 + 0.15 * (1 - (y[:, None] / -core)) * np.abs(x / core)
    rim = np.concatenate([inside[:-1, 0], inside[-1], inside[-2::-1, -1]])
    angle = np.pi + np.pi * np.arange(4 * side + 1) / (4 * side)
    arc = radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    arc[[0, -1], 1] = 0.0
    rings = max(2, round((radius - 1.1 * core) / h))
    shares = np.arange(1, rings + 1)[:, None, None] / rings
    around = rim + shares * (arc - rim)
    nodes = np.concatenate([inside.reshape(-1, 2), around.reshape(-1, 2)])
    numbers = np.arange(inside.shape[0] * inside.shape[1]).reshape(inside.shape[:2])
    edge = np.concatenate([numbers[:-1, 0], numbers[-1], numbers[-2::-1, -1]])
    outside = numbers.size + np.arange(around.shape[0] * around.shape[1]).reshape(around.shape[:2])
    outside = np.concatenate([edge[None], outside])
    quads = np.concatenate([_quads(numbers[::-1]), _quads(outside[::-1])])
    top = np.concatenate([outside[:0:-1, 0], numbers[0], outside[1:, -1]])
    nodes[:, 1] += centre_y
    return Mesh(nodes, quads, top, outside[-1])


def _grown(length: float, first: float, last: float) -> NDArray[np.float64]:
    """Divide a length from 0 on, the first part about `first` long and none longer than `last`."""
    if length <= 0:
        return np.zeros(1)
    parts, at = [first], first
    while at < length:
        parts.append(min(parts[-1] * _GROWTH, last))
        at += parts[-1]
    ends = np.concatenate([[0.0], np.cumsum(parts)])
    return np.asarray(ends * (length / ends[-1]))


def _quads(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the quadrilaterals of a grid of nodes; rows upwards, columns to the right."""
    corners = (numbers[:-1, :-1], numbers[:-1, 1:], numbers[1:, 1:], numbers[1:, :-1])
    return np.stack([c.ravel() for c in corners], axis=-1)
