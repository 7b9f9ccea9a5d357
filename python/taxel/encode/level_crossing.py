"""Plain crossings of levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

from taxel.encode._encoder import Encoder

__all__ = ["LevelCrossing", "RunningRange"]


@dataclass(frozen=True)
class RunningRange:
    """Put levels on each channel's own range, y = (x - low) / (high - low), against drift and unknown gain.

    Parameters
    ----------
    low, high : float, percent, 0 to 100
        The percentiles (linear between ranks) of the past window that read 0 and 1.
    window_s : float, s
        How long the window is; its samples are kept in memory.
    renew_s : float, s
        How often the percentiles are renewed, counted from the end of the first window.
    first_window : {"silent", "itself"}
        Until the first window is full: no spike; or, for recordings, the first window read by its own percentiles,
        whose spikes then come late by up to the window.

    Notes
    -----
    A channel whose two percentiles are equal has no range and stays below all levels.
    """

    low: float = 10.0
    high: float = 95.0
    window_s: float = 10.0
    renew_s: float = 1.0
    first_window: Literal["silent", "itself"] = "silent"


class LevelCrossing(Encoder):
    """Say where a taxel comes to a level (+1) and where it falls below the level's release (-1).

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
    hold_ms : float, ms, whole us
        How long a crossing must last; it is said then, so this is the latency.
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

    def __init__(
        self,
        levels: Sequence[float],
        *,
        release_share: float | None = None,
        release_by: float | None = None,
        hold_ms: float = 0.0,
        tonic_ms: float | None = None,
        tonic_level: float | None = None,
        running_range: RunningRange | None = None,
        period_ms: float = 0.1,
    ) -> None:
        self.levels = levels
        self.release_share = release_share
        self.release_by = release_by
        self.hold_ms = hold_ms
        self.tonic_ms = tonic_ms
        self.tonic_level = tonic_level
        self.running_range = running_range
        self.period_ms = period_ms
        self._check()

    @classmethod
    def _from_parameters(cls, values: dict[str, Any]) -> Self:
        if values["running_range"] is not None:
            values["running_range"] = RunningRange(**values["running_range"])
        return cls(**values)
