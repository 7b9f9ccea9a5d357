"""Detections against touches, by class."""

import pytest

from taxel import Detections
from taxel.demo.judging import CLASSES, LABELS, judge
from taxel.simulate import Contact


def touch(kind="first", start=100_000.0, stop=115_000.0, speed=1.6, peak=20.0):
    return Contact(kind, start, stop, speed, peak)


def said(*times, label="contact"):
    return Detections([label] * len(times), list(times), [t + 200 for t in times])


def test_each_touch_belongs_to_one_class():
    for kind in ("first", "bounce", "hand", "rest"):
        for speed in (0.05, 0.15, 0.3, 0.4, 1.0):
            for peak in (0.1, 0.4, 0.7, 1.0, 4.0):
                one = touch(kind, speed=speed, peak=peak)
                assert sum(belongs(one) for _, belongs in CLASSES) == 1, one


def test_errors_are_taken_from_the_truth_itself():
    judged = judge(said(100_300), [touch(start=100_000.4)])
    row = judged.row("first", "contact")
    assert (row.found, row.touches) == (1, 1)
    assert row.errors_ms == pytest.approx([0.2996])
    assert row.delays_ms == pytest.approx([0.4996])


def test_impacts_have_a_narrow_window_and_presses_a_wide_one():
    late = 30_000
    assert judge(said(100_000 + late), [touch("bounce")]).row("bounce, 0.4", "contact").found == 0
    assert judge(said(100_000 + late), [touch("hand", peak=2.0)]).row("pressed by hand, 1 N", "contact").found == 1


def test_what_belongs_to_no_touch_is_false():
    judged = judge(said(100_300, 400_000), [touch()])
    assert judged.false["contact"].tolist() == [400_000]
    assert judged.false["lift"].tolist() == []


def test_a_press_said_far_too_late_is_missed_and_false_and_counted_as_within():
    press = touch("hand", start=100_000.0, stop=400_000.0, peak=2.0)
    judged = judge(said(170_000), [press])
    assert judged.row("pressed by hand, 1 N", "contact").found == 0
    assert judged.false["contact"].tolist() == [170_000]
    assert judged.false_within == {"contact": 1, "lift": 0}


def test_a_goal_counts_the_missed_as_well():
    contacts = [touch(start=1e6 * k, stop=1e6 * k + 15_000) for k in range(1, 5)]
    found = said(1_000_300, 2_000_300, 3_001_500)
    assert judge(found, contacts).within_goal("contact") == 0.5  # one is 1.7 ms late, one is missed


def test_a_judgement_without_touches_is_plain_values():
    values = judge(Detections([], [], []), []).to_dict()
    assert values["classes"] == {}
    assert values["false"] == dict.fromkeys(LABELS, 0)
