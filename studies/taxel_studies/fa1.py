"""Which properties of the FA-1 afferent are worth keeping (thesis 7.2): each taken away, in bits and in events.

Balls of five radii fall from three heights on the emulated board, taxels and foam drawn anew. FA-1 afferents with
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
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, listed, subplots

WHERE = "thesis 7.2, which asks it"
PROTOCOL = (
    "Balls of five radii from three heights, 30 drops each, foam and taxels drawn; place within a taxel of the "
    "middle. FA-1 (Table 5.3) on the 20 x 20 taxels there, one sample a frame of 192 us, thresholds spread by a "
    "factor with the log-sd given, drawn once. Taken away: the threshold's rise and decay (A and B 0), the sign of "
    "spikes, the power law (alpha 1), the spread. Discriminants on counts and, apart, on first-spike latencies, 10 "
    "folds; bits corrected, 95 % intervals over trials. Radii and windows were fixed before this was run: with three "
    "radii and up to 20 ms nothing but polarity could be told apart. One step of the board, 4 ticks or more, is above "
    "FA-1's threshold, a 1024th of 150 ticks, until some four spikes have raised it."
)

PARAMETERS: dict[str, Any] = {
    "radii_mm": [25.0, 27.5, 30.0, 32.5, 35.0],
    "drops_mm": [100.0, 150.0, 200.0],
    "trials": 30,
    "windows_ms": [1.0, 2.0, 5.0],
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
#: What discriminants read.
CODES = ("counts", "first spikes")
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
            known = {name: spike_codes.bits(code, labels, **options) for name, code in zip(CODES, codes, strict=True)}
            summary["bits"][without][f"{window:g}"] = {name: [one.bits, *one.interval] for name, one in known.items()}
            events = [sum(t < window for train in trial for t in train) for trial in trials]
            summary["events"][without][f"{window:g}"] = float(np.mean(events))
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Say of each property what it is worth, in each code and window."""
    windows = [f"{window:g}" for window in p["windows_ms"]]
    late, whole = windows[-1], summary["bits"]["all"]
    for without, name in list(VARIANTS.items())[1:]:
        lacking, parts, apart = summary["bits"][without], [], []
        for code in CODES:
            gains = [lacking[w][code][0] - whole[w][code][0] for w in windows]
            parts.append(f"{code}: {listed(gains, p['windows_ms'], '+.2f', '{:g} ms')}")
            # Of two intervals the higher one begins above the end of the other.
            apart += [
                f"{code} in {w} ms"
                for w in windows
                if max(lacking[w][code][1], whole[w][code][1]) > min(lacking[w][code][2], whole[w][code][2])
            ]
        cost = summary["events"][without][late] / max(summary["events"]["all"][late], 1e-9)
        most = ", ".join(f"{whole[late][code][0]:.2f} by {code}" for code in CODES)
        yield Judgement(
            109,
            f"bits gained without it: {'; '.join(parts)}; {cost:.2f} times the events",
            None,
            f"of {most} in {late} ms; intervals lie apart: {', '.join(apart) or 'nowhere'}",
            f"FA-1 without its {name}",
        )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw bits over events, a panel a code."""
    figure, panels = subplots(10, 4, 1, 2, sharey=True)
    for axes, code in zip(panels, CODES, strict=True):
        for without, name in VARIANTS.items():
            values = np.array([of[code] for of in summary["bits"][without].values()])
            ends = [values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]]
            events = list(summary["events"][without].values())
            label = "all properties" if without == "all" else f"without {name}"
            axes.errorbar(events, values[:, 0], ends, marker="o", markersize=4, capsize=2, label=label)
        axes.axhline(summary["most"], color="0.7", linestyle=":")
        axes.set(xscale="log", xlabel="events of a touch, in windows of rising length", ylabel="bits", title=code)
    panels[0].legend(loc="lower right")
    return figure
