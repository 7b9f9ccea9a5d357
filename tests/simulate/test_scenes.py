"""Scenes and what they do: mechanics, truth, and nonsense in every argument."""

import numpy as np
import pytest

from taxel.simulate import FrameSequence, Scene, Silence, play, truth

FRAME_US = 192.0


def test_force_leaves_and_returns_to_zero_where_truth_says():
    motion = Scene.draw(4).motion()
    times = np.arange(len(motion.force_n)) * motion.step_us
    inside = np.zeros(len(times), bool)
    for contact in motion.contacts:
        inside |= (times > contact.start_us) & (times < contact.stop_us)
    assert np.array_equal(motion.force_n > 0, inside)


def test_momentum_of_an_impact_is_what_the_ball_brought_and_took():
    """The integral of force less weight over a contact is mass times the change of speed."""
    scene = Scene.draw(5)
    motion = scene.motion(6.0)
    first, second = motion.contacts[:2]
    inside = slice(round(first.start_us / 6.0), round(first.stop_us / 6.0) + 1)
    mass = scene.parameters["bodies"][0]["mass_g"] * 1e-3
    pushed = float(motion.force_n[inside].sum()) * 6e-6 - mass * 9.81 * 1e-6 * (first.stop_us - first.start_us)
    # The ball leaves a little below the foam's face, where the dashpot frees it, and rises against gravity to it.
    assert pushed == pytest.approx(mass * (first.speed_m_s + second.speed_m_s), rel=0.02)


def test_events_come_with_a_touch_and_lie_where_it_is():
    scene = Scene.draw(9)
    played = play([Silence(300.0), scene], seed=9)
    first = truth([Silence(300.0), scene])[0][0]
    start = played.events.markers[0][0]
    idle = played.events.between(start, first.start_us - FRAME_US)
    assert len(idle) / (first.start_us - start) * 1e6 < 400  # events/s: noise of half a tick against a floor of 3
    touched = played.events.between(first.start_us, first.start_us + 5_000)
    assert len(touched) > 100
    assert np.mean(touched.p) > 0.95
    assert np.median(touched.x) * 2.67 == pytest.approx(scene.parameters["bodies"][0]["x_mm"], abs=6)
    assert np.median(touched.y) * 2.67 == pytest.approx(scene.parameters["bodies"][0]["y_mm"], abs=6)


def test_the_same_seed_plays_the_same_bytes_and_another_does_not():
    acts = [Silence(100.0)]
    assert play(acts, seed=1).events == play(acts, seed=1).events
    assert play(acts, seed=1).events != play(acts, seed=2).events


def test_without_noise_an_untouched_board_is_silent_after_the_tare():
    played = play([Silence(100.0)], seed=1, sensor={"noise_ticks": 0.0})
    assert len(played.events) == 0
    assert [start for _, start in played.events.markers] == [True, False]
    assert (played.datagrams, played.words) == (2, 2)


def test_frames_touch_from_the_empty_one_before_to_the_empty_one_after():
    values = np.zeros((5, 64, 64))
    values[2:4, 20:30, 20:30] = 0.5
    contacts, _ = truth([FrameSequence(values, 2000.0)])
    assert [(c.kind, c.start_us, c.stop_us) for c in contacts] == [("frames", 2000.0, 8000.0)]


def test_what_watches_is_told_and_can_end_the_play():
    shares = []
    play([Silence(2_100.0)], seed=1, watch=shares.append)
    assert shares == pytest.approx([1 / 2.1, 2 / 2.1], abs=1e-3)

    def complain(_):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        play([Silence(60_000.0)], seed=1, watch=complain)
