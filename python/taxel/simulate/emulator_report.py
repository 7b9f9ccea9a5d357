"""Report of what an emulated board has done so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from taxel.spikes import to_ms

__all__ = ["EmulatorReport"]

_QUANTILES = {"p50": "median", "p99": "99 %", "max": "at most"}


@dataclass(frozen=True)
class EmulatorReport:
    """Report of what an emulated board has done so far.

    Attributes
    ----------
    frames : int, 0 or more
    began_ns : int, ns since 1970
        The host's clock at the board's time 0, from which the times of all actions of the board follow.
    board_seconds : float, s
        Duration by the board's clock.
    seconds : float, s
        Duration by the host's clock: larger if the machine cannot keep the board's rate.
    changes : int, 0 or more
    datagrams : int, 0 or more
    bytes : int, 0 or more
    dropped : int, 0 or more
        Changes that found the board's queue full.
    late_frames : int, 0 or more
        Frames that were sent more than a frame after their end.
    late_us : mapping of str to float, us
        Delay between the end of a frame and its datagram: p50, p99, max; not measured if frames are sent as they come.
    network : mapping of str to int, or None
        Effects of the simulated network on datagrams, if there is one: given, delivered, and by fault.
    resets : int, 0 or more
        Number of resets of the board.
    """

    frames: int
    began_ns: int
    board_seconds: float
    seconds: float
    changes: int
    datagrams: int
    bytes: int
    dropped: int
    late_frames: int
    late_us: Mapping[str, float]
    network: Mapping[str, int] | None = None
    resets: int = 0

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
        """One line: whether the rate was kept, or by how much it was missed, and how late frames were."""
        late = ", ".join(f"{to_ms(self.late_us[q]):.2f} ms ({quantile})" for q, quantile in _QUANTILES.items())
        late = f"late by {late}; {self.late_frames} of {self.frames} by a frame or more"
        if self.held:
            pace = (
                "reached"
                if self.late_frames <= 0.01 * self.frames
                else "reached on average, but single frames were late"
            )
            return f"{self.wanted_hz:.0f} frames/s {pace}; frames were {late}"
        short = 100.0 * (1.0 - self.reached_hz / self.wanted_hz)
        return (
            f"this machine is too slow for {self.wanted_hz:.0f} frames/s: it reached {self.reached_hz:.0f}, "
            f"{short:.1f} % less; frames were {late}"
        )

    @classmethod
    def _of(cls, report: Mapping[str, Any]) -> EmulatorReport:
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
            late_us={name: late[f"{name}_us"] or 0.0 for name in ("p50", "p99", "max")},
            network=report["network"],
            resets=report["resets"],
        )
