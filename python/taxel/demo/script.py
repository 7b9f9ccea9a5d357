"""The acts that the demo plays."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count

import numpy as np

from taxel.simulate import Act, Scene, Silence

__all__ = ["TRAINING_SEED", "Draw", "drawn", "endless", "left_to_rest", "script"]

#: Function that draws the scene of a seed and an index.
Draw = Callable[[int, int], Scene]

#: Silence between the tare and the first scene, ms.
_LEAD_MS = 250.0

#: How far the array is tilted in every other scene, degrees: between these.
_SLANTS_DEG = (10.0, 30.0)

#: A ball that glanced off the tilted array is taken away so long after its impact, ms, and so fast, mm/s: before it
#: comes down again.
_AWAY_MS, _HAND_MM_S = 60.0, 500.0

#: Seeds from here on are for training; the demo plays only seeds below, so it never shows what was trained on.
TRAINING_SEED = 2**32


def _fall_ms(scene: Scene) -> float:
    """Return how long the ball of a drawn scene falls."""
    height_mm = scene.parameters["bodies"][0]["motion"]["dropped"]["height_mm"]
    return float(np.sqrt(2 * height_mm / 9.81e-3))


def drawn(seed: int, index: int) -> Scene:
    """Draw scene `index` of a seed as the demo plays it: every second scene on a slant.

    On the level array the ball bounces, is caught and pressed by hand; from the tilted one it glances off along the
    rows, and is taken away.
    """
    scene = Scene.draw(seed, index)
    if index % 2 == 0:
        return scene
    ending = {"left_to_rest": {"rest_ms": _fall_ms(scene) + _AWAY_MS, "lift_mm_s": _HAND_MM_S}}
    slant = float(np.random.default_rng([seed, index]).uniform(*_SLANTS_DEG))
    return scene.body(motion={"dropped": {"ending": ending}}).replace(slant_deg=slant)


def left_to_rest(seed: int, index: int) -> Scene:
    """Draw scene `index` of a seed on a level array, where the ball bounces on."""
    return Scene.draw(seed, index, left_to_rest=True)


def script(seed: int, scenes: int, *, tare_ms: float = 50.0, draw: Draw = drawn) -> list[Act]:
    """Return silence for the tare, `scenes` scenes of `seed`, and a little silence.

    Parameters
    ----------
    seed : int
    scenes : int, 0 or more
    tare_ms : float
        How long the board is tared before.
    draw : function of seed and index
        Gives each scene.
    """
    return [Silence(tare_ms + _LEAD_MS), *(draw(seed, index) for index in range(scenes)), Silence(100.0)]


def endless(seed: int, *, tare_ms: float = 50.0, draw: Draw = drawn) -> Iterator[Act]:
    """Yield what `script` returns, scene after scene without an end."""
    yield Silence(tare_ms + _LEAD_MS)
    for index in count():
        yield draw(seed, index)
