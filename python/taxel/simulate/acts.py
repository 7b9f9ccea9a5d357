"""Acts that the emulated board is shown: silence, bodies, frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import finite, flag, integer, number, numbers, parameters, shown
from taxel._base.errors import refused
from taxel._base.messages import escaped, plain, warn
from taxel._core import ProblemError
from taxel.array import Array

__all__ = ["Act", "Contact", "FrameSequence", "Motion", "Scene", "Silence", "Track"]


class Contact(NamedTuple):
    """One true touch, from the time at which its force rises above zero to the time at which it is zero again.

    Attributes
    ----------
    kind : str
        "first", "bounce", "hand", "rest" (stayed until it was lifted), "roll", "slide" or "frames".
    start_us : float, us
    stop_us : float, us
    speed_m_s : float, m/s, 0 or more
        Speed at its beginning.
    peak_n : float, N
        The largest force; 0 where it is not known.
    """

    kind: str
    start_us: float
    stop_us: float
    speed_m_s: float
    peak_n: float


class Track(NamedTuple):
    """A body's path, at even steps.

    Attributes
    ----------
    x_mm : float32, shape (n,), mm
        Place of its middle, to the right of the first taxel.
    y_mm : float32, shape (n,), mm
    depth_mm : float32, shape (n,), mm
        Depth of its lowest point below the foam's surface; negative above it.
    force_n : float32, shape (n,), N
        Force on the foam.
    """

    x_mm: NDArray[np.float32]
    y_mm: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    force_n: NDArray[np.float32]


class Motion(NamedTuple):
    """The motion of a scene, computed at even steps.

    Attributes
    ----------
    step_us : float, us
    tracks : list of Track
        One for each body.
    contacts : list of Contact
        Contacts of all bodies, in order of time.
    """

    step_us: float
    tracks: list[Track]
    contacts: list[Contact]

    @property
    def force_n(self) -> NDArray[np.float32]:
        """The force of all bodies on the foam."""
        force: NDArray[np.float32] = np.sum([track.force_n for track in self.tracks], axis=0, dtype=np.float32)
        return force


@dataclass(frozen=True)
class Silence:
    """Let nothing touch the array.

    Parameters
    ----------
    ms : float, ms, above 0

    Raises
    ------
    SceneError : a time that is invalid, when it is played

    Examples
    --------
    >>> Silence(10.0)
    Silence(ms=10.0)
    """

    ms: float

    def _part(self) -> Any:
        return number("ms", self.ms)


class Scene:
    """Describe bodies over foam on the array, and their motions.

    Parameters
    ----------
    parameters : mapping
        As `parameters` of a drawn scene holds them, and as a file has them (see `SceneFile`):

        - ``bodies``, a list; of each: ``shape`` (``{"sphere": {"radius_mm"}}``, ``{"cylinder": {"radius_mm",
          "length_mm", "axis_deg"}}``, ``{"edge": {"slope_deg", "length_mm", "axis_deg"}}`` or ``{"height_map":
          {"heights_mm", "pitch_mm"}}``), ``x_mm`` and ``y_mm`` from the first taxel, where it first touches,
          ``mass_g`` or ``material`` ("steel", "glass", "rubber", "plastic", "wood"), ``stiffness_n_mm`` of one that
          gives, ``friction``, ``rolling_friction``, ``after_ms`` and ``motion``.
        - ``motion`` is ``{"dropped": {"height_mm", "ending"}}``, ``{"pressed": {"peak_n" or "depth_mm", "speed_mm_s",
          "hold_ms", "wait_ms"}}``, or ``{"rolled" or "slid": {"speed_mm_s", "toward_deg", "for_ms", "press_n"}}``; an
          ``ending`` is ``{"caught": {"after", "press"}}`` or ``{"left_to_rest": {"rest_ms", "lift_mm_s"}}``.
        - ``foam``: modulus_kpa, thickness_mm, poisson, yield_strain, densification_strain, exponent, damping_s_m,
          dashpot_ms.
        - ``cells_per_pitch``: how many cells of the layer there are along the pitch of taxels; usually 1, more for a
          touch narrower than two taxels.
        - ``slant_deg``, ``downhill_deg``: how far the array is tilted, and which way; ``lead_ms``, ``tail_ms``.

    Raises
    ------
    SceneError : when it is played, and a parameter is invalid, a body is off the array or bottoms out

    Warns
    -----
    UserWarning : when it is worked out or played for the first time, and a touch is narrower than cells resolve even at
        its deepest: names the body, and how many cells would do

    Notes
    -----
    Gibson and Ashby's foam with Hunt and Crossley's damping and a dashpot; the layer's base stress reaches the taxels.
    Modulus, damping, dashpot and friction are guesses. A body moves by the force that it would meet alone; bodies that
    press side by side are solved together in the stress that the taxels sense.

    Examples
    --------
    >>> scene = Scene.draw(seed=1)
    >>> scene
    Scene(sphere dropped)
    >>> [contact.kind for contact in scene.motion().contacts]
    ['first', 'bounce', 'bounce', 'bounce', 'hand']
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        if not isinstance(parameters, Mapping):
            raise refused(
                "parameters", f" are {shown(parameters)}: must be a mapping, such as Scene.draw(seed).parameters"
            )
        self.parameters = dict(parameters)
        self._warned = False

    @classmethod
    def draw(cls, seed: int, index: int = 0, *, left_to_rest: bool = False, array: Array | None = None) -> Scene:
        """Draw scene `index` of a seed: place, ball, drop and foam differ from scene to scene.

        Parameters
        ----------
        seed, index : int, 0 or more
        left_to_rest : bool
            Whether the ball is left to come to rest; else it is caught after 2 to 4 impacts and pressed by hand.
        array : Array, optional
            Default: the thesis' 64 x 64 taxels.

        Returns
        -------
        Scene

        Raises
        ------
        SceneError : an array too small to keep 36 mm from its edge
        ProblemError : a seed or an index that is not a whole number

        Examples
        --------
        >>> Scene.draw(seed=1, index=3) == Scene.draw(seed=1, index=3)
        True
        """
        seed, index = integer("seed", seed, 0), integer("index", index, 0, 1_000_000)
        return cls(_core.draw_scene(Array._of(array), seed, index, flag("left_to_rest", left_to_rest)))

    def replace(self, **changes: Any) -> Scene:
        """Return the scene with parameters changed. A mapping changes a part: ``foam={"dashpot_ms": 0}``.

        Raises
        ------
        ProblemError : a parameter that a scene does not have

        Examples
        --------
        >>> Scene.draw(seed=1).replace(lead_ms=5.0).parameters["lead_ms"]
        5.0
        """
        return Scene(_replaced("a scene", self.parameters, changes, ("cells_per_pitch",)))

    def body(self, n: int = 0, **changes: Any) -> Scene:
        """Return the scene with parameters of body `n` changed, such as ``x_mm=80``. A mapping changes a part.

        Parameters
        ----------
        n : int, 0 or more
            The body's number.
        **changes
            Parameters of a body.

        Returns
        -------
        Scene

        Raises
        ------
        ProblemError : no such body, or a parameter that it does not have

        Examples
        --------
        >>> Scene.draw(seed=1).body(0, x_mm=80.0).parameters["bodies"][0]["x_mm"]
        80.0
        """
        bodies = list(self.parameters["bodies"])
        n = integer("n", n, 0, len(bodies) - 1)
        bodies[n] = _replaced("a body", bodies[n], changes, _BODY)
        return Scene({**self.parameters, "bodies": bodies})

    def motion(self, step_us: float = 48.0, *, array: Array | None = None) -> Motion:
        """Compute the motion; by default in quarters of a frame of 5208 Hz, over the thesis' array.

        Parameters
        ----------
        step_us : float, us, above 0, at most 1000
            Time from one entry of a track to the next.
        array : Array, optional
            Default: the thesis' 64 x 64 taxels.

        Returns
        -------
        Motion

        Raises
        ------
        SceneError : a parameter of the scene that is invalid, a body off the array, or more than 2e7 steps
        ProblemError : a step that is not a number

        Examples
        --------
        >>> motion = Scene.draw(seed=1).motion(step_us=100.0)
        >>> round(float(motion.force_n.max()), 1), len(motion.contacts)
        (19.0, 5)
        """
        step = number("step_us", step_us)
        tracks, contacts, narrow = _core.motion(Array._of(array), self._part(), step)
        self._warn(narrow)
        return Motion(float(step_us), [Track(**track) for track in tracks], [Contact(**touch) for touch in contacts])

    def _part(self) -> str:
        return parameters(self.parameters)

    def _warn(self, narrow: str | None) -> None:
        """Warn, once for each scene, that a touch is too narrow."""
        if narrow is not None and not self._warned:
            self._warned = True
            warn(narrow, stacklevel=3)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.parameters == other.parameters

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        bodies = self.parameters.get("bodies", [])
        kinds = [f"{_only(body, 'shape')} {_only(body, 'motion')}" for body in bodies]
        return escaped(f"Scene({', '.join(kinds)})")


#: Optional parameters of a body.
_BODY = ("mass_g", "material", "stiffness_n_mm", "friction", "rolling_friction", "after_ms")


def _only(body: object, part: str) -> str:
    """Return the one name in a part of a body."""
    kinds = body.get(part) if isinstance(body, Mapping) else None
    return "/".join(map(str, kinds)) if isinstance(kinds, Mapping) else "?"


def _replaced(
    noun: str, before: Mapping[str, Any], changes: Mapping[str, Any], more: Sequence[str] = ()
) -> dict[str, Any]:
    """Return parameters with some changed; parts are merged to any depth, except a part that has several kinds."""
    merged = dict(before)
    for name, change in changes.items():
        if name not in before and name not in more:
            raise ProblemError(
                f"{name} is not known in {noun}: must be one of {', '.join(dict.fromkeys([*before, *more]))}"
            )
        merged[name] = _merged(merged.get(name), change)
    return merged


def _merged(before: Any, change: Any) -> Any:
    if not (isinstance(before, Mapping) and isinstance(change, Mapping)):
        return change
    # A group of one is a kind with its parameters; another kind takes its place.
    if (
        len(before) == len(change) == 1
        and set(before) != set(change)
        and isinstance(next(iter(before.values())), Mapping)
    ):
        return change
    return {**before, **{name: _merged(before.get(name), value) for name, value in change.items()}}


class FrameSequence:
    """Play frames on the array, with linear interpolation in time.

    Parameters
    ----------
    values : float32, shape (n, rows, columns), 0 to 1
        Share of the range from a taxel's rest to the ramp's end.
    period_us : float, us
        Time from one frame to the next; at least the time of the board's frame.

    Raises
    ------
    ProblemError : values that are not frames, or outside 0 to 1

    Examples
    --------
    >>> FrameSequence([[[0.0]], [[0.5]]], period_us=192.0).period_us
    192.0
    """

    def __init__(self, values: ArrayLike, period_us: float) -> None:
        self.values: NDArray[np.float32] = numbers("values", values, np.float32)
        if self.values.ndim != 3 or not len(self.values):
            raise refused("values", f" have shape {self.values.shape}: must be (n, rows, columns)")
        if not (np.all(self.values >= 0) and np.all(self.values <= 1)):
            raise refused("values", ": must be shares of the ramp, 0 to 1")
        self.period_us = finite("period_us", period_us, least=0.0)

    def _part(self) -> Any:
        return self.values.reshape(-1), self.period_us

    def __repr__(self) -> str:
        n, rows, columns = self.values.shape
        return f"FrameSequence({n} of {rows} x {columns}, each {plain(self.period_us)} us)"


Act = Silence | Scene | FrameSequence
