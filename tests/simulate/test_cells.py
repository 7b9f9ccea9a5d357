"""Cells of the layer finer than taxels: narrow touches against a dense solution, and what is said of too few."""

import re
import warnings

import numpy as np
import pytest
from draws import mixed

from taxel import Array
from taxel.simulate import Layer, Scene, Silence, play

PITCH = 2.67
SMALL = Array(14, 14, pitch_mm=PITCH)
#: Foam that is linear however far it is pressed here, and loses nothing.
LINEAR = {"yield_strain": 0.9, "densification_strain": 0.99, "damping_s_m": 0.0, "dashpot_ms": 0.0}
#: Of no taxel: neither its middle nor its rim.
AT = (17.1, 18.4)

BALL = ({"sphere": {"radius_mm": 5.0}}, lambda x, y: 5.0 - np.sqrt(np.clip(25.0 - x**2 - y**2, 0, None)))
ROD = (
    {"cylinder": {"radius_mm": 1.5, "length_mm": 16.0}},
    lambda x, y: np.where(np.abs(x) <= 8, 1.5 - np.sqrt(np.clip(2.25 - y**2, 0, None)), np.inf),
)
EDGE = (
    {"edge": {"slope_deg": 45.0, "length_mm": 16.0}},
    lambda x, y: np.where(np.abs(x) <= 8, np.abs(y), np.inf),
)


def dense(height, depth_mm, foam, side_mm=0.125, length_mm=40.0):
    """Return pressure (MPa) on cells of constant pressure, their places, and the base stress, by conjugate gradients.

    Carbone and Mangialardi's layer; Polonsky and Keer's gradients; nothing of it is the package's.
    """
    nu, h, modulus = foam["poisson"], 10.0, 0.06
    n = round(length_mm / side_mm)
    place = (np.arange(n) - (n - 1) / 2) * side_mm
    sunk = depth_mm - height(*np.meshgrid(place, place))
    along, across = (2 * np.pi * f(n, side_mm) for f in (np.fft.rfftfreq, np.fft.fftfreq))
    x = np.maximum(h * np.hypot(across[:, None], along), 1e-4)
    decay, k = np.exp(-2 * x), 3 - 4 * nu
    square = np.sinc(along * side_mm / 2 / np.pi) * np.sinc(across * side_mm / 2 / np.pi)[:, None]
    gives = h / modulus * 2 * (1 - nu**2) / x * square
    gives *= (k * (1 - decay**2) - 4 * x * decay) / (k * (1 + decay**2) + (4 * x**2 + 1 + k**2) * decay)
    m, tanh, cosh = 2 * (1 - nu), np.tanh(x), np.cosh(np.minimum(x, 300))
    through = m * (m + x * tanh) / cosh / (m**2 - (m - 1) ** 2 * tanh**2 + (x / cosh) ** 2) * square

    def carried(plane, by):
        return np.fft.irfft2(np.fft.rfft2(plane) * by, s=(n, n))

    pressure, way, last, keeps = np.clip(sunk * modulus / h, 0, None), np.zeros((n, n)), 1.0, 0.0
    for _ in range(1000):
        gap = carried(pressure, gives) - sunk
        held = pressure > 0
        size = float((gap[held] ** 2).sum())
        way = np.where(held, np.where(held, gap, 0) + keeps * size / last * way, 0)
        step = float((gap[held] * way[held]).sum() / (carried(way, gives)[held] * way[held]).sum())
        after = np.clip(pressure - step * way, 0, None)
        joins = (after == 0) & (gap < 0)
        after[joins] -= step * gap[joins]
        last, keeps = size, 0.0 if joins.any() else 1.0
        moved, pressure = np.abs(after - pressure).sum() / after.sum(), after
        if moved < 1e-5:
            break
    return pressure, place, carried(pressure, through)


def pressed(shape, depth_mm, foam, cells):
    """Return the force of a body pressed so deep by a hand, and what was said of its cells."""
    motion = {"pressed": {"depth_mm": depth_mm, "speed_mm_s": 50.0, "hold_ms": 3.0}}
    body = {"shape": shape, "x_mm": AT[0], "y_mm": AT[1], "motion": motion}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        force = Scene({"bodies": [body], "foam": foam, "cells_per_pitch": cells}).motion(200.0, array=SMALL).force_n
    return float(force.max()), [str(warning.message) for warning in caught]


@pytest.mark.parametrize(("touch", "nu"), mixed([(BALL, 0.1, 0.75), (ROD, 0.1, 0.6), (EDGE, 0.6, 0.6)], [0.0, 0.4]))
def test_a_narrow_touch_has_its_force_from_as_many_cells_as_it_asks_for(touch, nu):
    (shape, height), depth_mm, coarse = touch
    foam = {**LINEAR, "poisson": nu}
    pressure, place, _ = dense(height, depth_mm, foam)
    force = pressure.sum() * (place[1] - place[0]) ** 2
    one, said = pressed(shape, depth_mm, foam, 1)
    assert one < coarse * force
    assert len(said) == 1
    enough = int(re.search(r"cells_per_pitch = (\d+) is enough$", said[0])[1])
    few, none = pressed(shape, depth_mm, foam, enough)
    many, _ = pressed(shape, depth_mm, foam, 2 * enough)
    assert not none
    assert few == pytest.approx(force, rel=0.07)
    assert many == pytest.approx(force, rel=0.03)


def test_a_taxel_feels_the_mean_of_its_cells_at_the_face_and_at_the_base():
    depth_mm, foam, height = 0.6, {**LINEAR, "poisson": 0.2}, BALL[1]
    pressure, place, base = dense(height, depth_mm, foam)
    layer = Layer(foam, SMALL, cells_per_pitch=5, tolerance=1e-6)
    y, x = layer.cells_mm
    assert x.shape == (70, 70)
    assert x.reshape(70, 14, 5).mean(axis=2)[0] == pytest.approx(np.arange(14) * PITCH, abs=1e-12)
    found = layer.press(depth_mm - height(x - AT[0], y - AT[1]))
    assert found.pressure_kpa.shape == found.base_kpa.shape == (14, 14)
    assert found.force_n == pytest.approx(found.pressure_kpa.sum() * PITCH**2 / 1000)
    taxel = [np.clip(np.floor((place + at) / PITCH + 0.5).astype(int), -1, 14) + 1 for at in AT]
    for ours, theirs, within in ((found.pressure_kpa, pressure, 0.15), (found.base_kpa, base, 0.06)):
        mean = np.zeros((16, 16))
        np.add.at(mean, (taxel[1][:, None], taxel[0][None, :]), 1000 * theirs * (place[1] - place[0]) ** 2 / PITCH**2)
        # Taxels at the rim hang over what was solved; cells of the dense one lie across the edges of taxels.
        inside = (slice(3, -3),) * 2
        assert np.abs(ours[inside] - mean[1:-1, 1:-1][inside]).max() < within * mean.max()


def sharp(cells, y_mm):
    """Return a scene: an edge lies along a row, pressed so little that it is a quarter of a taxel wide."""
    motion = {"pressed": {"depth_mm": 0.3, "speed_mm_s": 50.0, "hold_ms": 5.0}}
    shape = {"edge": {"slope_deg": 45.0, "length_mm": 20.0}}
    return Scene({
        "bodies": [{"shape": shape, "x_mm": 32.0, "y_mm": y_mm, "motion": motion}],
        "foam": {"modulus_kpa": 6000.0}, "cells_per_pitch": cells,
    })  # fmt: skip


@pytest.mark.filterwarnings("ignore:bodies")
def test_an_edge_between_two_rows_is_felt_as_one_on_a_row():
    quiet = {"noise_ticks": 0.0, "gain_spread": 0.0, "offset_mv": 0.0}

    def felt(cells, y_mm):
        acts = [Silence(60.0), sharp(cells, y_mm)]
        return len(play(acts, seed=1, sensor=quiet, array=Array(24, 24, pitch_mm=PITCH)).events)

    assert felt(1, 12.5 * PITCH) == 0
    on, between = felt(7, 12 * PITCH), felt(7, 12.5 * PITCH)
    assert on > 50
    assert between > 0.5 * on


@pytest.mark.parametrize(
    "motion", ["dropped", "slid", *(pytest.param(one, marks=pytest.mark.slow) for one in ("pressed", "rolled"))]
)
def test_wide_bodies_of_every_kind_do_on_finer_cells_what_they_do_on_taxels(motion):
    how = {
        "dropped": {"height_mm": 80.0, "ending": {"left_to_rest": {"rest_ms": 200.0, "lift_mm_s": 100.0}}},
        "pressed": {"peak_n": 3.0, "speed_mm_s": 60.0, "hold_ms": 20.0},
        "rolled": {"speed_mm_s": 100.0, "for_ms": 100.0, "toward_deg": 30.0},
        "slid": {"speed_mm_s": 100.0, "for_ms": 100.0, "press_n": 2.0},
    }[motion]
    bodies = [
        {"shape": {"sphere": {"radius_mm": 20.0}}, "x_mm": 50, "y_mm": 60, "mass_g": 60, "motion": {motion: how}},
        {"shape": {"height_map": {"heights_mm": [[2, 1, 2], [1, 0, 1], [2, 1, 2]], "pitch_mm": 9.0}}, "mass_g": 60,
         "x_mm": 110, "y_mm": 100, "motion": {"pressed": {"peak_n": 3.0, "speed_mm_s": 60.0, "hold_ms": 20.0}}},
    ]  # fmt: skip
    quiet = {"noise_ticks": 0.0, "gain_spread": 0.0, "offset_mv": 0.0}
    scene = Scene({"bodies": bodies, "slant_deg": 2.0})
    events = [
        play([Silence(60.0), one], seed=1, sensor=quiet).events for one in (scene, scene.replace(cells_per_pitch=2))
    ]
    counts = [np.bincount(e.y.astype(int) // 8 * 8 + e.x // 8, minlength=64) for e in events]
    assert counts[0].sum() > 100
    assert np.abs(counts[0] - counts[1]).sum() < 0.2 * counts[0].sum()
