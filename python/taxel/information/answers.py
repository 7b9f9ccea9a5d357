"""The answer about a user's own sensor: bits by setting, and their cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from taxel.information.estimate import Estimate, ZeroTest
from taxel.information.keeping import Keeping
from taxel.information.wire_rate import WIRE

__all__ = ["Answer", "Control", "Point", "is_above_chance"]

#: A length with at least this share of the answer's bits is reported as a warning.
_NEAR = 0.8


@dataclass(frozen=True, eq=False)
class Point:
    """Hold the bits of one setting, and their cost.

    Attributes
    ----------
    period_ms, window_ms : float, ms
    taxels : int, 1 or more
        All that ever send an event, or some of them, drawn again in each draw.
    found : Estimate
    events : float, 0 or more
        Events in a trial, up to the end of the window.
    silent : float, share of all
        Trials without any event.
    kbps : float, 0 or more
        Kilobits a second on the wire while touched.
    verdict : Keeping, optional
        Of a longer period with all taxels and the whole window: comparison with the finest period; else None.
    """

    period_ms: float
    window_ms: float
    taxels: int
    found: Estimate
    events: float
    silent: float
    kbps: float
    verdict: Keeping | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as JSON holds them."""
        verdict = None
        if self.verdict is not None:
            verdict = {
                "says": self.verdict.says,
                "margin": round(self.verdict.margin, 4),
                "error": round(self.verdict.error, 4),
            }
        return {
            "period_ms": self.period_ms,
            "window_ms": self.window_ms,
            "taxels": self.taxels,
            **self.found.to_dict(),
            "events": round(self.events, 2),
            "silent": round(self.silent, 4),
            "kbps": round(self.kbps, 2),
            "verdict": verdict,
        }


class Control(NamedTuple):
    """Hold the bits of the length of a touch alone, without its pattern.

    Attributes
    ----------
    found : Estimate
    about : str
        From when to when it is measured.
    """

    found: Estimate
    about: str


@dataclass(frozen=True, eq=False)
class Answer:
    """Hold the results of `taxel.information.answer`.

    Attributes
    ----------
    labels : dict of str to int
        Number of trials by label.
    groups : int, 0 or more
        Number of groups; 0 if none are named.
    encoder : str
    full : Point
        The finest period, all taxels, the whole window: the reference of all others.
    points : tuple of Point
        Results by period and window, with all taxels.
    taxels : tuple of Point
        Results by number of taxels, at one period.
    control : Control
    zero : ZeroTest
    notes : tuple of str
        Questions that these recordings cannot answer, and results that were left out.
    draws : int, 1 or more
    seed : int, 0 or more
    wire : str
        Version of the wire by which the costs are counted.
    """

    labels: dict[str, int]
    groups: int
    encoder: str
    full: Point
    points: tuple[Point, ...]
    taxels: tuple[Point, ...]
    control: Control
    zero: ZeroTest
    notes: tuple[str, ...]
    draws: int
    seed: int
    wire: str = WIRE

    @property
    def by_period(self) -> tuple[Point, ...]:
        """All periods, to the whole window."""
        return tuple(point for point in self.points if point.window_ms == self.full.window_ms)

    @property
    def empty(self) -> bool:
        """Whether the full setting's bits are not above 0, so that other settings have nothing to keep."""
        return not is_above_chance(self.full.found, self.zero) or any(
            p.verdict is not None and p.verdict.says == "nothing" for p in self.by_period
        )

    @property
    def warnings(self) -> tuple[str, ...]:
        """Reasons to doubt the full setting's bits: shuffled labels, wrong answers or the length give about as much."""
        estimate = self.full.found
        lines = []
        if estimate.bits <= self.zero.level:
            lines.append(
                "the bits cannot be distinguished from 0: shuffled labels give as much (95 % of the shuffles "
                "give less than "
                f"{self.zero.level:.2f})"
            )
        guessed, least = _guessing(estimate)
        if estimate.right < least:
            lines.append(
                f"{100 * estimate.right:.0f} % are classified correctly, but guessing gives {100 * guessed:.0f} %: "
                "the bits come from the wrong answers"
                + (", for example if a group has mostly one label" if self.groups else "")
            )
        length = self.control.found
        if not self.empty and length.interval[0] > 0 and length.bits >= _NEAR * estimate.bits:
            lines.append(f"the length alone gives {length.bits:.2f} bits: the answer may be about it only")
        return (*lines, *estimate.warnings)

    @property
    def cheapest(self) -> Point:
        """The period of the lowest rate among those that keep 95 % of the full setting's bits, or the full setting."""
        sufficient = [p for p in self.by_period if p.verdict is not None and p.verdict.says == "keeps"]
        return min([self.full, *sufficient], key=lambda point: point.kbps)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as JSON holds them."""
        return {
            "labels": self.labels,
            "groups": self.groups,
            "encoder": self.encoder,
            "full": self.full.to_dict(),
            "points": [point.to_dict() for point in self.points],
            "taxels": [point.to_dict() for point in self.taxels],
            "length": {"about": self.control.about, **self.control.found.to_dict()},
            "zero": {
                "level": round(self.zero.level, 4),
                "p": round(self.zero.p, 4),
                "shuffles": len(self.zero.shuffled),
            },
            "cheapest": self.cheapest.to_dict(),
            "warnings": list(self.warnings),
            "confusion": {
                "labels": [str(c) for c in self.full.found.classes],
                "counts": self.full.found.counts.mean(0).round(2).tolist(),
            },
            "wire": self.wire,
            "notes": list(self.notes),
            "draws": self.draws,
            "seed": self.seed,
        }


def _guessing(estimate: Estimate) -> tuple[float, float]:
    """Return the share of trials that guessing classifies correctly, and that less three standard deviations."""
    trials = estimate.counts[0].sum(1)
    guessed = float(((trials / trials.sum()) ** 2).sum())
    return guessed, guessed - 3.0 * float(np.sqrt(guessed * (1 - guessed) / trials.sum()))


def is_above_chance(estimate: Estimate, zero: ZeroTest) -> bool:
    """Whether the bits exceed those of shuffled labels, and trials are not classified worse than by guessing."""
    return estimate.bits > zero.level and estimate.right >= _guessing(estimate)[1]
