"""Every measure of footprints whose answers are known: two rectangles, with triangles in time, of three cells."""

import numpy as np
import pytest
from drawn import drawn

import taxel
from taxel import Region
from taxel_gait.loads import arch_index, balances, cpei_pct, loads_of, of_print, of_region
from taxel_gait.prints import Placed, Print, place

#: 50 Hz for 1 s: a triangle to 100 kPa at .5 s on the near rectangle, one to 200 kPa from .4 to .9 s on the far one.
T = np.arange(51) * 0.02
NEAR = 100 * np.clip(np.minimum(T / 0.5, (1 - T) / 0.5), 0, 1)
FAR = 200 * np.clip(np.minimum((T - 0.4) / 0.25, (0.9 - T) / 0.25), 0, 1)
#: Each is 60 mm wide; 90 and 30 mm long.
NEAR_CM2, FAR_CM2 = 54.0, 18.0


def rectangles(cell=5.0):
    n = round(240 / cell)
    values = np.zeros((51, n, n), np.float32)
    side = slice(round(60 / cell), round(120 / cell))
    values[:, round(120 / cell) : round(210 / cell), side] = NEAR[:, None, None]
    values[:, round(30 / cell) : round(60 / cell), side] = FAR[:, None, None]
    array = taxel.Array(n, n, cell, name="drawn plate")
    return taxel.Frames(values, np.rint(T * 1e6).astype(np.int64), unit="kPa", array=array)


def measured(cell):
    one = Print.of(rectangles(cell), 0.0)
    half = cell / 2
    regions = [
        Region.rectangle("near", -half, 75 - half, 240 - half, 240 - half),
        Region.rectangle("far", -half, -half, 240 - half, 75 - half),
    ]
    loads = loads_of(one, regions)
    total = sum(float(np.trapezoid(loads[name].force, one.t)) for name in ("near", "far"))
    return one, {name: of_region(one, loads[name], total, 150.0) for name in ("near", "far")}


@pytest.mark.parametrize("cell", [5.0, 10.0, 15.0])
def test_every_measure_of_two_rectangles(cell):
    _, found = measured(cell)
    near, far = found["near"], found["far"]
    assert near["max_force_N"] == pytest.approx(0.1 * NEAR_CM2 * 100, rel=1e-5)
    assert far["max_force_N"] == pytest.approx(0.1 * FAR_CM2 * FAR.max(), rel=1e-5)
    assert (near["peak_pressure_kPa"], far["peak_pressure_kPa"]) == pytest.approx((100, FAR.max()), rel=1e-5)
    assert (near["contact_area_cm2"], far["contact_area_cm2"]) == pytest.approx((NEAR_CM2, FAR_CM2))
    assert (near["contact_area_ever_cm2"], far["contact_area_ever_cm2"]) == pytest.approx((NEAR_CM2, FAR_CM2))
    # Of one pressure everywhere, the four pressure-time integrals are one: the area of the triangle.
    for name in ("peak_cell", "peak_curve", "force_area", "mean_curve"):
        # The first loaded sample is one step after the triangle begins, and the stance begins there.
        assert near[f"pti_{name}_kPa_s"] == pytest.approx(50, rel=2e-3)
        assert far[f"pti_{name}_kPa_s"] == pytest.approx(np.trapezoid(FAR, T), rel=1e-5)
    assert near["max_mean_pressure_kPa"] == near["region_pressure_kPa"] == pytest.approx(100, rel=1e-5)
    assert near["fti_N_s"] == pytest.approx(0.1 * NEAR_CM2 * 50, rel=2e-3)
    assert near["impulse_share_pct"] + far["impulse_share_pct"] == pytest.approx(100)
    assert near["instant_peak_s"] == pytest.approx(0.5 - 0.02)
    assert near["contact_time_s"] == pytest.approx(0.98)
    assert (near["contact_begin_pct"], near["contact_end_pct"]) == pytest.approx((0, 100))
    assert far["contact_begin_s"] == pytest.approx(0.42 - 0.02)
    assert far["contact_first_to_last_s"] == pytest.approx(0.48)
    assert far["loading_rate_N_per_s"] == pytest.approx(0.1 * FAR_CM2 * 200 / 0.25, rel=1e-3)
    assert near["saturated_cells"] == 0
    assert far["saturated_cells"] == round(FAR_CM2 * 100 / cell**2)


def test_the_four_integrals_differ_where_the_peak_moves():
    # Two cells, one after the other: the peak of each moment is a longer triangle than that of a cell.
    values = np.zeros((51, 4, 4), np.float32)
    values[:, 1, 1], values[:, 2, 1], values[:, 3, 1] = NEAR, np.roll(NEAR, 25), 1
    frames = taxel.Frames(values, np.rint(T * 1e6).astype(np.int64), unit="kPa", array=taxel.Array(4, 4, 10.0))
    one = Print.of(frames, 0.0)
    loads = loads_of(one, [])
    found = of_region(one, loads["whole"], 1.0, None)
    assert found["pti_peak_cell_kPa_s"] == pytest.approx(50, rel=2e-3)
    assert found["pti_peak_curve_kPa_s"] == pytest.approx(
        np.trapezoid(np.maximum(NEAR, np.roll(NEAR, 25)), T), rel=1e-3
    )
    assert found["pti_peak_curve_kPa_s"] > found["pti_peak_cell_kPa_s"] > found["pti_force_area_kPa_s"]


UP = Placed((89.5, 207.5), (0.0, -1.0), 180.0, 60.0, "right")


def test_the_path_of_a_load_that_moves_straight():
    n, steps = 40, 51
    values = np.zeros((steps, n, n), np.float32)
    for k in range(steps):
        at = 35 - 30 * k / (steps - 1)
        low = int(at)
        values[k, low, 15:25] = 100 * (1 - (at - low))
        values[k, min(low + 1, n - 1), 15:25] += 100 * (at - low)
    frames = taxel.Frames(values, np.arange(steps) * 20_000, unit="kPa", array=taxel.Array(n, n, 6.0))
    one = Print.of(frames, 0.0)
    placed = Placed((19.5 * 6, 35.5 * 6), (0.0, -1.0), 186.0, 60.0, "right")
    found = of_print(one, placed, loads_of(one, []), [], None, None)
    assert found["cop_length_mm"] == found["cop_straight_mm"] == pytest.approx(180)
    assert found["cop_range_ap_mm"] == pytest.approx(180)
    assert found["cop_range_ml_mm"] == pytest.approx(0, abs=1e-6)
    assert found["cop_speed_mm_per_s"] == pytest.approx(180)
    assert cpei_pct(one, placed) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("side", "sign"), [("right", 1), ("left", -1)])
def test_the_excursion_of_a_path_with_a_known_bow(side, sign):
    # The centre goes along two straight lines, 8 mm to the right at two thirds of the length; the print is 60 mm wide.
    n, steps = 40, 61
    values = np.zeros((steps, n, n), np.float32)
    for k in range(steps):
        row = 35 - round(30 * k / (steps - 1))
        share = k / (steps - 1)
        bow = 8 * (share / (2 / 3) if share < 2 / 3 else (1 - share) * 3)
        # Ten columns of 6 mm, weighted so that their centre is at the bow.
        x = (np.arange(10) - 4.5) * 6
        values[k, row, 15:25] = 100 * (1 + bow * x / (x**2).mean())
    assert values.min() >= 0
    frames = taxel.Frames(values, np.arange(steps) * 20_000, unit="kPa", array=taxel.Array(n, n, 6.0))
    one = Print.of(frames, 0.0)
    placed = Placed((19.5 * 6, 35 * 6), (0.0, -1.0), 180.0, 60.0, side)
    assert cpei_pct(one, placed) == pytest.approx(sign * 100 * 8 / 60, abs=1.0)


@pytest.mark.parametrize("rows", [30, 31, 32])
def test_the_arch_index_of_a_rectangle_is_a_third(rows):
    # Also of rows that three does not divide, as cells count with their share of area.
    values = np.zeros((3, 40, 20), np.float32)
    values[1, 5 : 5 + rows, 5:15] = 50
    one = Print.of(taxel.Frames(values, [0, 1000, 2000], unit="kPa", array=taxel.Array(40, 20, 5.0)), 0.0)
    placed = Placed((9.5 * 5, (4.5 + rows) * 5), (0.0, -1.0), rows * 5.0, 50.0, "right")
    assert arch_index(one, placed, []) == pytest.approx(1 / 3, rel=1e-6)


def test_the_arch_index_leaves_toes_out():
    values = np.zeros((3, 40, 20), np.float32)
    values[1, 10:40, 5:15], values[1, 2:6, 5:15] = 50, 50
    one = Print.of(taxel.Frames(values, [0, 1000, 2000], unit="kPa", array=taxel.Array(40, 20, 5.0)), 0.0)
    placed = Placed((9.5 * 5, 39.5 * 5), (0.0, -1.0), 190.0, 50.0, "right")
    toes = Region.rectangle("hallux", 0, -2.5, 95, 37.5)
    assert arch_index(one, placed, [toes]) == pytest.approx(1 / 3, rel=1e-6)
    assert arch_index(one, placed, []) != pytest.approx(1 / 3, abs=0.01)


def test_balances_are_those_of_footscan():
    one = Print.of(rectangles(), 0.0)
    whole = loads_of(one, [])["whole"]
    names = ("medial heel", "lateral heel", *(f"metatarsal {k}" for k in range(1, 6)))
    scale = dict(zip(names, (0.3, 0.1, 0.2, 0.1, 0.05, 0.05, 0.1), strict=True))
    loads = {"whole": whole, **{name: whole._replace(force=share * whole.force) for name, share in scale.items()}}
    found = balances(loads, one.t)
    assert found["balance_forefoot_pct"] == pytest.approx(100 * (0.3 - 0.2))
    assert found["balance_foot_pct"] == pytest.approx(100 * (0.3 - 0.2 + 0.2))


def test_the_print_of_emed_has_the_printed_force(tmp_path):
    frames, _ = drawn()
    one = Print.of(frames, 0.0)
    found = of_print(one, place(one), loads_of(one, []), [], None, 70.0)
    # 25 mm2 a cell: 1 kPa is .025 N.
    assert found["max_force_N"] == pytest.approx(0.025 * frames.total().max(), rel=1e-5)
    assert found["max_force_pct_weight"] == pytest.approx(100 * found["max_force_N"] / (70 * 9.80665))


def test_times_at_a_share_of_the_largest_load():
    one = Print.of(rectangles(), 0.0)
    begin, end = one.times_at(0.05)
    force = one.load[0]
    assert force[np.searchsorted(one.t, begin)] >= 0.05 * force.max() > force[np.searchsorted(one.t, begin) - 1]
    assert begin < end <= one.t[-1]
    assert UP.lateral == (1.0, 0.0)
