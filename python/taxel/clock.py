"""A source's clock against the host's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import numbers
from taxel._base.messages import counted
from taxel._core import ProblemError

__all__ = ["Clock", "doubt"]

#: Between fewer datagrams, differences of their delays look like a drift.
_FEW = 10


def doubt(drift_ppm: float, delay_us: float, median_us: float = 0.0) -> str | None:
    """Return why a drift between two clocks, or delays, cannot be, with the likely cause; None if they can.

    Parameters
    ----------
    drift_ppm : float, parts per million
    delay_us : float, us
        That of 99 in 100 datagrams at most.
    median_us : float, us
        That of one in two at most.
    """
    return _core.clock_doubt(drift_ppm, delay_us, median_us)


@dataclass(frozen=True, eq=False, repr=False)
class Clock:
    """Convert between the clock of a source (a board or a stream) and the clock of the host.

    A datagram arrives late by its network delay, and seldom early. A line below the points *arrival time minus the
    source's time* is therefore the offset between the clocks plus the shortest delay; the two cannot be separated. The
    line is a quantile regression in which one point in a hundred may be below it, as the very shortest delays are
    outliers. Its slope is the drift. Over more than 32 s the line is fitted again and again, each time to the last 64
    s; between the midpoints of two such intervals time is interpolated linearly.

    Parameters
    ----------
    board_us : int64, shape (n,), us
        The earliest time at which each datagram could be sent, by the source's clock: the end of its frame, if known.
    arrived_ns : int64, shape (n,), ns since 1970
        Its arrival time by the host's clock.

    Raises
    ------
    ProblemError : no datagrams, when the drift or a time is asked for

    Examples
    --------
    >>> board_us = np.arange(0, 100_000, 1000)
    >>> clock = Clock(board_us, 5_000_000 + 1000 * board_us)
    >>> clock
    Clock(drift +0.0 ppm, delays 0 us median, 0 us 99 %)
    >>> int(clock.host_ns(1500))
    6500000
    """

    board_us: NDArray[np.int64]
    arrived_ns: NDArray[np.int64]

    @cached_property
    def _lines(self) -> list[tuple[int, _core._ClockLine]]:
        lines = _core.clock_lines(self.board_us, self.arrived_ns)
        if not lines:
            raise ProblemError("clock: no datagram contains a time, so the clocks cannot be compared")
        return lines

    @cached_property
    def _knots(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The midpoints of the intervals, us, and the host's time there, ns, extended by a second on either side."""
        lines = self._lines
        middles = [middle for middle, _ in lines]
        board = [middles[0] - 1_000_000, *middles, middles[-1] + 1_000_000]
        lines_there = [lines[0], *lines, lines[-1]]
        host = [_at(line, t) for (_, line), t in zip(lines_there, board, strict=True)]
        return np.array(board, np.int64), np.array(host, np.int64)

    @cached_property
    def _arrived(self) -> NDArray[np.int64]:
        """Arrival times in order, which a step of the host's clock back may have broken."""
        return np.maximum.accumulate(self.arrived_ns)

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the source's, parts per million."""
        lines = self._lines
        if len(lines) == 1:
            return lines[0][1]["drift_ppm"]
        board, host = self._knots
        return float((host[-2] - host[1]) / ((board[-2] - board[1]) * 1000) - 1) * 1e6

    def host_ns(self, board_us: int | NDArray[np.int64]) -> Any:
        """Return the host's time (ns since 1970) at times of the source (us).

        Parameters
        ----------
        board_us : int or int64, shape (n,), us

        Returns
        -------
        int or int64, shape (n,), ns since 1970

        Raises
        ------
        ProblemError : times that are not whole numbers; no datagrams, so that the clock is unknown

        Examples
        --------
        >>> Clock(np.array([0, 1000]), np.array([10**15, 10**15 + 10**6])).host_ns([500])
        array([1000000000500000])
        """
        t = numbers("board_us", board_us, np.int64, "us")
        board, host = self._knots
        k = np.clip(np.searchsorted(board, t, side="right") - 1, 0, len(board) - 2)
        since = t - board[k]
        slope = (host[k + 1] - host[k]) / (board[k + 1] - board[k]) - 1000.0
        if len(self._lines) == 1:
            slope = np.full(np.shape(k), self._lines[0][1]["drift_ppm"] * 1e-3)
        return host[k] + since * 1000 + np.rint(since * slope).astype(np.int64)

    def board_us_at(self, host_ns: int | NDArray[np.int64]) -> Any:
        """Return the source's time (us) at times of the host (ns since 1970).

        Parameters
        ----------
        host_ns : int or int64, shape (n,), ns since 1970

        Returns
        -------
        int or int64, shape (n,), us

        Raises
        ------
        ProblemError : times that are not whole numbers; no datagrams, so that the clock is unknown

        Examples
        --------
        >>> Clock(np.array([0, 1000]), np.array([10**15, 10**15 + 10**6])).board_us_at([10**15 + 500_000])
        array([500])
        """
        target = numbers("host_ns", host_ns, np.int64, "ns")
        board, host = self._knots
        t = board[0] + (target - host[0]) // 1000
        for _ in range(4):
            # Each iteration multiplies the error by the drift, 1e-4 or less.
            t = t + np.rint((target - self.host_ns(t)) / 1000.0).astype(np.int64)
        return t if np.ndim(target) else int(t)

    def _about_us(self, host_ns: int) -> int:
        """Return the source's time at a time of the host, between the arrivals beside it.

        Late by the delays of these two, but right to that where no line fits, as of a sender that is too busy for its
        own clock.
        """
        board, host = self.board_us, self._arrived
        k = int(np.searchsorted(host, host_ns))
        if 0 < k < len(board):
            before, after = int(host[k - 1]), int(host[k])
            return int(board[k - 1]) + (int(board[k] - board[k - 1]) * (host_ns - before)) // max(after - before, 1)
        edge = 0 if k == 0 else len(board) - 1
        return int(board[edge]) + (host_ns - int(host[edge])) // 1000

    @property
    def delay_us(self) -> NDArray[np.float64]:
        """The delay of each datagram beyond the shortest delay, us; negative for about one in a hundred."""
        late: NDArray[np.float64] = (self.arrived_ns - self.host_ns(self.board_us)) / 1000.0
        return late

    def __repr__(self) -> str:
        if not len(self.board_us):
            return "Clock(no datagram contains a time)"
        late, count = np.percentile(self.delay_us, [50, 99]), len(self.board_us)
        drift = (
            f"drift {self.drift_ppm:+.1f} ppm"
            if count >= _FEW
            else f"{counted(count, 'datagram')}, too few for a drift"
        )
        return f"Clock({drift}, delays {late[0]:.0f} us median, {late[1]:.0f} us 99 %)"


def _at(line: _core._ClockLine, own_us: int) -> int:
    since = own_us - line["board_us"]
    return line["host_ns"] + since * 1000 + round(since * line["drift_ppm"] * 1e-3)
