"""Detections against the simulated truth, by class of touch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.detect import Spread, score
from taxel.detections import Detections
from taxel.simulate import Contact
from taxel.spikes import to_ms

__all__ = ["CLASSES", "GOALS", "LABELS", "ClassMatches", "TouchMatches", "judge"]

LABELS = ("contact", "lift")

#: Impacts come 30 ms apart: a wider window would pair a miss with its neighbour.
_IMPACT_MS, _PRESS_MS = 10.0, 50.0

#: Classes of touch, in the order of the report's rows; impacts by speed, presses by peak force.
CLASSES: tuple[tuple[str, Callable[[Contact], bool]], ...] = (
    ("first impact", lambda c: c.kind == "first"),
    ("bounce, 0.4 m/s and more", lambda c: c.kind == "bounce" and c.speed_m_s >= 0.4),
    ("bounce, 0.15 to 0.4 m/s", lambda c: c.kind == "bounce" and 0.15 <= c.speed_m_s < 0.4),
    ("bounce below 0.15 m/s", lambda c: c.kind == "bounce" and c.speed_m_s < 0.15),
    ("pressed by hand, 1 N and more", lambda c: c.kind == "hand" and c.peak_n >= 1.0),
    ("pressed by hand, 0.4 to 1 N", lambda c: c.kind == "hand" and 0.4 <= c.peak_n < 1.0),
    ("pressed by hand, below 0.4 N", lambda c: c.kind == "hand" and c.peak_n < 0.4),
    ("come to rest, then lifted", lambda c: c.kind == "rest"),
)

#: Within how many ms of a first impact and of its lift-off `known` should lie, in 95 of 100.
GOALS = {"contact": 1.0, "lift": 1.5}


class ClassMatches(NamedTuple):
    """Touches of one class, and how the detections of one label match them."""

    name: str
    label: str
    touches: int
    errors_ms: NDArray[np.float64]
    """Time of the detection minus the true time, of each touch that was found."""
    delays_ms: NDArray[np.float64]
    """Time at which the detection was known minus the true time, of each touch that was found."""

    @property
    def found(self) -> int:
        """How many touches were detected."""
        return len(self.errors_ms)

    def to_dict(self) -> dict[str, Any]:
        """Return counts and spreads as plain values; what is not known is None."""
        known = self.delays_ms
        return {
            "touches": self.touches,
            "found": self.found,
            "error_ms": _plain(Spread.from_values(self.errors_ms)._asdict()),
            "known_ms": _plain(
                {f"p{q}": float(np.percentile(known, q)) if len(known) else float("nan") for q in (5, 50, 95)}
            ),
        }


class TouchMatches(NamedTuple):
    """Detections by class of touch and label, and those that belong to no touch."""

    rows: list[ClassMatches]
    false: dict[str, NDArray[np.int64]]
    """Times of the detections that belong to no touch, us, by label."""
    false_within: dict[str, int]
    """Number of these detections that are within a touch, but more than 50 ms from its beginning or end, by label."""

    def row(self, name: str, label: str) -> ClassMatches:
        """Return one row; its name may be cut short."""
        return next(row for row in self.rows if row.label == label and row.name.startswith(name))

    @property
    def false_counts(self) -> dict[str, int]:
        """How many detections of each label belong to no touch."""
        return {label: len(times) for label, times in self.false.items()}

    def within_goal(self, label: str) -> float:
        """Return the share of all first impacts of which `known` lay within the goal."""
        row = self.row("first", label)
        return float((np.abs(row.delays_ms) <= GOALS[label]).sum() / row.touches) if row.touches else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values."""
        table: dict[str, Any] = {}
        for row in self.rows:
            if row.touches:
                table.setdefault(row.name, {})[row.label] = row.to_dict()
        goals = _plain({label: self.within_goal(label) for label in LABELS})
        return {
            "classes": table,
            "first_within_goal": {
                label: {"touches": self.row("first", label).touches, "goal_ms": GOALS[label], "share": goals[label]}
                for label in LABELS
            },
            "false": self.false_counts,
            "false_within_a_touch": self.false_within,
        }


def judge(detections: Detections, contacts: Sequence[Contact]) -> TouchMatches:
    """Match detections of "contact" (force leaves zero) and "lift" (force returns there) with touches in order.

    Impacts are matched within 10 ms, presses and all others within 50.
    """
    windows = [_IMPACT_MS if c.kind in ("first", "bounce") else _PRESS_MS for c in contacts]
    rows: list[ClassMatches] = []
    false: dict[str, NDArray[np.int64]] = {}
    within: dict[str, int] = {}
    for label, begin in (("contact", True), ("lift", False)):
        true = np.array([c.start_us if begin else c.stop_us for c in contacts], np.float64)
        of_label = detections[label]
        # Scored on whole us; errors are taken from the truth itself.
        result = score(of_label, {label: np.rint(true).astype(np.int64)}, {label: windows})
        mine_at, touch = result.pairs[:, 0], result.pairs[:, 1]
        errors, delays = to_ms(of_label.t[mine_at] - true[touch]), to_ms(of_label.known[mine_at] - true[touch])
        for name, belongs in CLASSES:
            of_class = np.array([belongs(c) for c in contacts], bool)
            chosen = of_class[touch] if len(touch) else np.zeros(0, bool)
            rows.append(ClassMatches(name, label, int(of_class.sum()), errors[chosen], delays[chosen]))
        false[label] = of_label.t[result.false_detections]
        within[label] = sum(any(c.start_us <= t <= c.stop_us for c in contacts) for t in false[label])
    return TouchMatches(rows, false, within)


def _plain(values: dict[str, float]) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else float(value) for name, value in values.items()}
