"""Encoder of level crossings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, Literal

from taxel._base.parameters import Value, defaults
from taxel.encode._encoder import Encoder

_RANGE = defaults("running_range")


@dataclass(eq=False, repr=False)
class RunningRange(Value):
    """Apply levels to each channel's own range, y = (x - low) / (high - low), against drift and unknown gain.

    Parameters
    ----------
    low, high : float, percent, from 0 to 100
        The percentiles of the past window that become 0 and 1 (linear between ranks).
    window_s : float, s, whole us
        Length of the window; its samples are kept in memory.
    renew_s : float, s, whole us
        Interval at which the percentiles are recomputed after the end of the first window.
    first_window : {"silent", "itself"}
        Before the first window is full there are no spikes; or, for recordings, the first window is encoded by its own
        percentiles, so that its spikes are late by up to the window.

    Raises
    ------
    ProblemError : an invalid parameter, when an encoder with this range is made

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
    """Fire when a taxel reaches a level (+1) and when it falls below the release of the level (-1).

    Trains are signed, in the order ``taxel * len(levels) + level``; with `tonic_ms`, one more train for each taxel
    follows. The first sample is not a crossing. Values and levels are compared in float32.

    Parameters
    ----------
    levels : sequence of float, ascending
        In the sensor's unit, or in shares of the running range.
    release_share : float, above 0, at most 1, optional
        Release as a share of each level; 1 if neither release is given (no hysteresis).
    release_by : float, 0 or more, optional
        Instead of `release_share`, release as a distance below each level.
    hold_ms : float, ms, 0 or more, whole us
        Time that a crossing must last; its spike is delayed by it, so this is the latency.
    tonic_ms : float, ms, whole us, optional
        Adds tonic spikes, the slowly adapting part: one at the crossing, then one every `tonic_ms` while above the
        level.
    tonic_level : float, one of `levels`, optional
        The level above which tonic spikes occur; default: the first level.
    running_range : RunningRange, optional
        Applies the levels to the channel's running range.
    period_ms : float, ms, whole us
        Sampling period of events; the step of the wire's stamps is lossless.

    Raises
    ------
    ProblemError : an invalid parameter

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
