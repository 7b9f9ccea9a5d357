"""Plain crossings of levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, Literal

from taxel._base.parameters import Value, defaults
from taxel.encode._encoder import Encoder

__all__ = ["LevelCrossing", "RunningRange"]


_RANGE = defaults("running_range")


@dataclass(eq=False, repr=False)
class RunningRange(Value):
    """Put levels on each channel's own range, y = (x - low) / (high - low), against drift and unknown gain.

    Parameters
    ----------
    low, high : float, percent, from 0 to 100
        The percentiles (linear between ranks) of the past window that read 0 and 1.
    window_s : float, s, whole us
        How long the window is; its samples stay in memory.
    renew_s : float, s, whole us
        How often the percentiles are renewed, counted from the end of the first window.
    first_window : {"silent", "itself"}
        Until the first window is full: no spike; or, for recordings, the first window read by its own percentiles,
        whose spikes then come late by up to the window.

    Raises
    ------
    ProblemError : a parameter that makes no sense, when an encoder with this range is made

    Notes
    -----
    A channel whose two percentiles are equal has no range and stays below all levels.

    Examples
    --------
    >>> LevelCrossing([0.5], running_range=RunningRange(low=10, high=90)).running_range.high
    90
    """

    low: float = _RANGE.low
    high: float = _RANGE.high
    window_s: float = _RANGE.window_s
    renew_s: float = _RANGE.renew_s
    first_window: Literal["silent", "itself"] = _RANGE.first_window

    _kind = "running_range"


_DEFAULT = defaults("level_crossing")


@dataclass(eq=False, repr=False)
class LevelCrossing(Encoder):
    """Give a spike where a taxel comes to a level (+1) and where it falls below the level's release (-1).

    Trains: ``taxel * len(levels) + level``, signed; with `tonic_ms` one more a taxel behind them. It begins settled:
    the first sample makes no crossing. Values and levels are compared in float32.

    Parameters
    ----------
    levels : sequence of float, ascending
        In the sensor's unit, or in shares of the running range.
    release_share : float, above 0, at most 1, optional
        Release as a share of each level; 1 where neither release is given: plain crossings.
    release_by : float, 0 or more, optional
        Release as a distance below each level, instead.
    hold_ms : float, ms, 0 or more, whole us
        How long a crossing must last; its spike comes after that time, so this is the latency.
    tonic_ms : float, ms, whole us, optional
        Adds tonic spikes, the slowly adapting part: one at the crossing, then one every `tonic_ms` while above.
    tonic_level : float, one of `levels`, optional
        While above which tonic spikes come; the first level where it is left out.
    running_range : RunningRange, optional
        Levels on the channel's running range.
    period_ms : float, ms, whole us
        How often events are sampled; the step of the wire's stamps loses nothing.

    Raises
    ------
    ProblemError : a parameter that makes no sense

    Examples
    --------
    >>> from taxel import Frames
    >>> frames = Frames([[[v]] for v in (0, 6, 4, 3, 0)], [0, 10_000, 20_000, 30_000, 40_000], unit="N")
    >>> spikes = LevelCrossing([5.0], release_share=0.7).encode(frames)
    >>> spikes.times, spikes.values
    (array([10., 30.]), array([ 1., -1.], dtype=float32))
    """

    name = "level_crossing"
    _nested: ClassVar = {"running_range": RunningRange}

    levels: Sequence[float]
    _: KW_ONLY
    release_share: float | None = _DEFAULT.release_share
    release_by: float | None = _DEFAULT.release_by
    hold_ms: float = _DEFAULT.hold_ms
    tonic_ms: float | None = _DEFAULT.tonic_ms
    tonic_level: float | None = _DEFAULT.tonic_level
    running_range: RunningRange | None = _DEFAULT.running_range
    period_ms: float = _DEFAULT.period_ms
