"""Figure 5.7: bits of an indentation by sampling period and by bits an event (thesis 5.5.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.encode import FA1
from taxel_studies import indented
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, grid, logarithmic, subplots

WHERE = "thesis 5.5.2, figure 5.7"
PROTOCOL = (
    "As fig5.5, with Table 5.3's alpha; a spike's value is the change since the last one in units of theta_0 "
    "(5.7), towards zero, saturating at 2^bits - 1. When a spike is fired stays that of 5.4."
)

PARAMETERS: dict[str, Any] = {
    **indented.TABLE,
    "samples": 500,
    "periods_ms": [0.5, 1.0, 2.0, 5.0, 10.0, 20.0],
    "event_bits": [1, 2, 4, 6, 8, 10],
    "alpha": 0.7,
    "seed": 1,
}
TOY: dict[str, Any] = {**indented.TOY, "samples": 12, "periods_ms": [10.0, 20.0], "event_bits": [1, 4]}
SIZES = {"coarse": {**indented.COARSE, "samples": 100}, "toy": TOY}


shared = indented.shared
tasks = partial(grid, period_ms="periods_ms", event_bits="event_bits")


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Sample all contacts, and return the bits of discriminants on spikes with so many bits."""
    contacts = indented.contacts(params, kept)
    settings = {"alpha": params["alpha"], "range": contacts.range_kpa, "period_ms": params["period_ms"]}
    _, sums = indented.sampled(contacts, FA1(**settings, bits=params["event_bits"]), params)
    return indented.bits_of(sums, params["samples"]) | {"conditions": len(contacts.conditions)}


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List the bits by period and bits an event."""
    bits = {(row.params["period_ms"], row.params["event_bits"]): row.result["bits"] for row in rows}
    periods = sorted(p["periods_ms"])
    return {
        "periods_ms": periods,
        "lines": [{"event_bits": b, "bits": [bits[period, b] for period in periods]} for b in p["event_bits"]],
        "conditions": rows[-1].result["conditions"],
    }


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 5.5.2 says."""
    by = {line["event_bits"]: dict(zip(summary["periods_ms"], line["bits"], strict=True)) for line in summary["lines"]}
    few, many = min(by), max(by)
    short, long = summary["periods_ms"][0], summary["periods_ms"][-1]
    of_each = f"{p['samples']} samples each, alpha {p['alpha']:g}, mesh {p['mesh_mm']:g} mm"
    size = f"{summary['conditions']} conditions, {of_each}"
    gain = {period: by[many][period] - by[few][period] for period in (short, long)}
    yield Judgement(
        32,
        "; ".join(f"{period:g} ms: {bits:+.2f} bits" for period, bits in gain.items())
        + f" from {few} to {many} bits an event",
        bool(gain[long] > 0 and gain[long] > gain[short]),
        size,
    )
    if {1, 10} <= set(by) and {2.0, 20.0} <= set(summary["periods_ms"]):
        slow, quick = by[10][20.0], by[1][2.0]
        much = f"much: by half a bit or more; {size}"
        yield Judgement(33, f"{slow:.2f} against {quick:.2f} bits", bool(slow < quick - 0.5), much)


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw 5.7: a line a number of bits."""
    figure, ax = subplots(6, 4)
    for line in summary["lines"]:
        ax.plot(
            summary["periods_ms"], line["bits"], ".-", label=f"{line['event_bits']} bit{'s' * (line['event_bits'] > 1)}"
        )
    ax.axhline(np.log2(summary["conditions"]), color="0.6", ls=":")
    logarithmic(ax, x=summary["periods_ms"])
    ax.set(xlabel="sampling period, ms", ylabel="bits")
    ax.legend(title="an event", fontsize="small")
    return figure
