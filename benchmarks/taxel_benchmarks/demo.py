"""Touches that the demo finds in 100 scenes without the clock, by class, and their latency; false ones in noise.

Peer: the plain rule, two loaded taxels. Unit: touches found; ms from the touch to `known`. Goal: first impacts within
1 ms of the contact and 1.5 ms of the lift.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from taxel.demo.playing import Demo, evaluate, shipped
from taxel.demo.script import script
from taxel.detect import Score, Spread
from taxel.simulate import Act, Contact, Silence, play, truth
from taxel_benchmarks._goals import Goal, at_least, at_most

_SEED = 1
#: Classes of touch; impacts by speed, presses by peak force.
CLASSES: tuple[tuple[str, Callable[[Contact], bool]], ...] = (
    ("first impact", lambda c: c.kind == "first"),
    ("bounce, 0.4 m/s and more", lambda c: c.kind == "bounce" and c.speed_m_s >= 0.4),
    ("bounce, 0.15 to 0.4 m/s", lambda c: c.kind == "bounce" and 0.15 <= c.speed_m_s < 0.4),
    ("bounce below 0.15 m/s", lambda c: c.kind == "bounce" and c.speed_m_s < 0.15),
    ("pressed by hand, 1 N and more", lambda c: c.kind == "hand" and c.peak_n >= 1.0),
    ("pressed by hand, 0.4 to 1 N", lambda c: c.kind == "hand" and 0.4 <= c.peak_n < 1.0),
    ("pressed by hand, below 0.4 N", lambda c: c.kind == "hand" and c.peak_n < 0.4),
)


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    first = result["neuron"]["classes"]["first impact"]
    known = {f"first impact, {name}: known, p95, ms": one["known_ms"]["p95"] for name, one in first.items()}
    found = {f"first impact, {name}: found, of all": one["found"] / one["touches"] for name, one in first.items()}
    return at_least(dict.fromkeys(found, 1.0), found) + at_most(dict(zip(known, (1.0, 1.5), strict=True)), known)


def by_class(score: Score, contacts: Sequence[Contact]) -> dict[str, Any]:
    """Return how many touches of each class were found and how soon, by label, and how many detections are of none."""
    classes: dict[str, Any] = {}
    for n, (label, of_label) in enumerate(score.by_label.items()):
        # A score of several labels numbers its events one label after the other.
        touches = of_label.pairs[:, 1] - n * len(contacts)
        for name, belongs in CLASSES:
            chosen = np.array([belongs(contact) for contact in contacts], bool)
            if chosen.any():
                of_class = chosen[touches]
                errors, known = of_label.errors_ms[of_class], of_label.delays_ms[of_class]
                classes.setdefault(name, {})[label] = {
                    "touches": int(chosen.sum()),
                    "found": len(errors),
                    "error_ms": _known(Spread.from_values(errors)._asdict()),
                    "known_ms": {f"p{q}": float(np.percentile(known, q)) if len(known) else None for q in (5, 50, 95)},
                }
    return {"classes": classes, "false": {label: part.false for label, part in score.by_label.items()}}


def _known(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: None if np.isnan(value) else value for name, value in values.items()}


def _played(acts: Sequence[Act]) -> Demo:
    return evaluate(play(acts, seed=_SEED).events, acts, shipped())


def run(*, quick: bool) -> dict[str, Any]:
    scenes, noise_s = (2, 5.0) if quick else (100, 120.0)
    acts = script(_SEED, scenes)
    played, (contacts, _) = _played(acts), truth(acts)
    quiet = _played([Silence(50.3 + 1000.0 * noise_s)])
    assert played.outcome.score is not None  # the truth is known
    values = {"neuron": by_class(played.outcome.score, contacts), "plain_rule": by_class(played.plain, contacts)}
    noise = {"seconds": noise_s, "neuron": len(quiet.outcome.found), "plain_rule": quiet.plain.false}
    ratios = {}
    for touch in ("first impact", "bounce, 0.4 m/s and more"):
        for label in ("contact", "lift"):
            ours, rule = (values[way]["classes"][touch][label] for way in ("neuron", "plain_rule"))
            ratios[f"{touch}, {label}: found, of {ours['touches']}"] = ours["found"]
            ratios[f"{touch}, {label}: plain rule's delay over ours"] = (
                rule["known_ms"]["p50"] / ours["known_ms"]["p50"]
            )
    return {"scenes": scenes, "seed": _SEED, **values, "noise": noise, "ratios": ratios}
