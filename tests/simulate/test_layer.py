"""The bonded layer: its state equation and the conditions of contact."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from taxel import Array
from taxel.simulate import Layer

#: Foam that is linear however far it is pressed here.
LINEAR = {"yield_strain": 0.9, "densification_strain": 0.99}


def by_state_equation(x: float, nu: float) -> tuple[float, float]:
    """Return displacement of the face (in h / E) and stress at the base under a wave of pressure of 1; x is q h."""
    shear, confined = 1 / (2 * (1 + nu)), (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    ratio = nu / (1 - nu)
    # d/dz of u, w, tau, sigma for waves sin, cos, sin, cos: Hooke's law in plane strain and equilibrium.
    law = np.array(
        [
            [0, x, 1 / shear, 0],
            [-ratio * x, 0, 0, 1 / confined],
            [x * x / (1 - nu * nu), 0, 0, ratio * x],
            [0, 0, -x, 0],
        ]
    )
    through = expm(law)
    # Bonded at the base (u = w = 0), no shear and a pressure of 1 above.
    tau, sigma = np.linalg.solve(through[2:, 2:], [0.0, 1.0])
    return float(through[1, 2:] @ [tau, sigma]), float(sigma)


@pytest.mark.parametrize("nu", [0.0, 0.1, 0.3, 0.45, 0.49])
def test_displacement_and_base_stress_solve_the_layers_state_equation(nu):
    layer = Layer({"poisson": nu, "modulus_kpa": 40.0, "thickness_mm": 8.0}, Array(4, 4, 1.0))
    for x in (1e-3, 0.03, 0.3, 1.0, 2.0, 4.0, 7.0):
        face, base = by_state_equation(x, nu)
        assert layer.compliance([x / 8])[0] == pytest.approx(8 / 40 * face, rel=1e-6, abs=1e-9)
        assert layer.base_share([x / 8])[0] == pytest.approx(base, rel=1e-6, abs=1e-9)


@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@given(
    nu=st.floats(0, 0.49),
    modulus=st.floats(1, 1e5),
    layers=st.floats(0.3, 60),
    pitch=st.floats(0.3, 6),
    depth=st.floats(-4, -0.7),
    bodies=st.lists(
        st.tuples(st.floats(-0.2, 1.2), st.floats(-0.2, 1.2), st.floats(0, 3), st.floats(0, 1)), min_size=1, max_size=3
    ),
)
def test_pressure_is_never_negative_and_only_where_the_gap_is_closed(nu, modulus, layers, pitch, depth, bodies):
    """The gap is worked out here, by NumPy's FFT of a plane that is wider than the layer's influence."""
    rows, columns = 14, 18
    thick = layers * pitch
    layer = Layer(
        {"poisson": nu, "modulus_kpa": modulus, "thickness_mm": thick, **LINEAR}, Array(rows, columns, pitch_mm=pitch),
        tolerance=1e-8,
    )  # fmt: skip
    deep = thick * 10**depth
    y, x = np.mgrid[:rows, :columns] * pitch
    height = np.full((rows, columns), np.inf)
    for place_x, place_y, radius, edge in bodies:
        dx, dy = x - place_x * columns * pitch, y - place_y * rows * pitch
        height = np.minimum(height, 0.3 * edge * np.abs(dx) + (1 - edge) * (dx**2 + dy**2) / (2 * 10**radius))
    sunk = deep - height
    pressure, base, force = layer.press(sunk)
    assert np.all(pressure >= 0)
    assert np.all(np.isfinite(base))
    assert force == pytest.approx(pressure.sum() * pitch**2 / 1000)
    wide = 1024
    q = np.hypot(np.fft.fftfreq(wide, pitch / (2 * np.pi))[:, None], np.fft.rfftfreq(wide, pitch / (2 * np.pi)))
    plane = np.zeros((wide, wide))
    plane[:rows, :columns] = pressure
    pushed = np.fft.irfft2(np.fft.rfft2(plane) * layer.compliance(q).reshape(q.shape), s=(wide, wide))
    gap = pushed[:rows, :columns] - sunk
    near = height < deep * (1 + 1e-9)
    assert gap[near].min(initial=0) > -3e-3 * deep
    assert np.abs(pressure * gap).max() <= 3e-3 * deep * max(pressure.max(), 1e-12)


def test_a_footprint_of_many_taxels_is_solved_as_one_of_few():
    """Above 600 taxels another solver takes over; force grows with depth as smoothly there as elsewhere."""
    array = Array(64, 64, pitch_mm=1.0)
    y, x = np.mgrid[:64, :64] - 31.5
    forces, counts = [], []
    layer = Layer({"modulus_kpa": 50.0, **LINEAR}, array, tolerance=1e-7)
    for depth in np.linspace(0.7, 1.3, 7):
        layer.forget()
        pressed = layer.press(depth - (x**2 + y**2) / 250)
        forces.append(pressed.force_n)
        counts.append(int((depth > (x**2 + y**2) / 250).sum()))
    assert counts[0] < 600 < counts[-1]
    steps = np.diff(np.log(forces)) / np.diff(np.log(np.linspace(0.7, 1.3, 7)))
    # The exponent of a layer lies between Hertz' 1.5 and the columns' 2, and does not jump.
    assert np.all((steps > 1.5) & (steps < 2.05))
    assert np.abs(np.diff(steps)).max() < 0.04
