"""Steps of drawn walks: their times are known, and so are where they turn, stand, and stop."""

import numpy as np
import pytest
from walking import RAMP, STANCE, STEP, STRIDE, contacts, load, trapezium, two_feet

import taxel
from taxel_gait import DEFINITIONS, Foot, find_stances, steps_of

INSOLE = DEFINITIONS["insole"]
#: Between contact and lift at 5 and 2.5 % of the ramps, s.
SHORTER = RAMP * (0.05 + 0.025)


def walked(t, *loads, out=()):
    feet, stances = [], []
    for side, force in zip(("left", "right"), loads, strict=False):
        frames = taxel.Frames(force[:, None, None], np.rint(1e6 * t).astype(np.int64), unit="N")
        feet.append(Foot(side, side, frames, t, force, "N"))
        stances.append(find_stances(t, force, INSOLE))
    by_hand = [np.isin(np.arange(len(one.contact)), out) for one in stances]
    return feet, steps_of(feet, stances, by_hand)


def used(steps, foot=0):
    return [step.used for step in steps if step.foot == foot]


def test_the_times_of_a_steady_walk():
    _, steps = walked(*two_feet(rate=1000.0))
    own = [step for step in steps if step.used == "yes"]
    assert len(own) > 60
    support = 2 * STEP - STRIDE + STANCE - STEP - SHORTER
    expected = {
        "stride_s": STRIDE,
        "stance_s": STANCE - SHORTER,
        "swing_s": STRIDE - STANCE + SHORTER,
        "step_s": STEP,
        "stance_pct": 100 * (STANCE - SHORTER) / STRIDE,
        "double_support_initial_s": support,
        "double_support_terminal_s": support,
        "double_support_s": 2 * support,
        "single_support_s": STANCE - SHORTER - 2 * support,
        "cadence": 120 / STRIDE,
    }
    for name, value in expected.items():
        assert [step.times[name] for step in own] == pytest.approx([value] * len(own), rel=0.01, abs=0.0025), name


def test_the_feet_of_a_stride_agree():
    # Stance of one foot is the swing of the other and both double supports.
    _, steps = walked(*two_feet(rate=1000.0))
    for step in steps:
        if step.used == "yes":
            t = step.times
            assert t["stance_s"] == pytest.approx(t["single_support_s"] + t["double_support_s"])
            assert t["stride_s"] == pytest.approx(t["stance_s"] + t["swing_s"])


def test_first_and_last_steps_are_named():
    _, steps = walked(*two_feet())
    assert used(steps)[0] == "first"
    assert used(steps)[-1] == "last"
    assert {*used(steps)[1:-1]} == {"yes"}


def test_one_foot_alone_has_no_times_of_both():
    t, left, _ = two_feet()
    _, steps = walked(t, left)
    times = steps[5].times
    assert times["stride_s"] == pytest.approx(STRIDE)
    assert all(np.isnan(times[name]) for name in ("step_s", "double_support_s", "single_support_s"))


def with_slow_strides(seconds=60.0, slow=(20, 21), by=0.4):
    """Contacts of both feet, of which the left foot's strides of these numbers, and the right's, take longer."""
    strides = np.full(int(seconds) - 8, STRIDE)
    strides[list(slow)] += by
    left = 0.5 + np.concatenate([[0.0], np.cumsum(strides)])
    return two_feet(seconds, left=left, right=left + STEP)


def test_slow_strides_of_both_feet_are_a_turn():
    _, steps = walked(*with_slow_strides())
    assert used(steps).count("turn") == 2
    assert used(steps, 1).count("turn") == 2
    assert used(steps)[20:22] == ["turn", "turn"]


def test_a_single_unusual_stride_is_not_called_a_turn():
    t, left, right = two_feet(60.0)
    starts = contacts(0.5, 55)
    starts[30] += 0.12
    _, left, right = two_feet(60.0, left=starts, right=contacts(0.5 + STEP, 55))
    _, steps = walked(t, left, right)
    # Both strides of the contact that is late are off, within 2.5 s: together they are a turn.
    assert {*used(steps)} == {"first", "last", "yes", "turn"}
    _, steps = walked(*with_slow_strides(slow=(20,)), out=())
    assert "turn" in used(steps)


def test_standing_ends_a_bout():
    t = np.arange(4000) / 100
    # Both feet stay on the ground for 3 s from 10.5 s.
    left = load(t, [*contacts(0.5, 10), *contacts(15.0, 20)]) + trapezium(t, 10.5, 14.0)
    right = load(t, [*contacts(1.0, 9), *contacts(15.5, 20)]) + trapezium(t, 10.0, 14.4)
    _, steps = walked(t, left, right)
    assert {step.bout for step in steps} == {1, 2}
    assert used(steps).count("first") == 2
    assert used(steps).count("last") == 2
    after = next(step for step in steps if step.foot == 0 and step.contact_s > 14.5)
    before = next(step for step in reversed(steps) if step.foot == 0 and step.contact_s < 11)
    assert after.used == "first"
    assert np.isnan(before.times["stride_s"])


def test_two_contacts_of_one_foot_in_a_row_end_a_bout():
    right = np.delete(contacts(1.0, 38), 15)
    _, steps = walked(*two_feet(right=right))
    assert max(step.bout for step in steps) == 2


def test_a_gap_of_the_recording_ends_a_bout():
    t, left, right = two_feet()
    there = (t < 20.2) | (t > 21.6)
    _, steps = walked(t[there], left[there], right[there])
    assert max(step.bout for step in steps) == 2
    assert "cut" in used(steps)


def test_what_was_taken_out_by_hand_is_named_and_breaks_no_stride():
    _, steps = walked(*two_feet(), out=(7,))
    assert used(steps)[7] == "by hand"
    assert used(steps)[6] == "yes"
