"""Presses a half disc by NGSolve (PyPI: ngsolve), run as a program: it keeps threads and memory of its own.

``python press_by_ngsolve.py ASKED.npz ANSWER.npz``: sizes, constants and steps in; reactions and base forces out.
Other than in taxel: triangles of second order on a mesh of Netgen's, the arc curved, forces and tangents derived by the
program from energies alone, friction by the slip since the last step, smoothed, UMFPACK.
"""

import sys

import netgen.geom2d
import ngsolve as ng
import numpy as np

asked = np.load(sys.argv[1])
nodes = asked["block_nodes"]
#: A force at one of these is what taxel's base gives: functions of first order at the same places.
low = np.sort(nodes[asked["block_held"], 0])
height, radius = nodes[:, 1].max(), np.ptp(asked["disc_nodes"][:, 0]) / 2
h = float(np.diff(nodes[asked["block_touching"], 0]).min())
way = asked["way"]
#: The half disc is meshed so far above the block, or their points would be taken for one.
APART = 1.0
#: Contact pressure by overlap, kPa/mm: four times taxel's usual. The slip by which friction is smoothed, mm.
PENALTY, SMOOTH = 40_000.0, 5e-5
#: What may be left out of balance, mN/mm; steps of Newton; order of integration; how far a touch is looked for, mm.
BALANCED, STEPS, ORDER, REACH = 1e-4, 40, 4, 0.3


def meshed():
    """Return both bodies, with a point of the block's base at each of taxel's nodes there."""
    made = netgen.geom2d.SplineGeometry()

    def outline(corners, sides, domain):
        points = [made.AppendPoint(*map(float, corner)) for corner in corners]
        at = 0
        for kind, name, size in sides:
            count = 2 if kind == "line" else 3
            ends = [points[(at + k) % len(points)] for k in range(count)]
            made.Append([kind, *ends], leftdomain=domain, rightdomain=0, bc=name, maxh=float(size))
            at += count - 1

    fine, middle = radius + 1, height + APART + radius
    corners = [*((x, 0) for x in low), (low[-1], height), (fine, height), (-fine, height), (low[0], height)]
    base = [("line", "base", 1.01 * length) for length in np.diff(low)]
    top = [("line", "top", size) for size in (0.3, h, 0.3)]
    outline(corners, [*base, ("line", "side", 0.4), *top, ("line", "side", 0.4)], 1)
    corners = [(-radius, middle), (-radius, middle - radius), (0, middle - radius), (radius, middle - radius)]
    outline([*corners, (radius, middle)], [("spline3", "arc", h), ("spline3", "arc", h), ("line", "driven", h)], 2)
    made.SetMaterial(1, "block")
    made.SetMaterial(2, "disc")
    mesh = ng.Mesh(made.GenerateMesh(maxh=0.4, grading=0.3))
    mesh.Curve(2)
    return mesh


mesh = meshed()
space = ng.VectorH1(mesh, order=2, dirichlet="base|driven")
u, v = space.TnT()
now, before = ng.GridFunction(space), ng.GridFunction(space)


def strained(name):
    """Return the energy of a body, plane stress and incompressible."""
    c10, c20, c30 = map(float, asked[name + "_yeoh_kpa"])
    gradient = ng.Id(2) + ng.Grad(u)
    x = ng.InnerProduct(gradient, gradient) + 1 / ng.Det(gradient) ** 2 - 3
    return ng.Variation((c10 * x + c20 * x**2 + c30 * x**3) * ng.dx(name))


solids, everything = ng.BilinearForm(space), ng.BilinearForm(space)
solids += strained("block")
solids += strained("disc")
everything += strained("block")
everything += strained("disc")
contact = ng.ContactBoundary(mesh.Boundaries("top"), mesh.Boundaries("arc"))
normal, place = contact.normal, ng.CoefficientFunction((ng.x, ng.y))
along = ng.CoefficientFunction((-normal[1], normal[0]))
overlap = (place + u - place.Other() - u.Other()) * normal
slip = (u - before - u.Other() + before.Other()) * along
held = float(asked["friction"]) * slip / ng.sqrt(slip**2 + SMOOTH**2)
apart = v - v.Other()
contact.AddIntegrator(PENALTY * ng.IfPos(overlap, overlap, 0) * (apart * normal + held * (apart * along)))

count = space.ndof // 2
vertices = np.array([vertex.point for vertex in mesh.vertices])
free = space.FreeDofs()
given = np.array([not one for one in free])
moved, rest = now.vec.FV().NumPy(), before.vec.FV().NumPy()
residual, step, start = (now.vec.CreateVector() for _ in range(3))
# In the hierarchical basis of second order a rigid shift involves the vertices' functions only.
of_disc = np.array(space.GetDofs(mesh.Materials("disc")))
disc = [of_disc & (np.arange(2 * count) // count == k) & (np.arange(2 * count) % count < len(vertices)) for k in (0, 1)]


def vertices_of(side):
    """Return the vertices of a side, and where their displacements stand, (n, 2)."""
    found = np.flatnonzero(np.array(space.GetDofs(mesh.Boundaries(side))))
    found = found[found < len(vertices)]
    return found, found[:, None] + [0, count]


def shift(by):
    """Move the half disc as it is."""
    for k in (0, 1):
        moved[disc[k]] += by[k]


def unbalanced():
    """Return how much force is out of balance, where nothing is held."""
    contact.Update(now, everything, ORDER, REACH)
    everything.Apply(now.vec, residual)
    residual.FV().NumPy()[given] = 0
    return float(np.linalg.norm(residual.FV().NumPy()))


def balanced():
    """Find the equilibrium by Newton's steps, halved where they lead further off."""
    size = unbalanced()
    for _ in range(STEPS):
        if size < BALANCED:
            return True
        everything.AssembleLinearization(now.vec)
        step.data = everything.mat.Inverse(free, "umfpack") * residual
        start.data = now.vec
        for share in (1.0, 0.5, 0.25, 0.125):
            now.vec.data = start - share * step
            new = unbalanced()
            if new < size * (1 - 0.1 * share):
                break
        size = new
    return False


def forces(at):
    """Return the forces inside the bodies at vertices that are held."""
    solids.Apply(now.vec, residual)
    return residual.FV().NumPy()[at]


(on_base, base), (_, driven) = vertices_of("base"), vertices_of("driven")
shift((0, -APART))
reaction, last = [np.zeros(2)], None
for near, far in zip(asked["paths"][:-1], asked["paths"][1:], strict=True):
    rest[:] = moved
    if last is None:
        shift((far - near) * way)
    else:  # as the last step did: all of them are of one length
        moved += moved - last
    last = rest.copy()
    if not balanced():
        sys.exit(f"NGSolve did not converge at {far}")
    reaction.append(forces(driven).sum(0) * [1, -1])
order = np.argsort(vertices[on_base, 0])
np.savez(
    sys.argv[2],
    reaction=np.array(reaction),
    base_x=vertices[on_base, 0][order],
    base_force=forces(base)[order] * [-1, 1],
)
