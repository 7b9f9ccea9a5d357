"""Regions and the axis of a loaded shape, against closed forms and matplotlib's test of points in a polygon."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.path import Path as Outline

import taxel
from taxel import Array, FormatError, Frames, Places, ProblemError, Region
from taxel.cli import main
from taxel.reading import Facts, InMemory

GRID = Array(12, 9, (5.0, 7.0))


def shoelace(corners):
    x, y = np.array(corners).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


@st.composite
def stars(draw):
    """Polygons whose sides do not cross: corners around a point, in order of their angle."""
    turns = draw(st.lists(st.floats(0, 0.8), min_size=5, max_size=12))
    angles = [2 * np.pi * (k + turn) / len(turns) for k, turn in enumerate(turns)]
    radii = draw(st.lists(st.floats(2, 20), min_size=len(angles), max_size=len(angles)))
    x, y = draw(st.floats(22, 34)), draw(st.floats(22, 33))
    return [(x + r * np.cos(a), y + r * np.sin(a)) for a, r in zip(angles, radii, strict=True)]


@given(stars())
def test_shares_add_up_to_the_area_of_the_polygon(corners):
    shares = Region("star", tuple(corners)).shares(GRID)
    assert shares.min() >= -1e-9
    assert shares.max() <= 1 + 1e-9
    assert shares.sum() * 35.0 == pytest.approx(shoelace(corners), rel=1e-9, abs=1e-9)


@given(stars())
def test_each_share_is_that_of_fine_points_in_the_polygon(corners):
    shares = Region("star", tuple(corners)).shares(GRID)
    fine = (np.arange(20) + 0.5) / 20 - 0.5
    y, x = (np.add.outer(np.arange(n), fine).ravel() * pitch for n, pitch in ((12, 5.0), (9, 7.0)))
    points = np.stack(np.meshgrid(x, y), axis=-1)
    inside = Outline([*corners, corners[0]]).contains_points(points.reshape(-1, 2)).reshape(240, 180)
    counted = inside.reshape(12, 20, 9, 20).mean(axis=(1, 3))
    assert shares == pytest.approx(counted, abs=0.06)


@given(stars())
def test_middles_inside_are_those_that_matplotlib_finds(corners):
    x, y = GRID.positions()
    inside = Outline([*corners, corners[0]]).contains_points(np.stack([x.ravel(), y.ravel()], axis=1))
    if inside.any():
        assert np.array_equal(Region("star", tuple(corners)).centred(GRID), inside.reshape(GRID.shape))


def test_the_order_of_corners_does_not_matter():
    corners = ((3.0, 4.0), (40.0, 8.0), (30.0, 50.0), (20.0, 12.0))
    assert Region("a", corners).shares(GRID) == pytest.approx(Region("a", corners[::-1]).shares(GRID))


def test_a_rectangle_in_taxels_is_that_in_mm():
    in_mm, in_taxels = Region.rectangle("a", 7, 5, 30, 22), Region.rectangle("a", 1, 1, 30 / 7, 4.4, "taxels")
    assert in_mm.shares(GRID) == pytest.approx(in_taxels.shares(GRID))


def test_the_load_of_two_rectangles():
    # 100 kPa on the first column of 20 cells of 5 x 7 mm, 300 kPa on the third.
    values = np.zeros((2, 12, 9), np.float32)
    values[1, :, 0], values[1, :, 2] = 100, 300
    frames = Frames(values, [0, 1000], unit="kPa", array=GRID)
    # The whole of the first column and half of the third.
    half = frames.region(Region.rectangle("half", -3.5, -2.5, 14.0, 57.5), range_end=300)
    area = 12 * 35.0
    assert half["force_N"] == pytest.approx([0, (100 * area + 300 * area / 2) / 1000])
    assert half["area_mm2"] == pytest.approx([0, 1.5 * area])
    assert half["mean_kPa"][1] == pytest.approx((100 + 300 / 2) / 1.5)
    # The middle of the third column is on the border, and a border belongs to what is left of it.
    assert half["peak_kPa"][1] == pytest.approx(100)
    assert np.isnan(half["centre_x_mm"][0])
    assert half["centre_x_mm"][1] == pytest.approx((0 * 100 + 14 * 150) / 250)
    assert half["centre_y_mm"][1] == pytest.approx(27.5)
    more = frames.region(Region.rectangle("more", -3.5, -2.5, 15.0, 57.5), above=100, range_end=300)
    assert more["peak_kPa"][1] == 300
    assert more["area_mm2"][1] == pytest.approx(area * 4.5 / 7)
    assert more["at_range_end_taxels"].tolist() == [0, 12]


def test_parts_of_a_sensor_add_up_to_the_whole():
    rng = np.random.default_rng(3)
    frames = Frames(rng.uniform(0, 9, (20, 12, 9)), np.arange(20), unit="kPa", array=GRID)
    lefts = (-3.5, 11.3, 30.2), (11.3, 30.2, 59.5)
    parts = [frames.region(Region.rectangle(str(a), a, -2.5, b, 57.5))["force_N"] for a, b in zip(*lefts, strict=True)]
    assert sum(parts) == pytest.approx(frames.force())


def test_what_the_force_is_follows_from_unit_and_areas():
    values = np.full((1, 2, 2), 3.0)
    areas = Array(1, 4, places=Places([0, 1, 2, 3], [0, 0, 0, 0], area=[10.0, 20, 30, 40], unit="mm"))
    assert Frames(values, [0], unit="N").force() == pytest.approx([12])
    assert Frames(values.reshape(1, 1, 4), [0], unit="N/cm2", array=areas).force() == pytest.approx([3.0])
    assert Frames(values, [0], unit="kPa").force() is None
    assert Frames(values, [0], unit="counts", array=Array(2, 2, 5.0)).force() is None


def test_channels_have_regions_of_taxels_without_area_or_centre():
    frames = Frames([[[1.0, 2.0, 4.0]]], [0], unit="raw")
    found = frames.region(Region("two", taxels=((0, 0), (2, 0))))
    assert {name: float(value[0]) for name, value in found.items()} == {
        "sum_raw": 5.0,
        "mean_raw": 2.5,
        "peak_raw": 4.0,
        "area_taxels": 2.0,
    }


@pytest.mark.parametrize("angle", [0, 17, 45, 90, 133])
def test_the_axis_of_a_turned_rectangle(angle):
    array = Array(120, 120, 1.0)
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    y, x = np.indices(array.shape) - 60.0
    s, across = x * along[0] + y * along[1], -x * along[1] + y * along[0]
    found = taxel.axis((np.abs(s) < 45) & (np.abs(across) < 15), array)
    assert (found.x, found.y) == pytest.approx((60, 60), abs=0.5)
    assert abs(found.dx * along[0] + found.dy * along[1]) == pytest.approx(1, abs=2e-3)
    assert (found.dy, found.dx) > (-1e-9, 0) or found.dy > 0
    # A cell reaches half a pitch to each side: at most its diagonal more.
    assert (found.length, found.width) == pytest.approx((90, 30), abs=2.5)


def test_the_maximum_picture_and_the_path():
    values = np.zeros((4, 1, 3))
    values[:3, 0] = [[10, 0, 0], [0, 90, 10], [0, 1, 0]]
    frames = Frames(values, np.arange(4), unit="N", array=Array(1, 3, 10.0))
    assert frames.maximum().tolist() == [[10, 90, 10]]
    path = frames.centre_path(0.05)
    assert path[:2, 0].tolist() == [0.0, 11.0]
    assert np.isnan(path[2:]).all()


def test_a_file_of_regions_comes_back(tmp_path):
    regions = [Region.rectangle("heel", 0, 0, 5, 6.5), Region("toe", taxels=((1, 2), (3, 4)))]
    taxel.write_regions(tmp_path / "a.regions.json", regions)
    assert taxel.read_regions(tmp_path / "a.regions.json") == (regions[0], regions[1])


@pytest.mark.parametrize(
    "stated",
    [
        "[",
        "[]",
        '{"regions": []}',
        '{"regions": [3]}',
        '{"regions": [{"name": "a"}]}',
        '{"regions": [{"name": "a", "rectangle": [0, 1, 2]}]}',
        '{"regions": [{"name": "", "taxels": [[0, 0]]}]}',
        '{"regions": [{"name": "a", "polygon": [[0, 0], [1, 1]]}]}',
        '{"regions": [{"name": "a", "polygon": [[0, 0], [9, 9], [9, 0], [0, 9]]}]}',
        '{"regions": [{"name": "a", "polygon": [[0, 0], ["x", 9], [9, 0]]}]}',
        '{"unit": "inch", "regions": [{"name": "a", "rectangle": [0, 0, 2, 2]}]}',
        '{"regions": [{"name": "a", "taxels": [[0, 0]]}, {"name": "a", "taxels": [[0, 1]]}]}',
    ],
)
def test_what_is_no_file_of_regions_is_refused_by_its_name(tmp_path, stated):
    (tmp_path / "a.regions.json").write_text(stated)
    with pytest.raises(FormatError) as caught:
        taxel.read_regions(tmp_path / "a.regions.json")
    assert caught.value.place is not None
    assert caught.value.place.file == str(tmp_path / "a.regions.json")


@pytest.mark.parametrize(
    ("region", "array"),
    [
        (Region.rectangle("far", 500, 500, 600, 600), GRID),
        (Region.rectangle("in mm", 0, 0, 6, 6), Array(3, 3)),
        (Region.rectangle("of channels", 0, 0, 6, 6), Array(1, 8)),
        (Region("gone", taxels=((9, 0),)), GRID),
        (Region("hole", taxels=((1, 0),)), Array(1, 2, exists=np.array([[True, False]]))),
    ],
)
def test_a_region_that_is_not_on_the_sensor_is_refused_by_its_name(region, array):
    with pytest.raises(ProblemError) as refused:
        region.shares(array)
    assert region.name in str(refused.value)


def test_info_writes_the_load_of_each_region(tmp_path, capsys):
    values = np.zeros((3, 12, 9), np.float32)
    values[1] = 50
    taxel.convert(Frames(values, [0, 1000, 2000], unit="kPa", array=GRID), tmp_path / "step.npz")
    taxel.write_regions(tmp_path / "step.regions.json", [Region.rectangle("left, half", -3.5, -2.5, 28, 57.5)])
    arguments = [str(tmp_path / "step.npz"), "--regions", str(tmp_path / "step.regions.json"), "--range-end", "50"]
    with pytest.raises(SystemExit):
        main(["info", *arguments, "--table", str(tmp_path / "step.csv"), "--json"])
    rows = list(csv.DictReader((tmp_path / "step.csv").read_text().splitlines()))
    assert [float(row["left, half force_N"]) for row in rows] == pytest.approx([0, 50 * 31.5 * 60 / 1000, 0])
    assert float(rows[1]["whole force_N"]) == pytest.approx(50 * 63 * 60 / 1000)
    facts = json.loads(capsys.readouterr().out)["pressure"]["regions"]
    assert facts["left, half"]["peak_kPa"] == 50
    # Four of nine columns have their middle in it, and the fifth on its border.
    assert facts["left, half"]["at_range_end_taxels"] == 4 * 12


def test_of_several_sensors_each_region_is_measured_on_its_source(tmp_path, capsys):
    feet = []
    for name, most in (("left", 20), ("right", 50)):
        frames = Frames(np.full((2, 12, 9), most, np.float32), [0, 1000], unit="kPa", array=GRID)
        feet.append(InMemory(Facts(path=tmp_path, array=GRID, label=name), frames))
    taxel.convert(taxel.Recording.of(*feet), tmp_path / "walk.mcap")
    heel = Region.rectangle("heel", -3.5, -2.5, 28, 57.5)
    of = [replace(heel, name=f"{name} heel", source=name) for name in ("left", "right")]
    taxel.write_regions(tmp_path / "walk.regions.json", of)
    assert taxel.read_regions(tmp_path / "walk.regions.json") == tuple(of)
    arguments = ["info", str(tmp_path / "walk.mcap"), "--regions", str(tmp_path / "walk.regions.json")]
    with pytest.raises(SystemExit):
        main([*arguments, "--json"])
    sources = json.loads(capsys.readouterr().out)["sources"]
    for name, most in (("left", 20), ("right", 50)):
        regions = sources[name]["pressure"]["regions"]
        assert set(regions) == {"whole", f"{name} heel"}
        assert regions[f"{name} heel"]["force_N"] == pytest.approx(most * 31.5 * 60 / 1000)
    taxel.write_regions(tmp_path / "walk.regions.json", [heel], overwrite=True)
    with pytest.raises(SystemExit):
        main(arguments)
    assert "region heel: its source is ''" in capsys.readouterr().err
