"""Contacts and lifts of drawn loads, whose crossings are known by closed form, and of published recordings."""

import numpy as np
import pytest
from walking import RAMP, STANCE, TOP_N, contacts, load, published

import taxel
from taxel import ProblemError
from taxel_gait import DEFINITIONS, Definition, find_stances
from taxel_gait.feet import Foot

INSOLE = DEFINITIONS["insole"]


def walk(rate=1000.0, seconds=30.0, floor=0.0):
    t = np.arange(int(seconds * rate)) / rate
    return t, floor + load(t, contacts(0.5, int(seconds) - 1))


@pytest.mark.parametrize("floor", [0.0, 120.0])
@pytest.mark.parametrize("definition", [INSOLE, Definition("percent", 6, 10), Definition("percent", 12, 1)])
def test_contact_and_lift_are_where_the_ramps_cross_their_levels(definition, floor):
    t, force = walk(floor=floor)
    found = find_stances(t, force, definition)
    starts = contacts(0.5, 29)
    # The base of a swing is the floor, and the 95th percentile is the top.
    assert t[found.contact] == pytest.approx(starts + RAMP * definition.contact / 100, abs=0.0011)
    assert t[found.lift] == pytest.approx(starts + STANCE - RAMP * definition.lift / 100, abs=0.0011)
    assert not found.cut_at_contact.any()
    assert not found.cut_at_lift.any()


def test_levels_in_n_are_of_the_load_itself():
    t, force = walk()
    found = find_stances(t, force, Definition.of("newton:50,25"))
    assert t[found.contact] == pytest.approx(contacts(0.5, 29) + RAMP * 50 / TOP_N, abs=0.0011)
    assert t[found.lift] == pytest.approx(contacts(0.5, 29) + STANCE - RAMP * 25 / TOP_N, abs=0.0011)


def test_a_base_that_drifts_moves_no_contact():
    t, force = walk()
    drifting = force + 200 * np.sin(2 * np.pi * t / 60)
    still, moved = (find_stances(t, one, INSOLE) for one in (force, drifting))
    assert t[moved.contact] == pytest.approx(t[still.contact], abs=0.01)


def test_neither_scale_nor_offset_of_the_load_matters():
    t, force = walk()
    expected = find_stances(t, force, INSOLE)
    for other in (force / 17, 3.0 * force - 1950):
        assert all(np.array_equal(a, b) for a, b in zip(find_stances(t, other, INSOLE), expected, strict=True))


def test_samples_that_are_missing_are_no_swing():
    t, force = walk()
    # In the middle of the stance that begins at 10.5 s.
    there = (t < 10.7) | (t > 10.76)
    found = find_stances(t[there], force[there], INSOLE)
    assert len(found.contact) == 29
    assert not found.cut_at_lift.any()


def test_a_gap_cuts_the_stance_that_it_is_in():
    t, force = walk()
    there = (t < 10.7) | (t > 10.9)
    t, force = t[there], force[there]
    found = find_stances(t, force, INSOLE)
    near = np.flatnonzero(np.abs(t[found.contact] - 10.7) < 0.25)
    assert found.cut_at_lift[near].tolist() == [True, False]
    assert found.cut_at_contact[near].tolist() == [False, True]


@pytest.mark.parametrize(("begin", "end"), [(0.8, 10.75), (0.55, 10.3)])
def test_a_stance_that_the_recording_cuts_is_marked(begin, end):
    t, force = walk()
    here = (t >= begin) & (t < end)
    found = find_stances(t[here], force[here], INSOLE)
    assert found.cut_at_contact[0]
    assert not found.cut_at_lift[0]
    assert bool(found.cut_at_lift[-1]) is (end == 10.75)


def test_a_footfall_that_begins_and_ends_loaded_is_cut():
    # As of a plate that starts itself.
    t = np.arange(60) / 100
    found = find_stances(t, 40 + 700 * np.sin(np.pi * (t + 0.02) / 0.66), INSOLE)
    assert found.cut_at_contact.all()


def test_short_loads_are_no_stances_and_short_dips_no_swings():
    t, force = walk()
    scuff = force + trapeze(t, 5.2, 5.28)
    dipped = np.where((t > 10.8) & (t < 10.84), 0.0, force)
    expected = find_stances(t, force, INSOLE)
    assert len(find_stances(t, scuff, INSOLE).contact) == len(expected.contact)
    assert len(find_stances(t, dipped, INSOLE).contact) == len(expected.contact)


def trapeze(t, begin, end):
    return 500.0 * ((t > begin) & (t < end))


def test_nothing_is_found_where_nothing_is_loaded():
    t = np.arange(500) / 100
    assert len(find_stances(t, np.zeros(500), INSOLE).contact) == 0
    assert len(find_stances(t[:0], t[:0], INSOLE).contact) == 0


@pytest.mark.parametrize(
    "text", ["percent", "percent:5", "percent:5,0", "percent:25,5", "newton:-1,5", "kilo:5,5", "newton:nan,5", ""]
)
def test_what_is_no_definition_is_refused(text):
    with pytest.raises(ProblemError):
        Definition.of(text)


def test_f_scan_rises_where_its_readme_says():
    foot = Foot.of(taxel.open(published("insole_fscan") / "walk_01L.asf"), "left")
    found = find_stances(foot.t, foot.force, Definition("percent", 5, 5))
    # Rises above 50 N at these frames; a stance that begins the recording has no contact.
    assert found.contact[~found.cut_at_contact].tolist() == [29, 65, 100, 136, 171]
    assert foot.force.max() == pytest.approx(924, abs=1)


def test_pedar_contacts_are_near_those_of_its_readme():
    recording = taxel.open(published("pressure_formats") / "pedar_example.asc")
    rows = {
        "left": [343, 477, 603, 734, 859, 988, 1119, 1249, 1389],
        "right": [406, 536, 665, 793, 922, 1056, 1181, 1320, 1448],
    }
    for side, expected in rows.items():
        foot = Foot.of(recording.sources[side])
        found = find_stances(foot.t, foot.force, INSOLE)
        at = foot.t[found.contact[~found.cut_at_contact]]
        for row in expected:
            assert np.abs(at - foot.t[row]).min() <= 0.04
