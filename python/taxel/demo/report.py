"""The demo's report: a page with pictures, and the same figures as JSON."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from markupsafe import Markup

import taxel
from taxel.demo import pictures
from taxel.demo.evaluation import Evaluation
from taxel.demo.judging import TouchMatches
from taxel.demo.playing import Playing
from taxel.live import delays
from taxel.report.page import render
from taxel.report.svg import STYLE, picture

__all__ = ["figures", "lines", "write"]

#: Bits of an event with its intensity on the wire (version 1).
_EVENT_BITS = 80


def _load() -> float | None:
    """Return the machine's load of the last minute; None where the system keeps none."""
    if sys.platform == "win32":
        return None
    return os.getloadavg()[0]


def figures(
    evaluation: Evaluation, quiet: Evaluation, playing: Playing | None, *, seed: int, scenes: int
) -> dict[str, Any]:
    """Return all figures of a report as plain values; `quiet` is a stretch of noise, `playing` a run in real time."""
    events_per_s = len(evaluation.events) / evaluation.seconds
    return {
        "what": "taxel demo",
        "seed": seed,
        "scenes": scenes,
        "clock": "without the clock: as fast as possible, without a socket"
        if playing is None
        else "in real time, over UDP",
        "board_seconds": evaluation.seconds,
        "rest_seconds": evaluation.start_us * 1e-6,
        "machine": {"cores": os.cpu_count(), "load": _load(), "taxel": taxel.__version__},
        "neuron": evaluation.judged.to_dict(),
        "plain_rule": evaluation.judged_plain.to_dict(),
        "detections": len(evaluation.detections),
        "events": len(evaluation.events),
        "events_per_s": events_per_s,
        "wire_bits_per_s": _EVENT_BITS * events_per_s,
        "noise": {
            "clock": "none",
            "seconds": quiet.seconds,
            "events_per_s": len(quiet.events) / quiet.seconds,
            "said": quiet.judged.false_counts,
            "plain_rule_said": quiet.judged_plain.false_counts,
        },
        **(
            {"verdicts": [], "host": None, "board": None, "recording": None, "recording_agrees": None}
            if playing is None
            else {
                "verdicts": playing.verdicts,
                "host": playing.counters,
                "board": playing.emulator,
                "recording": playing.recording.name,
                "recording_agrees": playing.agrees,
            }
        ),
    }


def write(folder: Path, values: Mapping[str, Any], evaluation: Evaluation) -> Path:
    """Write report.json and report.html into a folder that is there; return the page's path."""
    page = folder / "report.html"
    text = render(
        "demo/report.html.j2",
        values=values,
        pictures=_pictures(evaluation),
        tables={"neuron": lines(evaluation.judged), "plain": lines(evaluation.judged_plain)},
        delays=delays,
        written=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
    )
    for path, content in ((folder / "report.json", json.dumps(values, indent=1) + "\n"), (page, text)):
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(content)
    return page


def _pictures(evaluation: Evaluation) -> dict[str, Markup]:
    """Draw the first scene: the ball's first impact, what follows until the next scene, and the taxels around it."""
    impacts = [contact for contact in evaluation.contacts if contact.kind == "first"]
    if not impacts:
        return {}
    first = impacts[0]
    end = impacts[1].start_us if len(impacts) > 1 else np.inf
    last = max(contact.stop_us for contact in evaluation.contacts if contact.start_us < end)
    with mpl.rc_context(STYLE):
        drawn = {
            "scene": pictures.scene_picture(evaluation, first.start_us - 60_000.0, last + 60_000.0),
            "close_up": pictures.close_up(evaluation, first),
            "maps": pictures.maps(evaluation, first),
        }
        shown = {name: picture(figure) for name, figure in drawn.items()}
        for figure in drawn.values():
            plt.close(figure)
    return shown


def lines(judged: TouchMatches) -> list[dict[str, str]]:
    """Return the rows of a table, as text: the touches of each class, how many were found, and how soon."""
    table = []
    for row in judged.rows:
        if not row.touches:
            continue
        error, known = "–", ["–", "–"]
        if row.found:
            error = f"{row.errors_ms.mean():+.2f}" + (f" ± {row.errors_ms.std(ddof=1):.2f}" if row.found > 1 else "")
            known = [f"{np.percentile(row.delays_ms, q):.2f}" for q in (50, 95)]
        table.append(
            {
                "touch": row.name,
                "label": row.label,
                "found": f"{row.found} of {row.touches}",
                "error": error,
                "p50": known[0],
                "p95": known[1],
                "missed": "missed" if row.found < row.touches else "",
            }
        )
    return table
