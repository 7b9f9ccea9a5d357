"""The demo's report: a page with pictures, and the same figures as JSON."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np

import taxel
from taxel.demo import pictures
from taxel.demo.evaluation import Evaluation
from taxel.demo.judging import GOALS, LABELS, Judged, Row
from taxel.live import delays
from taxel.report.page import render
from taxel.report.svg import STYLE, picture
from taxel.spikes import to_ms, to_us
from taxel.wire import FRAME_US

__all__ = ["GUESSES", "Material", "figures", "write"]

#: Parameters of the simulation without a measurement, and which results depend on them.
GUESSES = (
    ("The foam's dashpot, 1 ms", "sets the delays: the rows at 0.3 ms and without it show how far"),
    ("The foam's modulus, 50 to 75 kPa, and its collapse", "set depth, length of contact and number of loaded taxels"),
    (
        "The ramp: an RC curve that ends at 3 V",
        "gives 4.5 ticks for 0.02 N; a ramp that reached 95 % of 5 V would give 1.35, below the noise floor",
    ),
    ("Noise of half a tick, floor of 3", "set the rate of events at rest and the weakest touch that is detected"),
    (
        "Taxels that differ: gain by a fifth, offset by 20 mV",
        "drift or stuck taxels, which are not simulated, would add errors",
    ),
    ("Force on a taxel to the power 0.7", "sets how readings grow with force; no curve of a manufacturer was found"),
    ("Friction of 0.6 of the force", "makes the ball roll on a slant"),
)


@dataclass
class Material:
    """Everything that a report shows."""

    seed: int
    scenes: int
    live: bool
    evaluation: Evaluation
    noise: Evaluation
    dashpots: dict[float, Evaluation]
    """By the dashpot's time, ms: the same scenes with another foam."""
    footfalls: Evaluation | None = None
    footfall_note: str = ""
    counters: dict[str, Any] | None = None
    """What the host counted while it ran."""
    emulator: dict[str, Any] | None = None
    """What the board counted."""
    verdicts: list[str] = field(default_factory=list)
    """One line each: losses, frames."""
    recording: str | None = None
    agrees: bool | None = None
    """Whether the recording, read again, gives the detections that were made live."""
    extra: dict[str, Any] = field(default_factory=dict)


def figures(material: Material) -> dict[str, Any]:
    """Return all figures of a report as plain values."""
    evaluation = material.evaluation
    noise_s = (material.noise.stop_us - material.noise.start_us) * 1e-6
    every = evaluation.events
    seconds = (evaluation.stop_us - evaluation.start_us) * 1e-6
    impacts = [
        1e6 * len(every.between(c.start_us - 500.0, c.stop_us + 1_000.0)) / (c.stop_us - c.start_us + 1_500.0)
        for c in evaluation.contacts
        if c.kind == "first"
    ]
    return {
        "what": "taxel demo",
        "seed": material.seed,
        "scenes": material.scenes,
        "clock": "in real time, over UDP"
        if material.live
        else "without the clock: board time as fast as it goes, no socket",
        "board_seconds": seconds,
        "machine": _machine(),
        "neuron": evaluation.judged.to_dict(),
        "plain_rule": evaluation.judged_plain.to_dict(),
        "delay_split_ms": _split(evaluation),
        "events": len(every),
        "events_per_s": len(every) / seconds,
        "events_per_s_in_first_impacts": _quantiles(impacts),
        "wire_bits_per_s": 80 * len(every) / seconds,
        "frames_bits_per_s": {
            "2 bits a taxel": 2 * 4096 * 1e6 / FRAME_US,
            "10 bits a taxel": 10 * 4096 * 1e6 / FRAME_US,
        },
        "noise": {
            "clock": "none",
            "seconds": noise_s,
            "events_per_s": len(material.noise.events) / noise_s,
            "said": {label: len(material.noise.detections[label]) for label in LABELS},
            "plain_rule_said": {label: len(material.noise.plain[label]) for label in LABELS},
        },
        "dashpot_ms": {f"{ms:g}": dashpot.judged.to_dict() for ms, dashpot in material.dashpots.items()},
        "footfalls": None
        if material.footfalls is None
        else {"note": material.footfall_note, **material.footfalls.judged.to_dict()},
        "host": material.counters,
        "board": material.emulator,
        "verdicts": material.verdicts,
        "recording": material.recording,
        "recording_agrees": material.agrees,
        "guesses": dict(GUESSES),
        **material.extra,
    }


def write(folder: Path, material: Material) -> Path:
    """Write report.json and report.html into a folder that is there; return the page's path."""
    values = figures(material)
    _new(folder / "report.json", json.dumps(values, indent=1) + "\n")
    page = folder / "report.html"
    _new(page, _page(material, values))
    return page


def _new(path: Path, text: str) -> None:
    with path.open("x", encoding="utf-8") as file:
        file.write(text)


def _page(material: Material, values: Mapping[str, Any]) -> str:
    evaluation = material.evaluation
    with mpl.rc_context(STYLE):
        figures_of = _figures(material, values)
        drawn = {name: picture(figure) for name, figure in figures_of.items()}
        for figure in figures_of.values():
            plt.close(figure)
    return render(
        "demo/report.html.j2",
        values=values,
        pictures=drawn,
        tables={
            "neuron": _table(evaluation.judged),
            "plain": _table(evaluation.judged_plain),
            "footfalls": None if material.footfalls is None else _table(material.footfalls.judged),
        },
        dashpots=_dashpots({1.0: evaluation, **material.dashpots}),
        goals=GOALS,
        firsts={label: evaluation.judged.row("first", label).touches for label in LABELS},
        detections=sum(len(evaluation.detections[label]) for label in LABELS),
        rest_s=evaluation.start_us * 1e-6,
        within={label: _share(evaluation.judged.within_goal(label)) for label in LABELS},
        guesses=GUESSES,
        losses=_losses(material),
        delays=delays,
        live=material.live,
        footfall_note=material.footfall_note,
        written=datetime.now().astimezone().strftime("%Y-%m-%d %H:%M %Z"),
    )


def _figures(material: Material, values: Mapping[str, Any]) -> dict[str, Any]:
    evaluation = material.evaluation
    drawn: dict[str, Any] = {"rates": pictures.rates(evaluation), "noise": pictures.noise(material.noise)}
    first = next((c for c in evaluation.contacts if c.kind == "first"), None)
    if first is not None:
        later = [c for c in evaluation.contacts if c.kind == "first" and c is not first]
        end = later[0].start_us if later else evaluation.stop_us
        hand = [c.stop_us for c in evaluation.contacts if c.start_us < end]
        drawn["scene"] = pictures.scene_picture(evaluation, first.start_us - 60_000.0, max(hand) + 60_000.0)
        drawn["close_up"] = pictures.close_up(evaluation, first)
        drawn["maps"] = pictures.maps(evaluation, first)
        drawn["delays"] = pictures.delays_by_class(evaluation.judged, evaluation.judged_plain)
    if values["delay_split_ms"]:
        drawn["split"] = pictures.delay_split(values["delay_split_ms"])
    return drawn


def _split(evaluation: Evaluation) -> dict[str, dict[str, float]]:
    """Return the medians of what a delay is made of, ms, for impacts: physics, kernel, frame, host.

    Physics: from the true moment to the start of the frame in which two neighbouring taxels first showed it (or fewer
    than two were left). Kernel: from there to the crossing. Frame: on to the end of the crossing's frame. Host: until
    the host reported it.
    """
    split = {}
    for row in evaluation.judged.rows:
        if row.name not in ("first impact", "bounce, 0.4 m/s and more") or not row.found:
            continue
        mine = evaluation.detections[row.label]
        delay = evaluation.readout.neurons[row.label].delay_ms
        parts = []
        for touch, place in row.places:
            contact = evaluation.contacts[touch]
            stamp = evaluation.first_input(contact, row.label)
            if stamp is None:
                continue
            true = contact.start_us if row.label == "contact" else contact.stop_us
            begin = np.ceil(stamp / FRAME_US) * FRAME_US
            crossing = mine.t[place] + to_us(delay)
            known = float(mine.known[place])
            host = float(mine.reported[place]) - known if mine.reported is not None else 0.0
            parts.append([begin - true, crossing - begin, known - crossing, host])
        if parts:
            medians = to_ms(np.median(np.array(parts), axis=0))
            split[f"{row.label}, {row.name}"] = dict(
                zip(("physics", "kernel", "frame", "host"), medians.tolist(), strict=True)
            )
    return split


def _losses(material: Material) -> list[tuple[str, int]]:
    """Return where something could be lost, and how much was: the sender's own count first."""
    if material.counters is None or material.emulator is None:
        return []
    capture, wire = material.counters["capture"], material.counters["wire"]
    return [
        ("datagrams that the board sent", material.emulator["datagrams"]),
        ("datagrams that arrived", capture["datagrams"]),
        ("messages dropped by the kernel", capture["dropped_by_kernel"]),
        ("datagrams dropped by the queue", capture["dropped_by_queue"]),
        ("changes dropped by the board's queue", material.emulator["dropped"]),
        ("bytes skipped", wire["skipped"]),
        ("words short, contradictory or outside", wire["short"] + wire["contradictory"] + wire["outside"]),
        ("intensities without their change", wire["unpaired"]),
        ("events, those of the tare among them", material.counters["events"]),
        ("events dropped before the readout", material.counters["events_dropped"]),
        ("events that came after the readout's time", material.counters["late"]),
    ]


def _table(judged: Judged) -> list[dict[str, str]]:
    return [_line(row) for row in judged.rows if row.touches]


def _line(row: Row) -> dict[str, str]:
    known = [f"{np.percentile(row.delays_ms, q):.2f}" if row.found else "–" for q in (50, 95)]
    errors = row.errors_ms
    error = (
        f"{errors.mean():+.2f} ± {errors.std(ddof=1):.2f}" if len(errors) > 1 else "".join(f"{e:+.2f}" for e in errors)
    )
    return {
        "name": row.name,
        "label": row.label,
        "found": f"{row.found} of {row.touches}",
        "error": error or "–",
        "p50": known[0],
        "p95": known[1],
        "missed": "missed" if row.found < row.touches else "",
    }


def _dashpots(by_ms: Mapping[float, Evaluation]) -> list[dict[str, str]]:
    lines = []
    for ms, evaluation in by_ms.items():
        line = {"dashpot": f"{ms:g} ms" if ms else "none"}
        for label in LABELS:
            row = evaluation.judged.row("first", label)
            line[label] = _line(row)["p50"] + " / " + _line(row)["p95"]
            line[f"{label}_within"] = _share(evaluation.judged.within_goal(label))
        line["found"] = ", ".join(
            f"{sum(r.found for r in evaluation.judged.rows if r.label == label and _fast(r))} of "
            f"{sum(r.touches for r in evaluation.judged.rows if r.label == label and _fast(r))}"
            for label in LABELS
        )
        lines.append(line)
    return lines


def _fast(row: Row) -> bool:
    return row.name in ("first impact", "bounce, 0.4 m/s and more")


def _share(value: float) -> str:
    return "–" if np.isnan(value) else f"{100 * value:.1f} %"


def _quantiles(values: list[float]) -> dict[str, float] | None:
    if not values:
        return None
    return {"least": min(values), "median": float(np.median(values)), "most": max(values)}


def _machine() -> dict[str, Any]:
    """Return the machine and the versions on which measured times depend."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [
            line.split(":", 1)[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")
        ]
        name = names[0] if names else name
    return {
        "cpu": name,
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
        "taxel": taxel.__version__,
    }
