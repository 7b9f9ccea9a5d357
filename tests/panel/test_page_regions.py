"""Regions on the page: read from their file, drawn, moved, named, undone and written, and the curve of each."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import press, shown, shows, until

import taxel
from taxel import Array, Frames, Region
from taxel.panel.regions import Drawn, Measure, RegionLoads
from taxel.reading import Facts, InMemory
from taxel.recording import Recording

pytestmark = pytest.mark.timeout(600)

#: Twelve rows of 10 mm and eight columns of 5 mm.
ARRAY = Array(12, 8, pitch_mm=(10.0, 5.0))
HEEL = Region.rectangle("heel", 2.5, 80, 32.5, 115)
TOES = Region("toes", taxels=((2, 0), (3, 0)))


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """Two seconds of frames with a load that wanders, with two regions beside them."""
    values = np.random.default_rng(2).random((100, *ARRAY.shape)) * 90 - 30
    frames = Frames(values, 500_000 + np.arange(100) * 20_000, unit="kPa", array=ARRAY)
    taxel.convert(frames, tmp_path / "walk.npz")
    taxel.write_regions(tmp_path / "walk.regions.json", [HEEL, TOES])
    return tmp_path / "walk.npz"


@pytest.mark.parametrize("column_us", [4_000, 64_000])
@pytest.mark.parametrize("region", [HEEL, TOES, Region("slanted", ((0, 0), (30, 20), (5, 90)))])
@pytest.mark.parametrize(
    ("measure", "name", "unit"),
    [
        ("load", "force_N", "N"),
        ("peak", "peak_kPa", "kPa"),
        ("mean", "mean_kPa", "kPa"),
        ("area", "area_mm2", "mm²"),
        ("x", "centre_x_mm", "mm"),
        ("y", "centre_y_mm", "mm"),
    ],
)
def test_a_curve_is_a_measure_of_a_region_in_columns_of_time(
    walk: Path, region: Region, column_us: int, measure: Measure, name: str, unit: str
) -> None:
    recording = taxel.open(walk)
    frames = recording.frames()
    # Where nothing is loaded there is no centre, and any other measure is 0.
    force = frames.region(region)[name]
    force = force if measure in ("x", "y") else np.nan_to_num(force)
    first = 480_000 // column_us
    loads = RegionLoads(walk.name, {"": recording}, 1)
    curve = loads.curve(region, measure, first, 600, column_us)
    assert loads.units[measure] == unit
    for number, found in enumerate(curve, first):
        start, stop = number * column_us, (number + 1) * column_us
        inside = (frames.t >= start) & (frames.t < stop)
        # A frame holds until the next one, and the last one to its own time.
        before = np.flatnonzero(frames.t <= start)
        if start <= frames.t[-1] and len(before):
            inside[before[-1]] = True
        inside &= ~np.isnan(force)
        if not inside.any():
            assert found is None
        else:
            assert found == pytest.approx((force[inside].min(), force[inside].max()), abs=1e-3)


def test_taxels_at_the_end_of_their_range_are_counted_where_a_file_states_it(tmp_path: Path, walk: Path) -> None:
    frames = taxel.open(walk).frames()
    facts = Facts(path=tmp_path, array=ARRAY, range_end=40.0)
    loads = RegionLoads("walk", {"": Recording.of(InMemory(facts, frames))}, 1)
    (curve,) = loads.curves([Drawn("toes", [], list(TOES.taxels))], "end", 0, 1, 10_000_000)
    counts = frames.region(TOES, range_end=40.0)["at_range_end_taxels"]
    assert (counts.min(), counts.max()) == (0, 2)
    assert curve == [(0, 2)]
    (reason,) = RegionLoads("walk", {"": taxel.open(walk)}, 1).curves(
        [Drawn("toes", [], [(2, 0)])], "end", 8, 1, 64_000
    )
    assert "not known" in str(reason)


def test_a_region_without_a_curve_has_the_reason_instead_and_others_keep_theirs(walk: Path) -> None:
    crossing = Drawn("crossing", [(0, 0), (30, 30), (30, 0), (0, 30)], [])
    beside = Drawn("beside", [(90, 0), (99, 0), (99, 9)], [])
    missing = Drawn("missing", [], [(8, 0)])
    *reasons, curve = RegionLoads("walk", {"": taxel.open(walk)}, 1).curves(
        [crossing, beside, missing, Drawn("toes", [], list(TOES.taxels))], "load", 8, 1, 64_000
    )
    assert all(name in str(reason) for name, reason in zip(("crossing", "beside", "missing"), reasons, strict=True))
    assert all(isinstance(reason, str) for reason in reasons)
    assert isinstance(curve, list)


def _corners(page: Any, k: int) -> list[list[float]]:
    """Return the corners of a region as it is drawn on the map, mm."""
    points = page.locator("#pressure-regions [data-grip]").nth(k).get_attribute("points")
    shares = [[float(one) / 1000 for one in point.split(",")] for point in points.split()]
    return [[(x * ARRAY.columns - 0.5) * 5, (y * ARRAY.rows - 0.5) * 10] for x, y in shares]


def _at(page: Any, x_mm: float, y_mm: float) -> tuple[float, float]:
    """Return where a place is on the screen."""
    box = page.locator("#pressure-map").bounding_box()
    across, down = (x_mm / 5 + 0.5) / ARRAY.columns, (y_mm / 10 + 0.5) / ARRAY.rows
    return box["x"] + across * box["width"], box["y"] + down * box["height"]


def _drag(page: Any, *places: tuple[float, float]) -> None:
    """Press at the first place, move over the others, and release at the last."""
    page.mouse.move(*_at(page, *places[0]))
    page.mouse.down()
    for place in places[1:]:
        page.mouse.move(*_at(page, *place))
    page.mouse.up()


def _output(page: Any, k: int) -> Any:
    return page.locator("#regions-block h2 output").nth(k).inner_text()


def _names(page: Any) -> Any:
    return page.locator("#region-list input").evaluate_all("all => all.map(one => one.value)")


def test_regions_are_read_drawn_moved_undone_and_written(chromium: Any, walk: Path) -> None:
    with shown(chromium, walk) as page:
        press(page, "5")
        until(lambda: _names(page) == ["heel", "toes"], "the regions of the file")
        assert _corners(page, 0) == pytest.approx(np.array(HEEL.corners), abs=0.1)
        force = taxel.open(walk).frames().region(HEEL)["force_N"]
        until(lambda: _output(page, 0).endswith(" N"), "the force at the time shown")
        assert np.isclose(force, float(_output(page, 0).split()[0]), rtol=0.01).any()
        draws(page)
        moves(page)
        page.locator("#region-list input").nth(2).fill("middle")
        page.keyboard.press("Enter")
        page.locator("#region-write").click()
        # It is written over the file that is there only where a person says so.
        until(page.locator("#region-replace").is_visible, "the offer to replace the file")
        assert taxel.read_regions(walk.with_name("walk.regions.json")) == (HEEL, TOES)
        page.locator("#region-replace").click()
        shows(page, "notice-text", r"^wrote walk\.regions\.json$")
        heel, toes, middle, triangle, few = taxel.read_regions(walk.with_name("walk.regions.json"))
        assert (heel, toes, middle.name) == (HEEL, TOES, "middle")
        assert np.array(middle.corners) == pytest.approx(np.array([[5, 20], [31, 20], [31, 60], [5, 60]]), abs=0.5)
        assert np.array(triangle.corners) == pytest.approx(np.array([[0, 70], [20, 70], [10, 100]]), abs=0.5)
        assert few.taxels == ((5, 2), (6, 2))


def draws(page: Any) -> None:
    """A rectangle by a drag, a polygon by its corners, a set of taxels with the keyboard; each gets a name."""
    page.locator("#region-rectangle").click()
    _drag(page, (5, 20), (20, 40), (25, 60))
    page.locator("#region-polygon").click()
    for corner in [(0, 70), (20, 70), (10, 100), (0, 70)]:
        page.mouse.click(*_at(page, *corner))
    page.locator("#region-taxels").click()
    page.locator("#pressure-frame").focus()
    # The crosshair begins in the middle, column 4 and row 6.
    for key in ["ArrowUp", *["ArrowUp"] * 4, "ArrowRight", "Enter", "ArrowRight", "Enter", "Escape"]:
        page.keyboard.press(key)
    until(lambda: _names(page) == ["heel", "toes", "part 3", "part 4", "part 5"], "three regions more")


def moves(page: Any) -> None:
    """A corner by the pointer and the keyboard, a region by the pointer; what is moved can be undone."""
    page.locator("#region-list input").nth(2).focus()
    page.mouse.move(*_at(page, 25, 60))
    _drag(page, (25, 60), (26, 60), (26, 60))
    page.locator("#pressure-corners [data-grip='1']").focus()
    page.keyboard.press("ArrowRight")
    assert _corners(page, 2) == pytest.approx(np.array([[5, 20], [31, 20], [31, 60], [5, 60]]), abs=0.5)
    before = _corners(page, 2)
    until(lambda: _output(page, 2).endswith(" N"), "its force")
    _drag(page, (10, 30), (15, 40))
    assert _corners(page, 2) == pytest.approx(np.array(before) + np.array([5, 10]), abs=0.5)
    page.locator("#region-undo").click()
    assert _corners(page, 2) == pytest.approx(np.array(before), abs=0.1)


@pytest.fixture
def pair(tmp_path: Path) -> Path:
    """Two insoles of 10 mm, whose frames come at other times and for other lengths."""
    values = np.random.default_rng(3).random((2, 100, 6, 4)) * 90
    feet = []
    for k, name in enumerate(("left", "right")):
        frames = Frames(values[k], np.arange(100) * (20_000 - 3000 * k), unit="kPa", array=Array(6, 4, pitch_mm=10.0))
        feet.append(InMemory(Facts(path=tmp_path, array=frames.array, label=name), frames))
    taxel.convert(Recording.of(*feet), tmp_path / "pair.mcap")
    return tmp_path / "pair.mcap"


def test_of_several_sensors_each_region_is_of_its_own(pair: Path) -> None:
    sources = taxel.open(pair).sources
    loads = RegionLoads("pair", sources, 1)
    heel = replace(Region.rectangle("heel", 5, 25, 25, 55), source="left")
    toes = Region("toes", taxels=((1, 0), (2, 0)), source="right")
    left, right = loads.drawn([heel, toes])
    # The right one begins behind the left one's four columns and an empty one.
    assert (left["corners"], right["taxels"]) == (heel.corners, ((6, 0), (7, 0)))
    drawn = [Drawn(one["name"], list(one["corners"]), list(one["taxels"])) for one in (left, right)]
    assert loads.regions(drawn) == [heel, toes]
    force = sources["right"].frames().region(toes)["force_N"]
    *_, second = loads.curves(drawn, "load", 0, 2, 1_000_000)
    # The right one's last frame is at 1.683 s; what comes then is not known.
    assert second[1] == pytest.approx((force[58:].min(), force[58:].max()), abs=1e-3)
    with pytest.raises(taxel.ProblemError, match="both: lies on several sensors"):
        loads.regions([Drawn("both", [], [(3, 0), (5, 0)])])
    with pytest.raises(taxel.ProblemError, match=r"heel: its source is '': must be one of left, right"):
        loads.drawn([replace(heel, source="")])


def test_a_picture_has_the_largest_and_mean_values_isobars_and_the_path_of_each_sensor(pair: Path) -> None:
    sources = taxel.open(pair).sources
    found = RegionLoads("pair", sources, 1).picture("maximum", 200_000, 400_000)
    right = sources["right"].frames().between(187_000, 400_000)
    values = np.reshape(found["values"], (6, 9))
    assert values[:, 5:] == pytest.approx(right.maximum(), abs=1e-3)
    assert not values[:, 4].any()
    shown = [point for point in found["paths"][1] if point is not None]
    path = dict(zip(right.t.tolist(), np.add(right.centre(), (50, 0)), strict=True))
    assert {t for t, *_ in shown} >= set(path) - {187_000}
    for t, *at in shown:
        assert at == pytest.approx(path[max(known for known in path if known <= t)], abs=1e-2)


def test_isobars_of_a_cone_are_circles_around_its_tip(tmp_path: Path) -> None:
    x, y = np.meshgrid(np.arange(41), np.arange(41))
    cone = np.maximum(0, 100 - 5 * np.hypot(x - 20, y - 20))
    taxel.convert(
        Frames([cone, cone / 2], [0, 10_000], unit="kPa", array=Array(41, 41, pitch_mm=2.0)), tmp_path / "c.npz"
    )
    loads = RegionLoads("c", {"": taxel.open(tmp_path / "c.npz")}, 1)
    for kind, most in (("maximum", 100), ("mean", 75)):
        found = loads.picture(kind, 0, 20_000)
        assert max(found["values"]) == pytest.approx(most)
        # At 20, 40, 60 and 80 % of the height the radius is 80, 60, 40 and 20 % of 40 mm.
        for line, radius in zip(found["isobars"], (32, 24, 16, 8), strict=True):
            assert np.hypot(*(np.array(line) - 40).T) == pytest.approx(radius, abs=0.3)


#: How many pieces a path of the drawing has.
PIECES = "name => (document.querySelector(`#picture-lines .${name}`).getAttribute('d').match(/M/g) ?? []).length"


def test_the_page_shows_pictures_and_measures_of_several_sensors_and_writes_each_region_with_its_own(
    chromium: Any, pair: Path
) -> None:
    with shown(chromium, pair, width=390) as page:
        press(page, "5")
        page.locator("#region-rectangle").click()
        page.evaluate("scrollTo(0, 0)")
        box = page.locator("#pressure-map").bounding_box()
        # Columns 5 to 8 are the right one's.
        at = [(box["x"] + box["width"] * x / 9, box["y"] + box["height"] * y / 6) for x, y in ((5.5, 1), (8, 4))]
        page.mouse.move(*at[0])
        page.mouse.down()
        page.mouse.move(*at[1])
        page.mouse.up()
        frames = taxel.open(pair).sources["right"].frames()
        for measure, name, unit in (("peak", "peak_kPa", "kPa"), ("area", "area_mm2", "mm²"), ("load", "force_N", "N")):
            page.locator("#region-measure").select_option(measure)
            until(lambda unit=unit: _output(page, 0).endswith(f" {unit}"), measure)
            page.locator("#region-write").click()
            if page.locator("#region-replace").is_visible():
                page.locator("#region-replace").click()
            until(pair.with_name("pair.regions.json").exists, "the file")
            (region,) = taxel.read_regions(pair.with_name("pair.regions.json"))
            assert region.source == "right"
            found = frames.region(region)[name]
            assert np.isclose(found, float(_output(page, 0).split()[0].replace(",", "")), rtol=0.01).any()
        for kind in ("mean", "maximum"):
            page.locator("#picture").select_option(kind)
            shows(page, "pressure-above", r"^0\.000 s to 1\.980 s$")
            until(lambda: page.evaluate(PIECES, "isobars") > 3, "isobars")
            assert page.evaluate(PIECES, "path") == 2
            assert page.locator("#picture-marks span").all_inner_texts() == ["0 %", "25 %", "50 %", "75 %", "100 %"] * 2
        page.locator("#pressure-frame").focus()
        page.keyboard.press("ArrowRight")
        # The crosshair begins in the middle, where there is none between both: at the right one's first column.
        shows(page, "taxel-name", r"^(left|right), row \d, column \d$")
        source, row, column = page.locator("#taxel-name").inner_text().split(", ")
        values = taxel.open(pair).sources[source].frames().maximum()
        most = values[int(row.split()[1]), int(column.split()[1])]
        shows(page, "taxel-value", rf"^{most:.3g} kPa$")
        page.locator("#picture").select_option("")
        until(lambda: page.evaluate(PIECES, "isobars") == 0, "what is now")
