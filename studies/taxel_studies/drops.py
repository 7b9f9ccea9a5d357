"""Figures 5.10 and 5.14: a ball dropped on the array, and the data rate of its events beside that of frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.spikes import to_ms
from taxel.wire import FRAME_US
from taxel_studies import dropped
from taxel_studies.dropped import FRAMES, REGION, Condition
from taxel_studies.study import Judgement, Kept, Parameters, Row, Summary, Task, subplots

WHERE = "thesis 5.6.2 and 5.7, figures 5.10 and 5.14"
PROTOCOL = (
    "Spheres of 5 and 7 cm and 36 g (within 1 g) fall from 10, 15 and 20 cm on the emulated board at 5208 frames/s "
    "under 10 mm of foam (what it is else, the study foam finds), 100 times each, without a rest between drops; "
    f"{REGION} x {REGION} taxels around those that answered first, {FRAMES} frames. Their mean place is the region's "
    "middle, as in the thesis, so a taxel of noise among them moves it: by more than 1.5 taxels in some 2 % of the "
    "drops. One board: the same taxels in all drops, each drop with its own noise. "
    "By guess, heights vary by 2 mm and places by 5 mm (standard deviations), as drops are by hand. The sensor is "
    "tilted by 0, 15 or 30 degrees, always the same way: the ball meets it by v cos(slant), keeps the rest of its "
    "speed, and friction (0.6 of the force, a guess) makes it roll. The foam is a layer bonded to the board."
)

PARAMETERS: dict[str, Any] = {**dropped.TABLE, "drawn": [50.0, 100.0, 0.0], "seed": 1}
SIZES = {"toy": {**dropped.TOY, "drawn": [50.0, 100.0, 0.0]}}
#: Bits of an event (address and sign), of a taxel's intensity, and of its change, in 5.7's three codes.
EVENT_BITS, INTENSITY_BITS, CHANGE_BITS = 9, 10, 2
#: The largest rate of events in 5.7, kbit/s, and how much less it is than that of intensities.
PRINTED_KBIT_S, PRINTED_LESS = 659.0, 20.0
#: The readings of an impact's duration, and their names in the results: the first is that of 5.7.
COUNTED = {
    "time of contact": ("contact_events", "contact_ms"),
    "time from the first to the last event of 50 ms": ("events", "lasted_ms"),
}
#: Times at which figure 5.10's pictures end, ms.
PICTURES_MS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


shared = dropped.shared


def tasks(p: Parameters) -> list[Task]:
    """List one realisation a condition."""
    return [Task({**p, "condition": list(one)}) for one in dropped.conditions(p)]


def realise(params: dict[str, Any], _seed: int, kept: Kept) -> dict[str, Any]:
    """Drop a ball so many times, and count."""
    drops = dropped.played(params, Condition(*params["condition"]), kept)
    return {
        "events": drops.events.tolist(),
        "lasted_ms": to_ms(drops.lasted_us).round(3).tolist(),
        "contact_events": drops.contact_events.tolist(),
        "contact_ms": to_ms(drops.contact_us).round(3).tolist(),
    }


def summarise(p: Parameters, rows: Sequence[Row], kept: Kept) -> Summary:
    """Return each drop's data rate, and the events of one."""
    shown = dropped.played(p, Condition(*p["drawn"]), kept)
    spikes = dropped.sampled(shown.ticks[:1], to_ms(FRAME_US), np.zeros(1))[0]
    sample, sign, taxel = np.nonzero(spikes)
    counted = {}
    for reading, (count, time) in COUNTED.items():
        events, lasted = (np.array([v for row in rows for v in row.result[name]]) for name in (count, time))
        counted[reading] = {
            "rates_kbit_s": (EVENT_BITS * events / lasted).round(2).tolist(),
            "events": [int(events.min()), float(np.median(events)), int(events.max())],
            "lasted_ms": round(float(np.median(lasted)), 3),
        }
    return {
        "counted": counted,
        "one": {
            "t_ms": (to_ms(FRAME_US) * sample).round(3).tolist(),
            "taxel": taxel.tolist(),
            "rise": (sign == 0).astype(int).tolist(),
        },
    }


def _frames_kbit_s(bits: int) -> float:
    return bits * REGION**2 / to_ms(FRAME_US)


def judge(_p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 5.7 says."""
    intensity, change = _frames_kbit_s(INTENSITY_BITS), _frames_kbit_s(CHANGE_BITS)
    for reading, of in summary["counted"].items():
        rates, (low, middle, high) = np.array(of["rates_kbit_s"]), of["events"]
        yield Judgement(
            42,
            f"at most {rates.max():.0f} kbit/s, median {np.median(rates):.0f}; {change / 1000:.2f} and "
            f"{intensity / 1000:.1f} Mbit/s",
            bool(rates.max() <= PRINTED_KBIT_S),
            f"{len(rates)} drops of {low} to {high} events (median {middle:g}) in {of['lasted_ms']:.0f} ms (median)",
            reading,
        )
        yield Judgement(
            43,
            f"{intensity / rates.max():.0f} times at that drop, {intensity / np.median(rates):.0f} at the median; "
            f"{change / rates.max():.1f} times less than frames of change",
            bool(intensity / rates.max() >= PRINTED_LESS),
            f"{EVENT_BITS} bits an event: no stamp is counted, as in the thesis; its highest rate is "
            f"{PRINTED_KBIT_S / rates.max():.1f} times ours, and ours was fitted to it",
            reading,
        )


def draw(p: Parameters, summary: Summary) -> list[Figure]:
    """Draw 5.10 (events of a drop by time) and 5.14 (rates)."""
    return [_draw_one(p, summary["one"]), _draw_rates(summary)]


def _draw_one(p: Parameters, one: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey=True).ravel()
    t, taxel, rise = (np.array(one[name]) for name in ("t_ms", "taxel", "rise"))
    for ax, begin, end in zip(axes, (0.0, *PICTURES_MS), PICTURES_MS, strict=False):
        here = (t >= begin) & (t < end)
        for wanted, colour in ((1, "C3"), (0, "C0")):
            mine = here & (rise == wanted)
            x, y = taxel[mine] % REGION, taxel[mine] // REGION
            # The later ones of several events of a taxel lie a little to the right and below.
            aside = 0.5 * (t[mine] - begin) / (end - begin) - 0.25
            ax.plot(x + aside, y + aside, ".", ms=3, color=colour)
        ax.set_title(f"{begin:g} to {end:g} ms: {int(here.sum())} events", fontsize="medium")
        ax.set_aspect("equal")
        ax.set(xlim=(-0.7, REGION - 0.3), ylim=(REGION - 0.3, -0.7))
    ball, height, slant = p["drawn"]
    figure.suptitle(
        f"figure 5.10: a {ball / 10:g} cm sphere from {height / 10:g} cm, {slant:g} degrees (red: rise, blue: fall)"
    )
    figure.supxlabel("taxel")
    figure.supylabel("taxel")
    return figure


def _draw_rates(summary: Summary) -> Figure:
    figure, ax = subplots(7, 3.5)
    rates = np.array(next(iter(summary["counted"].values()))["rates_kbit_s"])
    edges = np.geomspace(rates.min() * 0.9, rates.max() * 1.1, 25)
    ax.hist(rates, edges.tolist(), color="C0", label="events (EC)")
    ax.axvline(PRINTED_KBIT_S, color="C0", ls=":", label=f"largest in the thesis, {PRINTED_KBIT_S:g}")
    ax.axvline(_frames_kbit_s(CHANGE_BITS), color="C1", label="frames of change (FC)")
    ax.axvline(_frames_kbit_s(INTENSITY_BITS), color="C3", label="frames of intensity (FI)")
    ax.set_xscale("log")
    ax.set(xlabel="data rate, kbit/s", ylabel="drops", title=f"figure 5.14: {len(rates)} drops")
    ax.legend(fontsize="small")
    return figure
