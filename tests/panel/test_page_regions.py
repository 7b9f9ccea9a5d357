"""Regions on the page: read from their file, drawn, moved, named, undone and written, and the curve of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import press, shown, shows, until

import taxel
from taxel import Array, Frames, Region
from taxel.panel.regions import Drawn, RegionLoads

pytestmark = pytest.mark.timeout(600)

#: Twelve rows of 10 mm and eight columns of 5 mm.
ARRAY = Array(12, 8, pitch_mm=(10.0, 5.0))
HEEL = Region.rectangle("heel", 2.5, 80, 32.5, 115)
TOES = Region("toes", taxels=((2, 0), (3, 0)))


@pytest.fixture
def walk(tmp_path: Path) -> Path:
    """Two seconds of frames with a load that wanders, with two regions beside them."""
    values = np.random.default_rng(2).random((100, *ARRAY.shape)) * 90
    frames = Frames(values, 500_000 + np.arange(100) * 20_000, unit="kPa", array=ARRAY)
    taxel.convert(frames, tmp_path / "walk.npz")
    taxel.write_regions(tmp_path / "walk.regions.json", [HEEL, TOES])
    return tmp_path / "walk.npz"


@pytest.mark.parametrize("column_us", [4_000, 64_000])
@pytest.mark.parametrize("region", [HEEL, TOES, Region("slanted", ((0, 0), (30, 20), (5, 90)))])
def test_a_curve_is_the_force_of_a_region_in_columns_of_time(walk: Path, region: Region, column_us: int) -> None:
    recording = taxel.open(walk)
    frames = recording.frames()
    force = frames.region(region)["force_N"]
    first = 480_000 // column_us
    curve = RegionLoads(recording, 1).curve(region, first, 600, column_us)
    for number, found in enumerate(curve, first):
        start, stop = number * column_us, (number + 1) * column_us
        inside = (frames.t >= start) & (frames.t < stop)
        # A frame holds until the next one, and the last one to its own time.
        before = np.flatnonzero(frames.t <= start)
        if start <= frames.t[-1] and len(before):
            inside[before[-1]] = True
        if not inside.any():
            assert found is None
        else:
            assert found == pytest.approx((force[inside].min(), force[inside].max()), abs=1e-3)


def test_a_region_without_a_curve_has_the_reason_instead_and_others_keep_theirs(walk: Path) -> None:
    crossing = Drawn("crossing", [(0, 0), (30, 30), (30, 0), (0, 30)], [])
    beside = Drawn("beside", [(90, 0), (99, 0), (99, 9)], [])
    missing = Drawn("missing", [], [(8, 0)])
    *reasons, curve = RegionLoads(taxel.open(walk), 1).curves(
        [crossing, beside, missing, Drawn("toes", [], list(TOES.taxels))], 8, 1, 64_000
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
