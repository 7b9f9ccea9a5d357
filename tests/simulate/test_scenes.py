"""Scenes and what they do: mechanics, truth, and nonsense in every argument."""

import numpy as np
import pytest

from taxel.simulate import Scene, Silence, play


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


def test_the_same_seed_plays_the_same_bytes_and_another_does_not():
    acts = [Silence(100.0)]
    assert play(acts, seed=1).events == play(acts, seed=1).events
    assert play(acts, seed=1).events != play(acts, seed=2).events
