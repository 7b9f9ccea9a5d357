"""Which properties of the FA-1 afferent are worth keeping (thesis 7.2): each taken away, in bits and in events.

Balls of three radii fall from three heights on the emulated board, taxels and foam drawn anew. FA-1 afferents with
everything: adapting threshold, polarity, power law, and a spread of their thresholds. Then each of these is taken away.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.encode import FA1
from taxel.frames import Frames
from taxel.spikes import SpikeTrains
from taxel_studies import spike_codes
from taxel_studies.spike_codes import PERIOD_US, SIDE, drop, drop_tasks, kinds_of, since_contact
from taxel_studies.study import Judgement, Parameters, Row, Summary, Table, Task, subplots

WHERE = "thesis 7.2, which asks it"
PROTOCOL = (
    "Balls of three radii from three heights, 30 drops each, foam and taxels drawn; place within a taxel of the "
    "middle. FA-1 (Table 5.3) on the 20 x 20 taxels there, one sample a frame of 192 us, thresholds spread by a "
    "factor with the log-sd given, drawn once. Taken away: the threshold's rise and decay (A and B 0), the sign of "
    "spikes, the power law (alpha 1), the spread. Discriminants on counts and on first-spike latencies, 10 folds; the "
    "more telling of the two; bits corrected, 95 % intervals over trials."
)

PARAMETERS: dict[str, Any] = {
    "radii_mm": [25.0, 30.0, 35.0],
    "drops_mm": [100.0, 150.0, 200.0],
    "trials": 30,
    "windows_ms": [2.0, 5.0, 20.0],
    "spread": 0.3,
    "seed": 1,
}
SIZES = {
    "quick": {"trials": 10},
    "toy": {"trials": 3, "drops_mm": [100.0, 200.0], "radii_mm": [25.0, 35.0], "windows_ms": [5.0]},
}

#: What is taken away, in the words of the page.
VARIANTS = {
    "all": "nothing",
    "threshold": "adapting threshold",
    "polarity": "polarity",
    "power": "power law",
    "spread": "spread of thresholds",
}
#: Seed of the spread of thresholds, the same in all trials.
SKIN = 52


def spikes(frames: Frames, without: str, spread: float) -> SpikeTrains:
    """Return the spikes of the afferents without one of their properties; ON and OFF apart where they have polarity.

    A threshold that is g times as high is the same as a pressure g^(1/alpha) times as low, and so it is drawn.
    """
    drawn = np.random.default_rng(SKIN).normal(0.0, spread, (SIDE, SIDE))
    alpha = 1.0 if without == "power" else FA1().alpha
    gain = np.ones((SIDE, SIDE)) if without == "spread" else np.exp(-drawn / alpha)
    scaled = Frames((frames.values * gain).astype(np.float32), frames.t, unit=frames.unit)
    a, b = (0.0, 0.0) if without == "threshold" else (FA1().a, FA1().b)
    trains = FA1(alpha=alpha, a=a, b=b, period_ms=PERIOD_US * 1e-3).encode(scaled)
    if without != "polarity":
        return trains.split_by_sign()
    return SpikeTrains.from_lists(list(trains), start=trains.start, stop=trains.stop)


def tasks(p: Parameters) -> list[Task]:
    """List one drop a task."""
    return drop_tasks(p, spread=p["spread"])


def realise(params: dict[str, Any], seed: int) -> dict[str, list[list[float]]]:
    """Return the times of each train's spikes since contact by what was taken away, ms."""
    frames, contact = drop(params["radius_mm"], params["drop_mm"], params["listen_ms"], seed)
    return {
        without: since_contact(spikes(frames, without, params["spread"]), contact, params["listen_ms"])
        for without in VARIANTS
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Estimate bits and count events by what was taken away and by window."""
    labels = kinds_of(rows)
    options, period_ms = {"folds": min(10, p["trials"]), "seed": p["seed"]}, PERIOD_US * 1e-3
    summary: Summary = {"most": float(np.log2(len(set(labels)))), "bits": {}, "events": {}}
    for without in VARIANTS:
        trials = [row.result[without] for row in rows]
        # Latencies are told apart by the period; 1e-9 keeps whole numbers of it in their step.
        first_ms = period_ms * np.floor(spike_codes.firsts(trials) / period_ms + 1e-9)
        summary["bits"][without], summary["events"][without] = {}, {}
        for window in p["windows_ms"]:
            codes = spike_codes.rate(trials, window, 1e6 / PERIOD_US), spike_codes.latency(first_ms, window)
            best = max((spike_codes.bits(code, labels, **options) for code in codes), key=lambda one: one.bits)
            summary["bits"][without][f"{window:g}"] = [best.bits, *best.interval]
            events = [sum(t < window for train in trial for t in train) for trial in trials]
            summary["events"][without][f"{window:g}"] = float(np.mean(events))
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Say of each property what it is worth at the longest window."""
    late = f"{max(p['windows_ms']):g}"
    whole, bottom, top = summary["bits"]["all"][late]
    events = summary["events"]["all"][late]
    for without, name in list(VARIANTS.items())[1:]:
        bits, low, high = summary["bits"][without][late]
        cost = summary["events"][without][late] / max(events, 1e-9)
        yield Judgement(
            109,
            f"{bits - whole:+.2f} bits of {whole:.2f} and {cost:.2f} times the events, {late} ms",
            None,
            ("intervals lie apart" if high < bottom or low > top else "intervals overlap")
            + "; of two codes, counts and first spikes, the one with more bits",
            f"FA-1 without its {name}",
        )


def tables(_p: Parameters, summary: Summary) -> Iterator[Table]:
    """List bits, events and bits an event by window."""
    rows = []
    for without, name in VARIANTS.items():
        cells = []
        for window, (bits, low, high) in summary["bits"][without].items():
            events = summary["events"][without][window]
            cells += [f"{bits:.2f} ({low:.2f} to {high:.2f})", f"{events:.0f}"]
        rows.append([name, *cells])
    head = ["taken away"]
    for window in summary["bits"]["all"]:
        head += [f"bits in {window} ms", "events"]
    yield Table("what each property of FA-1 is worth", head, rows, f"of {summary['most']:.2f} bits; 95 % intervals")


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw bits over events."""
    figure, axes = subplots(6.5, 4)
    for without, name in VARIANTS.items():
        values = np.array(list(summary["bits"][without].values()))
        ends = [values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]]
        events = list(summary["events"][without].values())
        label = "all properties" if without == "all" else f"without {name}"
        axes.errorbar(events, values[:, 0], ends, marker="o", markersize=4, capsize=2, label=label)
    axes.axhline(summary["most"], color="0.7", linestyle=":")
    axes.set(xscale="log", xlabel="events of a touch, in windows of rising length", ylabel="bits")
    axes.legend(loc="lower right")
    return figure
