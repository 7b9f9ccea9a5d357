"""A frame of a ball's footprint on a bonded layer against ContactMechanics, and scenes against the board's clock.

Both solve the same layer of 64 x 64 taxels, called from Python with one thread, the layer prepared, each pressure a
new array. A ball goes up and down at 100 mm/s, a frame at 5208 Hz: each frame *from nothing*, as ContactMechanics does
by default, and *begun from the last* (ours from an extrapolation of the last two, ContactMechanics from the last one's
forces). *The whole array* is a sole, from nothing. In these ours has the tolerance `EXACT`, so that it is as exact:
`furthest off` is the worst pressure off ours to 1e-9, as a share of the largest. ContactMechanics (PyPI, 530 MB with
its dependencies) is left out if it is not installed. The base stress, which it does not know, is in our time. Scenes
are played whole, with the usual tolerance, board and decoding too: how many times faster than the board's clock. A
foot's is with the layer solved every fourth frame, as `play` does above 600 taxels.

Peer: ContactMechanics. Unit: CPU seconds a frame; scenes in times the board's clock. Goal: a frame of a footprint 100
times as fast as the peer, both from nothing and both begun from the last, and no further off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.simulate import Layer, Scene, Silence, play, truth
from taxel.wire import FRAME_US
from taxel_benchmarks._goals import Goal, at_least, at_most
from taxel_benchmarks._rounds import measure, measured, missing

#: Our tolerance beside the peer, which is some 4e-7 off with its own.
EXACT = 3e-7
#: What is compared: both begin alike.
ALIKE = ("frames from nothing", "frames begun from the last", "the whole array from nothing")
FOAM = {"modulus_kpa": 60.0, "poisson": 0.0, "yield_strain": 0.9, "densification_strain": 0.99}
RADIUS_MM, DEPTH_MM, PITCH_MM = 35.0, 2.0, 2.67
FRAMES = 40
PEERS = {"ContactMechanics": "ContactMechanics SurfaceTopography"}
BODIES = ("a footprint", "the whole array")


def ball(depth_mm: float) -> NDArray[np.float64]:
    """Return the depth of a ball at each taxel, mm."""
    y, x = (np.mgrid[:64, :64] - 31.5) * PITCH_MM
    sunk: NDArray[np.float64] = depth_mm - (x**2 + y**2) / (2 * RADIUS_MM)
    return sunk


def sole(depth_mm: float) -> NDArray[np.float64]:
    """Return the depth of a sole at each taxel, mm; so far from the edges that a periodic layer gives the same."""
    y, x = np.mgrid[:64, :64] - 31.5
    sunk: NDArray[np.float64] = depth_mm - DEPTH_MM * (np.abs(x / 13) ** 6 + np.abs(y / 25) ** 6)
    return sunk


def depths() -> NDArray[np.float64]:
    """Return depths by frame, up from the deepest and down again at 100 mm/s, so that a round ends as it began."""
    up = np.arange(FRAMES // 2)
    found: NDArray[np.float64] = DEPTH_MM - 0.1 * FRAME_US / 1e3 * np.r_[up + 1, up[::-1]]
    return found


class Ours:
    """A body on the layer."""

    def __init__(self, sunk_mm: Callable[[float], NDArray[np.float64]], tolerance: float = EXACT) -> None:
        self._layer = Layer(FOAM, tolerance=tolerance)
        self._sunk = {depth: sunk_mm(depth) for depth in {*depths(), DEPTH_MM}}

    def press(self, depth_mm: float, *, anew: bool) -> NDArray[np.float64]:
        """Return the pressure at a depth, kPa; started from the last two solutions unless `anew`."""
        if anew:
            self._layer.forget()
        return self._layer.press(self._sunk[depth_mm]).pressure_kpa


class Theirs:
    """A body on the layer, solved by ContactMechanics."""

    def __init__(self, sunk_mm: Callable[[float], NDArray[np.float64]]) -> None:
        from ContactMechanics import PeriodicFFTElasticHalfSpace  # noqa: PLC0415  a peer need not be there
        from ContactMechanics.Factory import make_system  # noqa: PLC0415
        from SurfaceTopography import Topography  # noqa: PLC0415

        size, modulus = (64 * PITCH_MM,) * 2, FOAM["modulus_kpa"] / 1e3
        layer = PeriodicFFTElasticHalfSpace((64, 64), modulus, size, thickness=10.0, poisson=FOAM["poisson"])
        self._system = make_system(interaction="hardwall", substrate=layer, surface=Topography(sunk_mm(0.0), size))
        self._forces: Any = None

    def press(self, depth_mm: float, *, anew: bool) -> NDArray[np.float64]:
        """Return the pressure at a depth, kPa; started from the last solution's forces unless `anew`."""
        found = self._system.minimize_proxy(offset=depth_mm, initial_forces=None if anew else self._forces)
        if not found.success:
            raise ArithmeticError(f"ContactMechanics did not converge at {depth_mm} mm: {found.message}")
        # It returns the forces on the body, and starts from forces on the layer.
        self._forces = -np.array(self._system.force)
        pressure: NDArray[np.float64] = -1e3 * self._forces / PITCH_MM**2
        return pressure


def furthest_off(body: Callable[[float], NDArray[np.float64]], engine: Ours | Theirs) -> float:
    """Return the largest error of an engine's pressure, from nothing, against ours at 1e-9; share of the largest."""
    exact = Ours(body, tolerance=1e-9).press(DEPTH_MM, anew=True)
    return float(np.abs(engine.press(DEPTH_MM, anew=True) - exact).max() / exact.max())


def played(scenes: dict[str, Scene], rounds: int) -> dict[str, Any]:
    """Return seconds by scene; `rate` is the speed in times the board's clock."""
    results: dict[str, Any] = {}
    for name, scene in scenes.items():
        acts: list[Silence | Scene] = [Silence(100.0), scene]
        seconds = len(truth(acts)[1]) * FRAME_US / 1e6
        results |= measure({name: lambda acts=acts: play(acts, seed=1)}, rounds=rounds, work=seconds)  # type: ignore[misc]
    return results


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
        "a ball": Scene({"bodies": [dropped(84, 84)]}),
        "two balls": Scene({"bodies": [dropped(50, 84), dropped(118, 84)]}),
        "a foot": Scene({"bodies": [{**foot, "motion": {"pressed": press}}]}),
    }


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    fast = dict.fromkeys((f"{what}, both / ContactMechanics" for what in ALIKE[:2]), 100.0)
    exact = dict.fromkeys((f"{body}: furthest off / ContactMechanics" for body in BODIES), 1.0)
    return at_least(fast, result["ratios"]) + at_most(exact, result["ratios"])


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, ratios and real-time factors."""
    rounds = 2 if quick else 15
    absent = missing(PEERS)
    engines: dict[str, type[Ours | Theirs]] = {"taxel": Ours} | ({} if absent else {"ContactMechanics": Theirs})
    runs: dict[str, Callable[[], Any]] = {}
    off: dict[str, float] = {}
    for name, engine in engines.items():
        kept = {body: engine(body) for body in (ball, sole)}

        def frames(one: Ours | Theirs = kept[ball], *, anew: bool) -> None:
            for depth in depths():
                one.press(depth, anew=anew)

        def alone(one: Ours | Theirs) -> Any:
            return one.press(DEPTH_MM, anew=True)

        runs[f"{name}, frames begun from the last"] = partial(frames, anew=False)
        runs[f"{name}, frames from nothing"] = partial(frames, anew=True)
        runs[f"{name}, the whole array from nothing"] = partial(alone, kept[sole])
        off |= {f"{name}, a footprint": furthest_off(ball, kept[ball])}
        off |= {f"{name}, the whole array": furthest_off(sole, kept[sole])}
    pairs = {f"{what}, both / ContactMechanics": (f"taxel, {what}", f"ContactMechanics, {what}") for what in ALIKE}
    found = measured(runs, pairs, rounds=rounds)
    ratios = found["ratios"]
    frame_us = 1e6 * found["results"][f"taxel, {ALIKE[1]}"]["cpu_s"]["median"] / FRAMES
    ratios |= {"a frame of a footprint, us": frame_us, "of the board's frame": frame_us / FRAME_US}
    if not absent:
        apart = {body: off[f"taxel, {body}"] / off[f"ContactMechanics, {body}"] for body in BODIES}
        ratios |= {f"{body}: furthest off / ContactMechanics": one for body, one in apart.items()}
    shown = played(scenes(), 2 if quick else 7)
    ratios |= {f"{name}, times real time": one["rate"] for name, one in shown.items()}
    found["results"] |= shown
    return found | {"furthest off": off}
