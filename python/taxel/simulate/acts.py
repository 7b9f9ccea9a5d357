"""What the emulated board is shown: silence, a ball, pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._arguments import flag, number, numbers, parameters, shown, whole
from taxel._core import ProblemError
from taxel.array import Array

__all__ = ["Act", "Contact", "Motion", "Pictures", "Scene", "Silence"]


class Contact(NamedTuple):
    """One touch, as it really was: from the moment when force leaves zero to that when it returns there."""

    kind: str
    """"first", "bounce", "hand", "rest" (stayed until it was lifted) or "pictures"."""
    start_us: float
    stop_us: float
    speed_m_s: float
    """How fast it began."""
    peak_n: float
    """The largest force; 0 where nobody knows it."""


class Motion(NamedTuple):
    """A scene, worked out at even steps."""

    step_us: float
    depth_mm: NDArray[np.float32]
    """Below the foam's face; negative above it."""
    force_n: NDArray[np.float32]
    contacts: list[Contact]


@dataclass(frozen=True)
class Silence:
    """Nothing touches the array for `ms`."""

    ms: float

    def _part(self) -> Any:
        return number("ms", self.ms, "ms")


class Scene:
    """Describe a ball dropped on foam over the array, and what becomes of it.

    Parameters
    ----------
    parameters : mapping
        As `parameters` of a drawn scene holds them: ball (radius_mm, mass_g), foam (modulus_kpa, thickness_mm, poisson,
        yield_strain, densification_strain, exponent, damping_s_m, dashpot_ms), x_mm and y_mm from the first taxel,
        drop_mm, lead_ms and tail_ms of silence, and the ending: ``{"caught": {"after", "press": {...}}}`` or
        ``{"left_to_rest": {"rest_ms", "lift_mm_s"}}``.

    Raises
    ------
    SceneError : when it is played, and a parameter makes no sense or the ball bottoms out

    Notes
    -----
    Columns of Gibson and Ashby's foam with Hunt and Crossley's damping and a dashpot; the layer's base stress reaches
    the taxels. Modulus, damping and dashpot are guesses.

    Examples
    --------
    >>> scene = Scene.draw(seed=1)
    >>> scene
    Scene(ball of 35 mm and 36 g from 196 mm, caught after 4 impacts)
    >>> [contact.kind for contact in scene.motion().contacts]
    ['first', 'bounce', 'bounce', 'bounce', 'hand']
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        if not isinstance(parameters, Mapping):
            raise ProblemError(f"parameters are {shown(parameters)}: must be a mapping, as Scene.draw(seed).parameters")
        self.parameters = dict(parameters)

    @classmethod
    def draw(cls, seed: int, index: int = 0, *, left_to_rest: bool = False, array: Array | None = None) -> Scene:
        """Draw scene `index` of a seed: another place, ball, drop and foam each time.

        Parameters
        ----------
        seed, index : int, 0 or more
        left_to_rest : bool
            Nobody catches the ball; else it is caught after 2 to 4 impacts and pressed by hand.
        array : Array, optional
            The thesis' 64 x 64 taxels where it is left out.
        """
        parts = Array._of(array)._parts()
        seed, index = whole("seed", seed, 0), whole("index", index, 0, 1_000_000)
        return cls(json.loads(_core.draw_scene(parts, seed, index, flag("left_to_rest", left_to_rest))))

    def replace(self, **changes: Any) -> Scene:
        """Return the scene with parameters changed; a mapping changes some of a part, as ``foam={"dashpot_ms": 0}``."""
        unknown = [name for name in changes if name not in self.parameters]
        if unknown:
            raise ProblemError(f"{unknown[0]}: a scene has {', '.join(self.parameters)}")
        merged = dict(self.parameters)
        for name, change in changes.items():
            before = merged[name]
            both = isinstance(change, Mapping) and isinstance(before, Mapping) and name != "ending"
            merged[name] = {**before, **change} if both else change
        return Scene(merged)

    def motion(self, step_us: float = 48.0) -> Motion:
        """Work the scene out; by default in quarters of a frame of 5208 Hz."""
        depth, force, contacts = _core.motion(self._part(), number("step_us", step_us, "us"))
        return Motion(float(step_us), depth, force, [Contact(*contact) for contact in contacts])

    def _part(self) -> str:
        return parameters(self.parameters)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.parameters == other.parameters

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        ball, ending = self.parameters["ball"], self.parameters["ending"]
        end = f"caught after {ending['caught']['after']} impacts" if "caught" in ending else "left to rest"
        drop = self.parameters["drop_mm"]
        return f"Scene(ball of {ball['radius_mm']:.0f} mm and {ball['mass_g']:g} g from {drop:.0f} mm, {end})"


class Pictures:
    """Lay pictures over the array, with straight lines in time between them.

    Parameters
    ----------
    values : float32, shape (n, rows, columns), 0 to 1
        The share of the way from a taxel's rest to the ramp's end.
    period_us : float
        From one picture to the next; a frame or more.

    Raises
    ------
    ProblemError : values that are no pictures, or outside 0 to 1
    """

    def __init__(self, values: ArrayLike, period_us: float) -> None:
        self.values: NDArray[np.float32] = numbers("values", values, np.float32)
        if self.values.ndim != 3 or not len(self.values):
            raise ProblemError(f"values have shape {self.values.shape}: must be (n, rows, columns)")
        if not (np.all(self.values >= 0) and np.all(self.values <= 1)):
            raise ProblemError("values: must be shares of the ramp, 0 to 1")
        self.period_us = number("period_us", period_us, "us")

    def _part(self) -> Any:
        return self.values.reshape(-1), self.period_us

    def __repr__(self) -> str:
        n, rows, columns = self.values.shape
        return f"Pictures({n} of {rows} x {columns}, each {self.period_us:g} us)"


Act = Silence | Scene | Pictures
