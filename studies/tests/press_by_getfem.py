"""Presses a half disc by GetFEM (Debian: python3-getfem), which lives in the system's Python: run as a program.

``python3 press_by_getfem.py ASKED.npz ANSWER.npz``: meshes, constants and steps in; reactions and base forces out.
Other than in taxel: contact by ray tracing with multipliers and an augmented Lagrangian, MUMPS, its own assembly.
"""

import sys

import getfem as gf
import numpy as np

asked = np.load(sys.argv[1])
gf.util_trace_level(0)
gf.util_warning_level(0)


def mesh_of(name):
    mesh = gf.Mesh("empty", 2)
    nodes, quads = asked[name + "_nodes"], asked[name + "_quads"]
    for quad in quads:
        # GetFEM counts the corners of a square row by row.
        mesh.add_convex(gf.GeoTrans("GT_QK(2,1)"), nodes[quad[[0, 1, 3, 2]]].T)
    for region, part in enumerate(("held", "touching"), start=1):
        points = mesh.pid_from_coords(nodes[asked[name + "_" + part]].T, 1e-7)
        mesh.set_region(region, mesh.faces_from_pid(points))
    displacement = gf.MeshFem(mesh, 2)
    displacement.set_classical_fem(1)
    return mesh, displacement, gf.MeshIm(mesh, 4)


HELD, TOUCHING = 1, 2
(_, f1, i1), (m2, f2, i2) = mesh_of("block"), mesh_of("disc")
m1 = f1.linked_mesh()
model = gf.Model("real")
for k, f in ((1, f1), (2, f2)):
    model.add_fem_variable(f"u{k}", f)
    model.add_fem_data(f"w{k}", f)
energies = []
for k, (name, im) in enumerate((("block", i1), ("disc", i2)), start=1):
    c10, c20, c30 = asked[name + "_yeoh_kpa"]
    gradient = f"(Id(2)+Grad_u{k})"
    x = f"(Norm_sqr({gradient})+1/sqr(Det({gradient}))-3)"
    energies.append(f"{c10!r}*{x}+({c20!r})*sqr({x})+({c30!r})*pow({x},3)")
    model.add_nonlinear_term(im, energies[-1])
model.add_initialized_data("still", [0.0, 0.0])
model.add_initialized_data("moved", [0.0, 0.0])
model.add_Dirichlet_condition_with_simplification("u1", HELD, "still")
model.add_Dirichlet_condition_with_simplification("u2", HELD, "moved")
multiplier = gf.MeshFem(m1, 2)
multiplier.set_classical_fem(1)
model.add_filtered_fem_variable("traction", multiplier, TOUCHING)
model.add_initialized_data("r", [100.0])
model.add_initialized_data("friction", [float(asked["friction"])])
model.add_initialized_data("alpha", [1.0])
brick = model.add_integral_large_sliding_contact_brick_raytracing("r", 0.5, "friction", "alpha", 0)
model.add_slave_contact_boundary_to_large_sliding_contact_brick(brick, i1, TOUCHING, "u1", "traction", "w1")
model.add_master_contact_boundary_to_large_sliding_contact_brick(brick, i2, TOUCHING, "u2", "w2")


def inner(k):
    """Return the force inside body k at each node, which its supports and the contact hold."""
    im, f = ((i1, f1), (i2, f2))[k - 1]
    found = gf.asm_generic(im, 1, energies[k - 1], -1, model)
    span = model.interval_of_variable(f"u{k}")
    return found[span[0] : span[0] + span[1]].reshape(-1, 2), f.basic_dof_nodes()[:, ::2].T


reaction, base = [np.zeros(2)], []
for path in asked["paths"][1:]:
    model.set_variable("moved", asked["way"] * path)
    iterations = model.solve(
        "max_res", 1e-8, "max_iter", 40, "lsearch", "simplest", "alpha min", 0.2, "lsolver", "mumps"
    )[0]
    if iterations >= 40:
        sys.exit(f"GetFEM did not converge at {path}")
    for k in (1, 2):
        model.set_variable(f"w{k}", model.variable(f"u{k}"))
    force, at = inner(2)
    top = np.abs(at[:, 1] - asked["disc_nodes"][:, 1].max()) < 1e-7
    reaction.append(force[top].sum(0) * [1, -1])
force, at = inner(1)
low = np.flatnonzero(np.abs(at[:, 1]) < 1e-7)
low = low[np.argsort(at[low, 0])]
np.savez(sys.argv[2], reaction=np.array(reaction), base_x=at[low, 0], base_force=force[low] * [-1, 1])
