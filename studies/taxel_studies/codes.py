"""The bits of four codes of the same spikes: rate, first-spike latency, relative latency, rank order (thesis 2.3.2).

Balls of several radii fall from several heights on one place of the emulated board, its taxels and the ball's place
drawn anew each time; FA-1 afferents under the impact fire; each code reads the same spikes, and linear discriminants
name ball and height from the code. The reference time is the moment of contact, and in a second comparison jitters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.encode import FA1
from taxel.frames import Frames
from taxel.simulate import Act, Scene, Silence, play, truth
from taxel.spikes import SpikeTrains
from taxel.tare import Tare
from taxel_studies import spike_codes
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary, logarithmic

WHERE = "thesis 2.3.2, figure 2.7, which compares them in words"
PROTOCOL = (
    "Balls of three radii from three heights, 30 drops each, foam and taxels drawn; place within a taxel of "
    "the middle. FA-1 (Table 5.3) on the 20 x 20 taxels there, one sample a frame of 192 us, ON and OFF trains. Each "
    "code reads the same spikes for so long after the reference, in steps of a frame; linear discriminants, 10 folds; "
    "bits of the confusion matrix, corrected, with 95 % intervals over trials."
)

PARAMETERS: dict[str, Any] = {
    "radii_mm": [25.0, 30.0, 35.0],
    "drops_mm": [100.0, 150.0, 200.0],
    "trials": 30,
    "windows_ms": [1.0, 2.0, 3.0, 5.0, 10.0, 20.0],
    "slip_ms": 1.0,
    "seed": 1,
}
SIZES = {"toy": {"trials": 3, "drops_mm": [100.0, 200.0], "radii_mm": [25.0, 35.0], "windows_ms": [2.0, 10.0]}}

#: Taxels along a side of the region under the impact, and the period of the afferents: whole frames of 192 us.
SIDE = 20
PERIOD_US = 192
NAMES = {
    "rate": "rate",
    "first": "first-spike latency",
    "relative": "relative latency",
    "rank": "rank order",
}


def codes(window_ms: float) -> dict[str, spike_codes.Code]:
    """Return the four codes over a window."""
    resolution = PERIOD_US * 1e-3
    return {
        # At most one spike falls into a frame.
        "rate": spike_codes.RateCode(window_ms=window_ms, most_hz=1e6 / PERIOD_US),
        "first": spike_codes.FirstSpikeLatency(window_ms=window_ms, resolution_ms=resolution),
        "relative": spike_codes.RelativeLatency(window_ms=window_ms, resolution_ms=resolution),
        "rank": spike_codes.RankOrder(window_ms=window_ms, resolution_ms=resolution),
    }


def drop_tasks(p: Parameters, *, apart: int = 100, **shared: Any) -> list[Task]:
    """List one drop a task; the seeds of two kinds of drop lie this far apart, or a multiple of it."""
    shared |= {"listen_ms": max(p["windows_ms"])}
    return [
        Task({**shared, "radius_mm": r, "drop_mm": d}, 10_000 * p["seed"] + apart * (3 * i + j) + k)
        for i, r in enumerate(p["radii_mm"])
        for j, d in enumerate(p["drops_mm"])
        for k in range(p["trials"])
    ]


def kinds_of(rows: Sequence[Row]) -> list[str]:
    """Return the kind of drop of each realisation: which ball, from which height."""
    return [f"{r.params['radius_mm']:g} mm from {r.params['drop_mm']:g} mm" for r in rows]


tasks = drop_tasks


def drop(radius_mm: float, drop_mm: float, listen_ms: float, seed: int) -> tuple[Frames, float]:
    """Return what the taxels under an impact read above rest, a frame each 192 us, and when the ball touches, us.

    Frames begin before contact, so that afferents have settled.
    """
    random = np.random.default_rng([seed, 232])
    x, y = (32 * 2.67 + random.uniform(-2.67, 2.67, 2)).tolist()
    ball: dict[str, Any] = {"shape": {"sphere": {"radius_mm": radius_mm}}, "x_mm": x, "y_mm": y}
    scene = Scene.draw(seed).body(**ball, motion={"dropped": {"height_mm": drop_mm}})
    acts: list[Act] = [Silence(60.0), scene]
    contact = truth(acts)[0][0].start_us
    events = play(acts, seed=seed).events
    tare = Tare.take(events, stop_us=events.markers[0][0])
    start = int(contact) - 50 * PERIOD_US
    stop = int(contact + 1000.0 * (listen_ms + 2.0))
    frames = tare.off(Frames.from_events(events, PERIOD_US, start, stop))
    middle = 32 - SIDE // 2
    return frames.region(slice(middle, middle + SIDE), slice(middle, middle + SIDE)), contact


def since_contact(trains: SpikeTrains, contact_us: float, listen_ms: float) -> list[list[float]]:
    """Return the times of each train's spikes within so long after contact, ms."""
    since = [times - contact_us * 1e-3 for times in trains]
    return [[round(float(t), 4) for t in times[(times >= 0) & (times < listen_ms)]] for times in since]


def realise(params: dict[str, Any], seed: int) -> list[list[float]]:
    """Return the times of each train's spikes since contact, ms: ON trains of the taxels, then OFF ones."""
    frames, contact = drop(params["radius_mm"], params["drop_mm"], params["listen_ms"], seed)
    trains = FA1(period_ms=PERIOD_US * 1e-3).encode(frames).split_by_sign()
    return since_contact(trains, contact, params["listen_ms"])


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Estimate the bits of each code by window, with the reference at contact and with one that jitters."""
    labels = kinds_of(rows)
    slips = np.random.default_rng(p["seed"]).uniform(0.0, p["slip_ms"], len(rows))
    folds = min(10, p["trials"])
    summary: Summary = {"most": float(np.log2(len(set(labels)))), "spikes": {}, "bits": {}, "slipped": {}}
    longest = max(p["windows_ms"]) + p["slip_ms"]
    trials = [SpikeTrains.from_lists(row.result, start=-p["slip_ms"], stop=longest) for row in rows]
    for window in p["windows_ms"]:
        every = codes(window)
        for name, onsets in (("bits", np.zeros(len(rows))), ("slipped", -slips)):
            estimates = spike_codes.compare_codes(trials, labels, every, onsets_ms=onsets, folds=folds, seed=p["seed"])
            summary[name][f"{window:g}"] = {code: [one.bits, *one.interval] for code, one in estimates.items()}
        counted = np.mean([[np.count_nonzero(np.asarray(t) < window) for t in row.result] for row in rows])
        summary["spikes"][f"{window:g}"] = float(counted)
    return summary


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Judge what 2.3.2 says of the codes."""
    early, late = (f"{w:g}" for w in (min(p["windows_ms"]), max(p["windows_ms"])))

    def bits(kind: str, window: str, code: str) -> float:
        return float(summary[kind][window][code][0])

    whole = {code: bits("bits", late, code) for code in NAMES}
    best = max(("first", "relative", "rank"), key=whole.__getitem__)
    half = {
        code: next((float(w) for w in summary["bits"] if bits("bits", w, code) >= summary["most"] / 2), float("inf"))
        for code in NAMES
    }
    lost = {code: bits("bits", early, code) - bits("slipped", early, code) for code in NAMES}
    return [
        Statement(
            "Temporal codes carry more information than a rate code.",
            "a clear advantage",
            f"{late} ms: {NAMES[best]} {whole[best]:.2f}, rate {whole['rate']:.2f} of {summary['most']:.2f} bits",
            whole[best] > whole["rate"],
            "what linear discriminants find of FA-1's spikes; a rate counts all of them, the others one a train",
        ),
        Statement(
            "Temporal codes tell sooner than a rate code, which needs several spikes a neuron.",
            "one spike is enough",
            "half of the bits after "
            + ", ".join(f"{half[code]:g} ms ({NAMES[code]})" for code in NAMES)
            + f"; {summary['spikes'][early]:.2f} spikes a train in the first {early} ms",
            min(half[code] for code in ("first", "relative", "rank")) < half["rate"],
            "hardly a train fires twice so soon: a count then says which trains fired at all: it has as many bits",
        ),
        Statement(
            "First-spike latency needs a reliable reference; relative codes need none.",
            "onset may not be available",
            f"a reference that slips by up to {p['slip_ms']:g} ms takes {lost['first']:.2f} bits from first-spike "
            f"latency in {early} ms, and {lost['relative']:.2f} from relative latency",
            bits("slipped", early, "relative") >= bits("slipped", early, "first"),
        ),
    ]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw bits by window, with the reference at contact, and with one that jitters."""
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    titles = ("reference: the moment of contact", f"reference: up to {p['slip_ms']:g} ms early")
    for axes, kind, title in ((left, "bits", titles[0]), (right, "slipped", titles[1])):
        windows = [float(w) for w in summary[kind]]
        for code, name in NAMES.items():
            values = np.array([summary[kind][w][code] for w in summary[kind]])
            ends = [values[:, 0] - values[:, 1], values[:, 2] - values[:, 0]]
            axes.errorbar(windows, values[:, 0], ends, marker="o", markersize=4, capsize=2, label=name)
        axes.axhline(summary["most"], color="0.7", linestyle=":")
        axes.set(xlabel="listened, ms", title=title)
        logarithmic(axes, x=windows)
        axes.legend()
    left.set_ylabel("bits")
    return figure
