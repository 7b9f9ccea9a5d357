"""One foam for all dropped balls, from three numbers that the thesis states of them (before 4.8 to 4.10, 5.10 to 5.14).

The search sees these numbers alone: no bit of information is computed in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel import SceneError
from taxel.spikes import to_ms
from taxel_studies import dropped
from taxel_studies.dropped import REGION, TENNIS
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, Task, grid, subplots

WHERE = "thesis 4.4.2, 5.6.4 and 5.7, before figures 4.8 and 5.10"
PROTOCOL = (
    "Free are the foam's modulus and losses, within makers' foams and what sends a ball back, and the stiffness of a "
    "tennis ball; its 10 mm are stated (4.3.1, 5.6.1). Held against the thesis: the pressure of a tennis ball from 40 "
    "cm falls below a tenth of its peak within the 8 ms of figure 4.8 (T949, an inference from a picture that is "
    "lost); of the spheres of 5.6.2 the contact is larger than 16 x 16 taxels (T1284), here of the kind with the "
    "smallest; the highest rate of events is 659 kbit/s, at 9 bits, over the time of contact (T1307, T1309). The foam "
    "with the least sum of squared relative residuals serves all drops; one that a ball crushes is none. "
    "Balls fall level."
)

PARAMETERS: dict[str, Any] = {
    "moduli_kpa": [20.0, 25.0, 30.0, 40.0, 60.0, 100.0],
    "dampings_s_m": [0.1, 0.25, 0.5],
    "dashpots_ms": [0.0, 1.0, 3.0],
    "balls_n_mm": [15.0, 25.0, 40.0],
    "drops": 2,
    "seed": 1,
}
SIZES = {"toy": {"moduli_kpa": [30.0, 60.0], "dampings_s_m": [0.25], "dashpots_ms": [1.0]}}
#: What is held against each, and its unit.
DECAY_MS, TAXELS, KBIT_S = 8.0, REGION**2, 659.0
#: Bits of an event in 5.7.
EVENT_BITS = 9


def tasks(p: Parameters) -> list[Task]:
    """List the foams."""
    return grid(p, modulus_kpa="moduli_kpa", damping_s_m="dampings_s_m", dashpot_ms="dashpots_ms")


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any] | None:
    """Drop spheres from least and greatest height, tennis balls of each stiffness; None on a foam that one crushes."""
    foam = {name: params[name] for name in ("modulus_kpa", "damping_s_m", "dashpot_ms")}
    shared = {"drops": params["drops"], "seed": params["seed"], "foam": foam}
    spheres = {**dropped.TABLE, **shared, "heights_mm": [100.0, 200.0], "slants_deg": [0.0]}
    tennis = {**dropped.TENNIS_TABLE, **shared, "slants_deg": [0.0]}
    try:
        played = [dropped.played(spheres, one, kept) for one in dropped.conditions(spheres)]
    except SceneError:
        return None
    rates = np.concatenate([EVENT_BITS * one.contact_events / to_ms(one.contact_us) for one in played])
    return {
        "taxels": round(min(float(one.contact_taxels.mean()) for one in played), 1),
        "kbit_s": round(float(rates.max()), 1),
        "decay_ms": [_decay({**tennis, "stiffness_n_mm": stiffness}, kept) for stiffness in params["balls_n_mm"]],
    }


def _decay(tennis: Mapping[str, Any], kept: Kept) -> float | None:
    """Return when the pressure of a ball from the least height, level, is below a tenth of its peak, ms (mean)."""
    try:
        gentlest, *_ = [dropped.played(tennis, one, kept, TENNIS) for one in dropped.conditions(tennis)]
    except SceneError:
        return None
    frame_ms = to_ms(TENNIS.frame_us)
    total = dropped.frames_of(gentlest.ticks, frame_ms, np.zeros(len(gentlest.ticks)), TENNIS, TENNIS.length_ms).sum(2)
    ends = [k + np.argmax(one[k:] < 0.1 * one[k]) for one, k in zip(total, total.argmax(1), strict=True)]
    return round(frame_ms * float(np.mean(ends)), 2)


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List each foam with each ball, the best first, and how many foams a ball crushes."""
    lines = []
    for row in rows:
        for stiffness, decay in zip(p["balls_n_mm"], row.result["decay_ms"], strict=True) if row.result else ():
            if decay is not None:
                foam = {name: row.params[name] for name in ("modulus_kpa", "damping_s_m", "dashpot_ms")}
                numbers = {"decay_ms": decay, "taxels": row.result["taxels"], "kbit_s": row.result["kbit_s"]}
                lines.append({**foam, "ball_n_mm": stiffness, **numbers, "residuals": residuals(numbers)})
    lines.sort(key=lambda line: float(np.hypot.reduce(line["residuals"])))
    return {"lines": lines, "crushed": sum(not row.result for row in rows)}


def residuals(numbers: Mapping[str, float]) -> list[float]:
    """Return by how much of each the decay is late, the contact small, and the rate off."""
    late = max(0.0, numbers["decay_ms"] / DECAY_MS - 1)
    small = max(0.0, 1 - numbers["taxels"] / TAXELS)
    return [round(late, 3), round(small, 3), round(abs(numbers["kbit_s"] / KBIT_S - 1), 3)]


def judge(_p: Parameters, _summary: Summary) -> Iterator[Judgement]:
    """Judge nothing: what is searched for is no test."""
    yield from ()


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw decay and rate of every foam and ball, the best one marked."""
    figure, ax = subplots(6, 4)
    lines = summary["lines"]
    shown = ax.scatter(
        [one["decay_ms"] for one in lines], [one["kbit_s"] for one in lines], c=[one["taxels"] for one in lines]
    )
    ax.plot(lines[0]["decay_ms"], lines[0]["kbit_s"], "o", ms=14, mfc="none", mec="C3", label="least residuals")
    ax.axvline(DECAY_MS, color="0.7")
    ax.axhline(KBIT_S, color="0.7")
    ax.set(xlabel="decay, ms", ylabel="highest rate, kbit/s")
    figure.colorbar(shown, label="taxels in contact")
    ax.legend(fontsize="small")
    return figure
