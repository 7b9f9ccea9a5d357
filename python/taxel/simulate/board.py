"""The emulated board that feels acts: as fast as it goes, or in real time over UDP."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._arguments import callback, mapping, number, parameters, several, shown, text, whole
from taxel._core import ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.simulate.acts import Act, Contact, Pictures, Scene, Silence
from taxel.spikes import to_ms

__all__ = ["EmulatorReport", "Played", "emulate", "play", "truth"]


_QUANTILES = {"p50": "median", "p99": "99 %", "max": "at most"}


class Played(NamedTuple):
    """What a host decoded of a board's datagrams."""

    events: Events
    """All of them: the tare's, then from the start marker on what the scenes made."""
    datagrams: int
    words: int
    """Of five bytes each."""


@dataclass(frozen=True)
class EmulatorReport:
    """What an emulated board has done so far."""

    frames: int
    began_ns: int
    """The host's clock at the board's time 0, ns since 1970: what the board does is due by it."""
    board_seconds: float
    """By the board's own clock."""
    seconds: float
    """By the host's: larger where the machine cannot hold the board's rate."""
    changes: int
    datagrams: int
    bytes: int
    dropped: int
    """Changes that found the board's queue full."""
    late_frames: int
    """Sent more than a frame after their end."""
    late_us: Mapping[str, float]
    """How long after its end a frame was sent: p50, p99, max."""

    @property
    def wanted_hz(self) -> float:
        """Frames a second by the board's clock."""
        return self.frames / self.board_seconds if self.board_seconds else 0.0

    @property
    def reached_hz(self) -> float:
        """Frames a second by the host's clock."""
        return self.frames / self.seconds if self.seconds else 0.0

    @property
    def held(self) -> bool:
        """Whether the machine held the board's rate, to within half a per cent of the time."""
        return self.seconds <= 1.005 * self.board_seconds + 0.02

    @property
    def verdict(self) -> str:
        """One line: whether the rate was held, or by how much not, and how late frames were."""
        late = ", ".join(f"{to_ms(self.late_us[q]):.2f} ms ({said})" for q, said in _QUANTILES.items())
        late = f"late by {late}; {self.late_frames} of {self.frames} by a frame or more"
        if self.held:
            whole = "held" if self.late_frames <= 0.01 * self.frames else "held on the whole, but not frame by frame"
            return f"{self.wanted_hz:.0f} frames/s {whole}; frames were {late}"
        short = 100.0 * (1.0 - self.reached_hz / self.wanted_hz)
        return (
            f"this machine cannot hold {self.wanted_hz:.0f} frames/s: it reached {self.reached_hz:.0f}, "
            f"{short:.1f} % less; frames were {late}"
        )

    @classmethod
    def _from_json(cls, said: str) -> EmulatorReport:
        report = json.loads(said)
        board, sent, late = report["board"], report["sent"], report["late"]
        return cls(
            frames=board["frames"],
            began_ns=report["began_ns"],
            board_seconds=report["board_seconds"],
            seconds=report["seconds"],
            changes=board["changes"],
            datagrams=sent["datagrams"],
            bytes=sent["bytes"],
            dropped=board["dropped"],
            late_frames=report["late_frames"],
            late_us={name: late[f"{name}_us"] for name in ("p50", "p99", "max")},
        )


def truth(
    acts: Sequence[Act], *, preset: str = "5.2 kHz", array: Array | None = None
) -> tuple[list[Contact], NDArray[np.float32]]:
    """Return what really happens in acts: touches by the board's clock (us from its first frame), force (N) by frame.

    Parameters
    ----------
    acts : sequence of Scene, Silence, Pictures
    preset : str
        The board's registers: "5.2 kHz", "2 kHz" or "20.8 kHz".
    array : Array, optional
        The thesis' 64 x 64 taxels where it is left out.

    Raises
    ------
    SceneError : an act that cannot be played (names it)

    Examples
    --------
    >>> contacts, force = truth([Silence(100.0), Scene.draw(seed=1)])
    >>> round(contacts[0].start_us), float(force[:520].max())
    (427782, 0.0)
    """
    contacts, force = _core.truth(Array._of(array)._parts(), text("preset", preset), _parts(acts, Array._of(array)))
    return [Contact(*contact) for contact in contacts], force


def play(
    acts: Sequence[Act],
    *,
    seed: int,
    preset: str = "5.2 kHz",
    tare_ms: float = 50.0,
    array: Array | None = None,
    sensor: Mapping[str, float] | None = None,
    watch: Callable[[float], object] = lambda _: None,
) -> Played:
    """Let an emulated board feel acts, as fast as it goes, and decode its datagrams.

    The board arms after its first frame, is tared with a noise floor of 0 for `tare_ms`, then takes the preset's floor
    and marks a start; before the last frame it marks a stop.

    Parameters
    ----------
    acts : sequence of Scene, Silence, Pictures
        The first should be a Silence longer than the tare.
    seed : int, 0 or more
        Draws the taxels' spread and the noise.
    preset, array
        As in `truth`.
    tare_ms : float, 0 to 60000
    sensor : mapping, optional
        What differs from the usual sensor: v_trans, feedback_kohm, rest_us, touch_us, exponent, side_mm, gain_spread,
        offset_mv, noise_ticks.
    watch : function, optional
        Called with the share that is played, once a second of the board's time.

    Raises
    ------
    SceneError : an act or a sensor that makes no sense
    ProblemError : acts too short for the tare

    Examples
    --------
    >>> played = play([Silence(60.0)], seed=1)
    >>> played.events.markers
    ((50300, True), (59900, False))
    """
    parts = _parts(acts, Array._of(array))
    events, datagrams, words = _core.play(
        Array._of(array)._parts(),
        text("preset", preset),
        parameters({} if sensor is None else mapping("sensor", sensor)),
        whole("seed", seed, 0),
        parts,
        number("tare_ms", tare_ms),
        callback("watch", watch),
    )
    return Played(Events._from_parts(events), datagrams, words)


def emulate(
    to: str,
    acts: Sequence[Act],
    *,
    seed: int,
    preset: str = "5.2 kHz",
    tare_ms: float = 50.0,
    array: Array | None = None,
    sensor: Mapping[str, float] | None = None,
    wire: Literal[1, 2] = 1,
    control: str | None = None,
    begun: Callable[[str | None], None] = lambda _: None,
    watch: Callable[[EmulatorReport], None] = lambda _: None,
) -> EmulatorReport:
    """Let an emulated board feel acts in real time, and send its datagrams by UDP.

    Parameters
    ----------
    to : str
        Address and port, as "127.0.0.1:5208".
    acts, seed, preset, tare_ms, array, sensor
        As in `play`.
    wire : {1, 2}
        The version of the wire that the board speaks.
    control : str, optional
        Address and port where the board takes commands by TCP; port 0 finds a free one.
    begun : function, optional
        Called with the address of `control` just before the first frame.
    watch : function, optional
        Called with a report ten times a second.

    Returns
    -------
    EmulatorReport : also how late frames were, which is where a machine shows that it cannot hold the board's rate

    Raises
    ------
    As in `play`; OSError where a socket cannot be had.
    """
    report = _core.emulate(
        text("to", to),
        Array._of(array)._parts(),
        text("preset", preset),
        parameters({} if sensor is None else mapping("sensor", sensor)),
        whole("seed", seed, 0),
        _parts(acts, Array._of(array)),
        number("tare_ms", tare_ms),
        whole("wire", wire, 1, 2),
        None if control is None else text("control", control),
        callback("begun", begun),
        lambda said: callback("watch", watch)(EmulatorReport._from_json(said)),
    )
    return EmulatorReport._from_json(report)


def _parts(acts: Sequence[Act], array: Array) -> list[Any]:
    for n, act in enumerate(several("acts", acts)):
        if not isinstance(act, Silence | Scene | Pictures):
            raise ProblemError(f"act {n} is {shown(act)}: must be a Scene, Silence or Pictures")
        if isinstance(act, Pictures) and act.values.shape[1:] != array.shape:
            raise ProblemError(f"act {n}: pictures of shape {act.values.shape[1:]}, the array has {array.shape}")
    return [act._part() for act in acts]
