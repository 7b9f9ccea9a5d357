"""A half disc pressed on a block of silicone along a straight path: its parameters, and the stress at the base."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel_studies.fem.contact import Contact
from taxel_studies.fem.material import DRAGON_SKIN_10, Yeoh
from taxel_studies.fem.mesh import Mesh, block, half_disc
from taxel_studies.fem.solids import Solids
from taxel_studies.fem.solver import State, Stopped, march

#: Depths of the shapes that a course keeps, in mm; and its end.
_SHAPES_MM = (0.5, 1.0, 1.5, 2.0)


@dataclass(frozen=True, kw_only=True)
class Indentation:
    """Describe a half disc pressed on a block (thesis 5.4.1). What the thesis does not state is marked (o).

    Parameters
    ----------
    diameter_mm : float, mm, above 0
    modulus_kpa : float, kPa, above 0
        Of the half disc, at small strain; neo-Hookean and incompressible (o).
    angle_deg : float, degrees, -60 to 60
        The path's, off the block's normal; the half disc is not turned.
    depth_mm : float, mm, above 0
        How far the half disc's flat top is moved along the path (o); at most the diameter, as the half disc has
        corners.
    silicone : Yeoh
        Table 5.2.
    friction : float, 0 or more
    width_mm, height_mm : float, mm, above 0
        Of the block (o). Its height matters most of all that is not stated.
    mesh_mm, base_mesh_mm : float, mm, above 0
        Length of elements where it is touched, and their height at the base, `mesh_mm` at least (o).
    step_um : float, um, above 0
        Of the path (o). Steps that do not converge are halved.
    penalty : float, above 0
        Contact pressure by overlap, in units of the silicone's modulus by `mesh_mm` (o).

    Examples
    --------
    >>> Indentation(diameter_mm=2, modulus_kpa=150, angle_deg=20).height_mm
    5.0
    """

    diameter_mm: float = 2.0
    modulus_kpa: float = 150.0
    angle_deg: float = 0.0
    depth_mm: float = 2.0
    silicone: Yeoh = DRAGON_SKIN_10
    friction: float = 0.7
    width_mm: float = 16.0
    height_mm: float = 5.0
    mesh_mm: float = 0.1
    base_mesh_mm: float = 0.2
    step_um: float = 8.0
    penalty: float = 50.0


@dataclass(frozen=True, eq=False)
class Course:
    """Hold the results along an indentation's path; forces are by mm of thickness.

    Attributes
    ----------
    indentation : Indentation
    path_mm : float64, shape (n,)
        From 0 on, in steps of ``step_um``.
    reaction : float64, shape (n, 2), mN/mm
        The force that moves the half disc: along x, and down.
    base : float64, shape (n, 2), mN/mm
        The reaction of the base along the same axes: the sum over its nodes.
    x_mm : float64, shape (base nodes,)
    pressure_kpa : float64, shape (n, base nodes)
        Normal traction on the base, force by length at rest: a node's reaction by the length that belongs to it.
    contact_mm, contact_kpa : float64, shape (top nodes,)
        Places at rest on the block's top, and the contact's normal traction there at the end.
    shapes : dict of path in mm to float32, shape (nodes, 2), mm
        Where the nodes of both bodies were.
    fault : str
        Why it ended before its depth; empty where it did not.
    factorisations, cuts : int
        Matrices that were solved; steps that were halved.
    """

    indentation: Indentation
    path_mm: NDArray[np.float64]
    reaction: NDArray[np.float64]
    base: NDArray[np.float64]
    x_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
    contact_mm: NDArray[np.float64]
    contact_kpa: NDArray[np.float64]
    shapes: dict[float, NDArray[np.float32]] = field(repr=False)
    fault: str = ""
    factorisations: int = 0
    cuts: int = 0


def bodies(indentation: Indentation) -> tuple[Mesh, Mesh]:
    """Return the meshes of the block and of the half disc, which just touch."""
    i = indentation
    radius = i.diameter_mm / 2
    return (
        block(i.width_mm, i.height_mm, radius + 1, i.mesh_mm, i.base_mesh_mm),
        half_disc(radius, i.mesh_mm, i.height_mm + radius),
    )


def press(indentation: Indentation) -> Course:
    """Press the half disc, step by step, in equilibrium at each (quasi-static).

    Parameters
    ----------
    indentation : Indentation

    Returns
    -------
    Course
        Where no equilibrium was found from some path on it ends there, and `fault` is the reason: nothing is filled in.

    Notes
    -----
    Plane stress, bilinear quadrilaterals, contact by penalty with Coulomb's friction, finite strain and sliding. The
    block's base is fixed, its sides are free. Shear waves cross the block in about 2 ms, so that what happens within
    1 or 2 ms is the inertia's as well, which is left out, as in the thesis.

    Examples
    --------
    >>> course = press(Indentation(depth_mm=0.2, mesh_mm=0.4, step_um=50))
    >>> bool(abs(course.reaction[-1] - course.base[-1]).max() < 1e-6)
    True
    """
    i = indentation
    ground, indenter = bodies(i)
    solids = Solids([(ground, i.silicone), (indenter, Yeoh.of_modulus(i.modulus_kpa))])
    top, arc = indenter.held + solids.first[1], indenter.touching + solids.first[1]
    contact = Contact(solids.nodes, ground.touching, arc, i.penalty * i.silicone.modulus_kpa / i.mesh_mm, i.friction)
    held = np.concatenate([_both(ground.held), _both(top)])
    way = np.array([math.sin(math.radians(i.angle_deg)), -math.cos(math.radians(i.angle_deg))])

    def displacement(path: float) -> NDArray[np.float64]:
        return np.concatenate([np.zeros(2 * len(ground.held)), np.tile(path * way, len(top))])

    count = max(1, round(i.depth_mm / (i.step_um / 1000)))
    paths = np.linspace(0, i.depth_mm, count + 1)
    shape_steps = {int(np.abs(paths - at).argmin()) for at in _SHAPES_MM if at <= i.depth_mm} | {count}
    base = _Base(ground, top)
    shapes: dict[float, NDArray[np.float32]] = {}
    fault, state = "", None
    try:
        for k, equilibrium in enumerate(march(solids, contact, held, displacement, paths)):
            state = equilibrium
            base.add(state)
            if k in shape_steps:
                shapes[state.path] = (solids.nodes + state.u.reshape(-1, 2)).astype(np.float32)
    except Stopped as stopped:
        fault = str(stopped)
    assert state is not None  # the first is at rest
    return Course(
        indentation=i,
        path_mm=paths[: len(base.reaction)],
        **base.columns(),
        contact_mm=ground.nodes[ground.touching, 0],
        contact_kpa=state.contact[2 * ground.touching + 1] / _belonging(ground.nodes[ground.touching, 0]),
        shapes=shapes,
        fault=fault,
        factorisations=state.factorisations,
        cuts=state.cuts,
    )


class _Base:
    """Collect forces on the half disc's top and at the block's base, step by step."""

    def __init__(self, ground: Mesh, top: NDArray[np.int64]) -> None:
        self._held, self._top = ground.held, top
        self._x = ground.nodes[ground.held, 0]
        self._length = _belonging(self._x)
        self.reaction: list[NDArray[np.float64]] = []
        self._base: list[NDArray[np.float64]] = []
        self._pressures: list[NDArray[np.float64]] = []

    def add(self, state: State) -> None:
        force = state.force.reshape(-1, 2)
        self.reaction.append(force[self._top].sum(0) * [1, -1])
        self._base.append(force[self._held].sum(0) * [-1, 1])
        self._pressures.append(force[self._held, 1] / self._length)

    def columns(self) -> dict[str, NDArray[np.float64]]:
        return {
            "x_mm": self._x,
            "reaction": np.array(self.reaction),
            "base": np.array(self._base),
            "pressure_kpa": np.array(self._pressures),
        }


def _both(nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.asarray((2 * nodes[:, None] + np.arange(2)).ravel())


def _belonging(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the length that belongs to each node of a line."""
    half = np.diff(x) / 2
    return np.asarray(np.concatenate([half, [0.0]]) + np.concatenate([[0.0], half]))
