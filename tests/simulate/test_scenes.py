"""Scenes and what they do: mechanics, truth, and nonsense in every argument."""

import pytest

from taxel.simulate import Scene


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
