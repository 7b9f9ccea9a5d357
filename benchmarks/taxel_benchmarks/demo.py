"""Touches that the demo finds in 100 scenes without the clock, and their latency.

Peer: the plain rule, two loaded taxels. Unit: touches found; ms from the touch to `known`. Goal: first impacts within
1 ms of the contact and 1.5 ms of the lift, as `taxel demo` states.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from taxel.cli.console import Console
from taxel.demo.showing import show
from taxel_benchmarks._goals import Goal, at_least, at_most
from taxel_benchmarks._rounds import stamp


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    first = result["neuron"]["classes"]["first impact"]
    known = {f"first impact, {name}: known, p95, ms": one["known_ms"]["p95"] for name, one in first.items()}
    found = {f"first impact, {name}: found, of all": one["found"] / one["touches"] for name, one in first.items()}
    return at_least(dict.fromkeys(found, 1.0), found) + at_most(dict(zip(known, (1.0, 1.5), strict=True)), known)


def run(*, quick: bool) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        values, _ = show(
            Console(quiet=True),
            scenes=2 if quick else 100,
            seed=1,
            live=False,
            noise_s=5.0 if quick else None,
            readout=None,
            folder=Path(place) / "demo",
        )
    ratios = {}
    for touch in ("first impact", "bounce, 0.4 m/s and more"):
        for label in ("contact", "lift"):
            ours, rule = (values[way]["classes"][touch][label] for way in ("neuron", "plain_rule"))
            ratios[f"{touch}, {label}: found, of {ours['touches']}"] = ours["found"]
            ratios[f"{touch}, {label}: plain rule's delay over ours"] = (
                rule["known_ms"]["p50"] / ours["known_ms"]["p50"]
            )
    return values | stamp() | {"ratios": ratios}
