"""Axis, direction, side and doubts of drawn footprints, turned, mirrored, cut, with noise; and of published ones."""

import numpy as np
import pytest
from drawn import LENGTH, drawn
from walking import published

import taxel
from taxel import ProblemError
from taxel_gait.prints import Print, place

ANGLES = (0, 20, 77, 135, 180, 250, 311)


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("angle", ANGLES)
def test_direction_and_side_of_a_print_that_is_turned_and_mirrored(angle, left):
    placed = place(Print.of(drawn(angle=angle, left=left)[0]))
    wanted = np.array([np.sin(np.radians(angle)), -np.cos(np.radians(angle))])
    assert float(np.array(placed.along) @ wanted) > np.cos(np.radians(6))
    assert placed.side == ("left" if left else "right")
    assert placed.doubts == ()
    assert placed.length == pytest.approx(LENGTH, abs=12)


@pytest.mark.parametrize("cell", [5.0, 10.0])
@pytest.mark.parametrize("heads", [0.68, 0.73, 0.80])
def test_cells_and_short_toes_do_not_matter(cell, heads):
    for left in (False, True):
        placed = place(Print.of(drawn(cell, 20, left, heads, noise=0.02)[0]))
        assert placed.side == ("left" if left else "right")
        assert placed.along[1] < -0.9


@pytest.mark.parametrize("cut", [(0.15, 2), (0.35, 2), (-1, 0.7), (-1, 0.55)])
def test_a_print_that_is_cut_is_partial(cut):
    assert any("partial" in doubt for doubt in place(Print.of(drawn(cut=cut)[0])).doubts)


def test_a_print_that_is_played_backwards_is_named_and_keeps_its_direction():
    frames, _ = drawn()
    back = taxel.Frames(frames.values[::-1], frames.t, unit="kPa", array=frames.array)
    placed = place(Print.of(back))
    assert placed.along[1] < -0.9
    assert any("from the toes to the heel" in doubt for doubt in placed.doubts)


def test_two_feet_are_named():
    one, two = drawn()[0].values, drawn(left=True)[0].values
    both = np.maximum(np.roll(one, 18, axis=2), np.roll(two, -18, axis=2))
    frames = taxel.Frames(both, drawn()[0].t, unit="kPa", array=drawn()[0].array)
    assert "two feet at once" in place(Print.of(frames)).doubts


def test_a_side_that_is_stated_is_believed():
    placed = place(Print.of(drawn()[0]), "left")
    assert placed.side == "left"
    # The lateral direction is then the other one.
    assert np.dot(placed.lateral, place(Print.of(drawn()[0])).lateral) == pytest.approx(-1, abs=1e-6)


def test_points_of_the_foot_come_back():
    placed = place(Print.of(drawn(angle=40)[0]))
    points = np.array([[3.0, 10.0], [-20.0, 200.0]])
    assert placed.in_foot(placed.on_array(points)) == pytest.approx(points)


def test_what_holds_no_print_is_refused():
    array = taxel.Array(6, 6, 5.0)
    with pytest.raises(ProblemError):
        Print.of(taxel.Frames(np.zeros((3, 6, 6)), [0, 1, 2], unit="kPa", array=array))
    with pytest.raises(ProblemError):
        Print.of(taxel.Frames(np.ones((3, 6, 6)), [0, 1, 2], unit="kPa"))


def test_all_footfalls_of_the_plate_lie_one_way_and_are_of_one_side(published_plate):
    for path in published_plate:
        placed = [place(Print.of(one.frames())) for one in taxel.open_all(path)[::10]]
        # The file has the heel at its low rows.
        assert all(one.along[1] > 0.9 for one in placed)
        assert len({one.side for one in placed}) == 1


@pytest.fixture
def published_plate():
    return sorted(published("plate").glob("*.h5"))


def test_f_scan_of_a_left_foot_is_left():
    frames = taxel.open(published("insole_fscan") / "walk_01L.asf").frames()
    for first, end in ((29, 52), (65, 87), (100, 123), (136, 158), (171, 194)):
        assert place(Print.of(frames[first:end], 15.0)).side == "left"
