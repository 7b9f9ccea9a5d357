"""A frame of a ball's footprint on a bonded layer against ContactMechanics, and scenes against the board's clock.

`taxel, a frame` is `Layer.press` from frame to frame of a press at 100 mm/s, 64 x 64 taxels at 5208 Hz, as a scene's
frames are solved, with the base stress and what a call from Python costs. ContactMechanics (PyPI, 530 MB with what it
needs) solves the same ball on the same layer, once from nothing; left out where it is not installed. It knows no base
stress. Scenes are played whole, board and decoding too: how many times faster than the board's clock, one thread. The
ratio of a foot is with the layer solved every fourth frame, as `play` does above 600 taxels.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from _peer import missing
from _rounds import measure, ratio, stamp
from numpy.typing import NDArray

from taxel.simulate import Layer, Scene, Silence, play, truth
from taxel.wire import FRAME_US

#: A frame of a footprint, by the issue that asked for it.
GOALS = {"taxel, a frame / ContactMechanics": 100.0}

FOAM = {"modulus_kpa": 60.0, "poisson": 0.0, "yield_strain": 0.9, "densification_strain": 0.99}
RADIUS_MM, DEPTH_MM, PITCH_MM = 35.0, 2.0, 2.67
FRAMES = 100


def ball(depth_mm: float) -> NDArray[np.float64]:
    """Return how far a ball has sunk at each taxel."""
    y, x = (np.mgrid[:64, :64] - 31.5) * PITCH_MM
    sunk: NDArray[np.float64] = depth_mm - (x**2 + y**2) / (2 * RADIUS_MM)
    return sunk


def pressing() -> Callable[[], None]:
    """Return a hundred frames of a press at 100 mm/s that ends at `DEPTH_MM`."""
    layer = Layer(FOAM)
    depths = DEPTH_MM - 0.1 * FRAME_US / 1e3 * np.arange(FRAMES)[::-1]
    sunk = [ball(depth) for depth in depths]

    def frames() -> None:
        for one in sunk:
            layer.press(one)

    return frames


def peer() -> Callable[[], Any]:
    """Return ContactMechanics' solution of the deepest frame."""
    from ContactMechanics import PeriodicFFTElasticHalfSpace  # noqa: PLC0415  a peer need not be there
    from ContactMechanics.Factory import make_system  # noqa: PLC0415
    from SurfaceTopography import Topography  # noqa: PLC0415

    size = (64 * PITCH_MM,) * 2
    substrate = PeriodicFFTElasticHalfSpace((64, 64), FOAM["modulus_kpa"] / 1e3, size, thickness=10.0, poisson=0.0)
    surface = Topography(ball(0.0), size)
    system = make_system(interaction="hardwall", substrate=substrate, surface=surface)
    return lambda: system.minimize_proxy(offset=DEPTH_MM)


def scenes() -> dict[str, Scene]:
    """Return a ball, two balls, and a sole of 1400 taxels, each a second or so."""
    ending = {"left_to_rest": {"rest_ms": 900.0, "lift_mm_s": 50.0}}

    def dropped(x: float, y: float) -> dict[str, Any]:
        shape = {"sphere": {"radius_mm": RADIUS_MM}}
        motion = {"dropped": {"height_mm": 150.0, "ending": ending}}
        return {"shape": shape, "x_mm": x, "y_mm": y, "mass_g": 36.0, "motion": motion}

    y, x = np.mgrid[:16, :50] / [[[15]], [[49]]] - 0.5
    sole = (6 * (np.abs(2 * y) ** 4 + np.abs(2 * x) ** 6)).tolist()
    press = {"peak_n": 300.0, "speed_mm_s": 40.0, "hold_ms": 500.0}
    foot = {"shape": {"height_map": {"heights_mm": sole, "pitch_mm": 4.0}}, "x_mm": 84.0, "y_mm": 84.0}
    return {
        "a ball on columns": Scene({"bodies": [dropped(84, 84)], "surface": "columns"}),
        "a ball": Scene({"bodies": [dropped(84, 84)]}),
        "two balls": Scene({"bodies": [dropped(50, 84), dropped(118, 84)]}),
        "a foot": Scene({"bodies": [{**foot, "motion": {"pressed": press}}]}),
    }


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, ratios and real-time factors."""
    rounds = 2 if quick else 7
    absent = missing({"ContactMechanics": "ContactMechanics SurfaceTopography"})
    runs: dict[str, Callable[[], Any]] = {"taxel, 100 frames": pressing()}
    if not absent:
        runs["ContactMechanics"] = peer()
    results = measure(runs, rounds=rounds)
    frame_us = 1e6 * results["taxel, 100 frames"]["cpu_s"]["median"] / FRAMES
    ratios: dict[str, Any] = {"a frame of a footprint, us": frame_us, "of the board's frame": frame_us / FRAME_US}
    if not absent:
        ratios["taxel, a frame / ContactMechanics"] = FRAMES * ratio(results, "taxel, 100 frames", "ContactMechanics")
    for name, scene in scenes().items():
        acts: list[Silence | Scene] = [Silence(100.0), scene]
        seconds = len(truth(acts)[1]) * FRAME_US / 1e6
        played = measure({name: lambda acts=acts: play(acts, seed=1)}, rounds=rounds, work=seconds)  # type: ignore[misc]
        results |= played
        ratios[f"{name}, times real time"] = played[name]["rate"]
    return {
        "about": __doc__,
        **stamp("ContactMechanics"),
        "results": results,
        "ratios": ratios,
        "goals": GOALS,
        "left out": absent,
    }
