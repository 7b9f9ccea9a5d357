"""What the demo plays."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

from taxel.simulate import Act, Scene, Silence

__all__ = ["TRAINING_SEED", "endless", "script"]

#: Silence between the tare and the first scene, ms.
_LEAD_MS = 250.0

#: Seeds from here on are for training; the demo plays only seeds below, so it never shows what was trained on.
TRAINING_SEED = 2**32


def script(
    seed: int,
    scenes: int,
    *,
    tare_ms: float = 50.0,
    dashpot_ms: float | None = None,
    left_to_rest: bool = False,
) -> list[Act]:
    """Return silence for the tare, `scenes` scenes of `seed`, and a little silence.

    Parameters
    ----------
    seed : int
    scenes : int, 0 or more
    tare_ms : float
        How long the board is tared before.
    dashpot_ms : float, optional
        Another dashpot than the foam's usual one.
    left_to_rest : bool
        Nobody catches the ball.
    """
    drawn = [Scene.draw(seed, index, left_to_rest=left_to_rest) for index in range(scenes)]
    if dashpot_ms is not None:
        drawn = [scene.replace(foam={"dashpot_ms": dashpot_ms}) for scene in drawn]
    return [Silence(tare_ms + _LEAD_MS), *drawn, Silence(100.0)]


def endless(seed: int, *, tare_ms: float = 50.0, left_to_rest: bool = False) -> Iterator[Act]:
    """Yield what `script` returns, scene after scene without an end."""
    yield Silence(tare_ms + _LEAD_MS)
    for index in count():
        yield Scene.draw(seed, index, left_to_rest=left_to_rest)
