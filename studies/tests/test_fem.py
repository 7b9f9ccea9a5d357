"""A half disc on silicone by finite elements: laws, closed forms and symmetry."""

from __future__ import annotations

import math

import numpy as np
import pytest

from taxel_studies.fem import (
    DRAGON_SKIN_10,
    Course,
    Indentation,
    Yeoh,
    bodies,
    press,
)
from taxel_studies.fem.contact import Contact
from taxel_studies.fem.solids import Solids

#: Chosen so that the tests take seconds, not minutes.
COARSE = {"mesh_mm": 0.25, "step_um": 25.0}


@pytest.fixture(scope="module")
def slanted() -> Course:
    return press(Indentation(diameter_mm=2, modulus_kpa=150, angle_deg=20, depth_mm=0.6, **COARSE))


def gradients(seed: int, count: int = 40) -> np.ndarray:
    return np.array([1.0, 0, 0, 1]) + np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 4)) * [1, 1, 1, 0.7]


# The material


@pytest.mark.parametrize("law", [DRAGON_SKIN_10, Yeoh.of_modulus(150), Yeoh(3600, -500, 40)])
def test_stress_and_tangent_are_the_derivatives_of_the_energy(law):
    """By complex step, so to rounding."""
    f = gradients(1)
    stress, tangent = law.tangent(f)
    for k in range(4):
        moved = f.astype(complex)
        moved[:, k] += 1e-30j
        energy = law.energy(moved)
        np.testing.assert_allclose(np.imag(energy) / 1e-30, stress[:, k], rtol=1e-11, atol=1e-10)
        np.testing.assert_allclose(np.imag(law.stress(moved)) / 1e-30, tangent[..., k], rtol=1e-10, atol=1e-9)


def test_a_turned_solid_feels_nothing():
    angle = np.linspace(0, 6, 50)
    turned = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=-1)
    assert np.abs(DRAGON_SKIN_10.stress(turned)).max() < 1e-13


@pytest.mark.parametrize("stretch", [0.3, 0.8, 1.5, 4.0])
def test_uniaxial_stretch_has_its_closed_form(stretch):
    slope = float(DRAGON_SKIN_10.slope(np.array(stretch**2 + 2 / stretch - 3)))
    stress = DRAGON_SKIN_10.stress(np.array([stretch, 0, 0, stretch**-0.5]))
    np.testing.assert_allclose(stress, [2 * slope * (stretch - stretch**-2), 0, 0, 0], atol=1e-12)


# Assembly


def test_the_forces_of_solids_and_contact_have_the_right_derivative(slanted):
    i = slanted.indentation
    ground, disc = bodies(i)
    solids = Solids([(ground, i.silicone), (disc, Yeoh.of_modulus(150))])
    contact = Contact(solids.nodes, ground.touching, disc.touching + solids.first[1], 4000.0, 0.7)
    x = slanted.shapes[max(slanted.shapes)]
    u = (x - solids.nodes).ravel()
    touch = contact.forces(x - [0, 2e-3], contact.apart())[2]
    way = np.random.default_rng(2).normal(size=len(u))
    for forces in (solids.forces, lambda u: contact.forces(solids.nodes + u.reshape(-1, 2), touch)):
        right = forces(u)[1] @ way
        found = (forces(u + 1e-8 * way)[0] - forces(u - 1e-8 * way)[0]) / 2e-8
        assert np.abs(right).max() > 100
        np.testing.assert_allclose(found, right, atol=1e-5 * np.abs(right).max())
    energy = (solids.energy(u + 1e-6 * way) - solids.energy(u - 1e-6 * way)) / 2e-6
    assert energy == pytest.approx(solids.forces(u)[0] @ way, rel=1e-6)


def test_friction_holds_back_what_slides_and_no_more_than_coulomb_says():
    asked = Indentation(diameter_mm=2, modulus_kpa=150, depth_mm=0.6, **COARSE)
    course = press(asked)
    ground, disc = bodies(asked)
    nodes = np.concatenate([ground.nodes, disc.nodes])
    rough, smooth = (
        Contact(nodes, ground.touching, disc.touching + len(ground.nodes), 4000.0, friction) for friction in (0.7, 0.0)
    )
    x = course.shapes[max(course.shapes)]
    touch = rough.forces(x, rough.apart())[2]

    def held(contact: Contact, aside: float) -> np.ndarray:
        """The force that holds the block's top when it is moved to the right."""
        moved = x.copy()
        moved[ground.touching] += [aside, 0]
        return contact.forces(moved, touch)[0].reshape(-1, 2)[ground.touching].sum(0)

    normal = held(smooth, 0.02)[1]
    still, little, far, back = (held(rough, a)[0] - held(smooth, a)[0] for a in (0.0, 1e-4, 0.02, -0.02))
    assert abs(still) < 1e-9 * normal
    assert 0 < little < far
    assert back == pytest.approx(-far, rel=1e-6)
    assert 0.4 * normal < far <= 0.7 * normal  # points that newly touch have no traction yet


# The whole


def test_the_base_gives_back_what_presses_to_rounding(slanted):
    np.testing.assert_allclose(slanted.base, slanted.reaction, atol=1e-6)
    length = np.gradient(slanted.x_mm)
    length[[0, -1]] /= 2
    np.testing.assert_allclose(slanted.pressure_kpa @ length, slanted.reaction[:, 1], atol=1e-6)
    assert slanted.reaction[-1, 0] > 1 < slanted.reaction[-1, 1]


def test_a_course_that_finds_no_equilibrium_ends_there_and_says_so():
    """The half disc goes more sideways than down, until its end would touch."""
    course = press(Indentation(angle_deg=60, modulus_kpa=50, depth_mm=1.5, mesh_mm=0.4, step_um=100.0))
    assert "stopped at" in course.fault
    assert course.path_mm[-1] < 1.5
    assert len(course.path_mm) == len(course.pressure_kpa) == len(course.reaction)


# Against closed forms and finer meshes


@pytest.mark.slow
@pytest.mark.parametrize("modulus", [1e5, 50.0])
def test_a_shallow_press_without_friction_is_hertz(modulus):
    """A line contact in plane stress: E* = E. Hertz' pressure is averaged as a node's share of the force is."""
    course = press(Indentation(diameter_mm=4, modulus_kpa=modulus, friction=0, mesh_mm=0.03, depth_mm=0.02, step_um=4))
    radius, force = 2.0, course.reaction[-1, 1]
    both = 1 / (1 / DRAGON_SKIN_10.modulus_kpa + 1 / modulus)
    half = math.sqrt(4 * force * radius / (math.pi * both))
    assert half / radius < 0.075
    middle = len(course.contact_mm) // 2
    h = course.contact_mm[middle + 1] - course.contact_mm[middle]
    near = np.linspace(-h, h, 4001)
    weight = 1 - np.abs(near) / h
    peak = 2 * force / (math.pi * half) * (np.sqrt(1 - (near / half) ** 2) * weight).sum() / weight.sum()
    assert course.contact_kpa[middle] == pytest.approx(peak, rel=0.005)


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_a_mesh_twice_as_fine_gives_the_same_base_pressure():
    asked = {"diameter_mm": 2, "modulus_kpa": 150, "angle_deg": 20}
    coarse = press(Indentation(**asked))
    fine = press(Indentation(**asked, mesh_mm=0.05, base_mesh_mm=0.1))
    for depth in (0.5, 1.0, 2.0):
        k, at = (int(np.abs(course.path_mm - depth).argmin()) for course in (coarse, fine))
        there = np.interp(coarse.x_mm, fine.x_mm, fine.pressure_kpa[at])
        peak = fine.pressure_kpa[at].max()
        inside = np.abs(coarse.x_mm) <= 2
        assert np.abs(coarse.pressure_kpa[k] - there)[inside].max() < 0.005 * peak
        assert coarse.reaction[k, 1] == pytest.approx(fine.reaction[at, 1], rel=0.005)
