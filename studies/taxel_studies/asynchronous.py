"""The scanned array beside one whose taxels compare by themselves: bits of a touch, and what they cost (Table 7.1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.events import Events
from taxel.simulate import Act, Scene, Silence, play, truth
from taxel.spikes import to_ms
from taxel_studies.spike_codes import bits, drop_tasks, firsts, kinds_of, latency, relative_latency
from taxel_studies.study import Judgement, Parameters, Row, Summary, Task, logarithmic, subplots

WHERE = "thesis 4.5, 7.2 and Table 7.1"
PROTOCOL = (
    "Balls of three radii fall from three heights, 30 times each, on the emulated board, its taxels and the ball's "
    "place drawn anew each time; once its lines are scanned at 5208 frames/s, once each taxel compares by itself "
    "with what it sent last and stamps are of 1 us. Who listens takes each taxel's first rise after contact; linear"
    " discriminants name ball and height from these latencies. Between two frames of the simulation a taxel's "
    "reading lies on a straight line, noise and all: a comparator's own faster noise is not simulated."
)

PARAMETERS: dict[str, Any] = {
    "radii_mm": [25.0, 30.0, 35.0],
    "drops_mm": [100.0, 150.0, 200.0],
    "trials": 30,
    "windows_ms": [0.4, 0.7, 1.0, 2.0, 5.0],
    "preset": "5.2 kHz",
    "place_mm": 2.67,
    "seed": 1,
}
SIZES = {"toy": {"radii_mm": [25.0, 35.0], "drops_mm": [200.0], "trials": 6, "windows_ms": [0.7, 2.0]}}
#: Taxels along a side of the region under the impact; bits of the address (64 x 64) and sign of an event.
SIDE, EVENT_BITS = 20, 13
#: Silence before a scene, ms. The board is not tared, since only changes count.
BEFORE_MS = 5.0
ARRAYS = ("scanned", "asynchronous")


def tasks(p: Parameters) -> list[Task]:
    """List one drop a task."""
    return drop_tasks(p, apart=1000, preset=p["preset"], place_mm=p["place_mm"])


def first_rises(events: Events, contact_us: float, listen_ms: float) -> list[list[float]]:
    """Return when each taxel under the impact first sent a rise after contact, ms; taxels by their index there."""
    low = events.array.columns // 2 - SIDE // 2
    x, y = events.x.astype(int) - low, events.y.astype(int) - low
    since = to_ms(events.t - contact_us)
    # The stamp of a frame is its beginning, which may lie before the contact that the frame shows.
    inside = events.p & (x >= 0) & (x < SIDE) & (y >= 0) & (y < SIDE) & (since > -0.5) & (since < listen_ms)
    first = np.full(SIDE * SIDE, np.inf)
    np.minimum.at(first, SIDE * y[inside] + x[inside], np.maximum(since[inside], 0.0))
    return [[round(float(t), 6)] if np.isfinite(t) else [] for t in first]


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Drop a ball on one board that scans and on one that does not; return first rises, events and bytes."""
    random = np.random.default_rng([seed, 71])
    x, y = (32 * 2.67 + random.uniform(-params["place_mm"], params["place_mm"], 2)).tolist()
    ball: dict[str, Any] = {"shape": {"sphere": {"radius_mm": params["radius_mm"]}}, "x_mm": x, "y_mm": y}
    scene = Scene.draw(seed).body(**ball, motion={"dropped": {"height_mm": params["drop_mm"]}})
    acts: list[Act] = [Silence(BEFORE_MS), scene]
    contacts = truth(acts, preset=params["preset"])[0]
    contact, lasted = contacts[0].start_us, sum(c.stop_us - c.start_us for c in contacts)
    result: dict[str, Any] = {"touched_ms": to_ms(lasted)}
    for array in ARRAYS:
        board: dict[str, Any] = {
            "seed": seed,
            "preset": params["preset"],
            "tare_ms": 0.0,
            "wire": 2,
            "asynchronous": array == "asynchronous",
        }
        played = play(acts, **board)
        length_us = played.events.markers[-1][0]
        # The bytes of the same board untouched for as long: noise, headers and promises.
        rest = play([Silence(to_ms(length_us))], **board).bytes
        touched = np.zeros(len(played.events), bool)
        for c in contacts:
            touched |= (played.events.t >= c.start_us - 200) & (played.events.t < c.stop_us + 1000)
        result[array] = {
            "first_ms": first_rises(played.events, contact, params["listen_ms"]),
            "events": int(touched.sum()),
            "rest_kbit_s": 8e3 * rest / length_us,
            "touched_kbit_s": 8e3 * (rest / length_us + (played.bytes - rest) / lasted),
        }
    return result


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Estimate the bits of first-spike and relative latencies by window, and the costs of both arrays."""
    labels = kinds_of(rows)
    summary: Summary = {"most": float(np.log2(len(set(labels)))), "bits": {}, "costs": {}}
    for array in ARRAYS:
        first_ms = firsts([r.result[array]["first_ms"] for r in rows])
        summary["bits"][array] = {f"{window:g}": {} for window in p["windows_ms"]}
        for window in p["windows_ms"]:
            for name, code in (("first", latency), ("relative", relative_latency)):
                one = bits(code(first_ms, window), labels, folds=min(10, p["trials"]), seed=p["seed"])
                summary["bits"][array][f"{window:g}"][name] = [one.bits, *one.interval]
        results = [r.result[array] for r in rows]
        touched_s = np.array([1e-3 * r.result["touched_ms"] for r in rows])
        events = np.array([one["events"] for one in results])
        moments = [len({t for train in one["first_ms"] for t in train}) for one in results]
        summary["costs"][array] = {
            "events": float(np.median(events)),
            "events_a_s": float(np.median(events / touched_s)),
            "address_kbit_s": float(np.median(1e-3 * EVENT_BITS * events / touched_s)),
            **{name: float(np.median([one[name] for one in results])) for name in ("rest_kbit_s", "touched_kbit_s")},
            "moments": float(np.median(moments)),
        }
    return summary


def judge(p: Parameters, summary: Summary) -> Iterator[Judgement]:
    """Judge what 4.5 and Table 7.1 expect of an asynchronous array."""
    known, costs = summary["bits"], summary["costs"]
    scanned, alone = (costs[array] for array in ARRAYS)
    soon, late = (f"{w:g}" for w in (min(p["windows_ms"]), max(p["windows_ms"])))

    def bits_of(window: str, code: str) -> str:
        shown = [(*known[array][window][code], array) for array in ARRAYS]
        return ", ".join(f"{middle:.2f} ({low:.2f} to {high:.2f}) {array}" for middle, low, high, array in shown)

    gains = {
        window: known["asynchronous"][window]["relative"][0] - known["scanned"][window]["relative"][0]
        for window in known["scanned"]
    }
    most = max(gains, key=gains.__getitem__)
    apart = all(
        known["asynchronous"][soon][code][1] > known["scanned"][soon][code][2] for code in ("first", "relative")
    )
    yield Judgement(
        108,
        f"first rises of a touch fall on {alone['moments']:.0f} different times of 1 us instead of "
        f"{scanned['moments']:.0f} frames (median)",
        alone["moments"] > 2 * scanned["moments"],
        "what the foam, the fabric and the taxels' spread let through; taxels of one frame in between lie on "
        "straight lines",
    )
    yield Judgement(
        208,
        f"first-spike latency in {soon} ms: {bits_of(soon, 'first')} bits of {summary['most']:.2f}; relative "
        f"latency: {bits_of(soon, 'relative')}; in {late} ms: {bits_of(late, 'relative')}; the largest gain is "
        f"{gains[most]:+.2f} in {most} ms (relative)",
        apart if p["trials"] >= PARAMETERS["trials"] else None,
        "" if apart else "the intervals overlap in the shortest window, in one code or both",
    )
    yield Judgement(
        24,
        f"while touched {alone['events_a_s']:.0f} events/s instead of {scanned['events_a_s']:.0f}; with address "
        f"and sign alone {alone['address_kbit_s']:.0f} instead of {scanned['address_kbit_s']:.0f} kbit/s; on "
        f"version 2 of the wire {alone['touched_kbit_s']:.0f} instead of {scanned['touched_kbit_s']:.0f}, of which "
        f"{alone['rest_kbit_s']:.0f} and {scanned['rest_kbit_s']:.0f} are sent at rest too",
        None,
        "power is not simulated; a taxel by itself sends each step on the way, a scanned one only where a frame "
        "finds it",
    )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw the bits over time since contact, of both arrays."""
    figure, axes = subplots(9, 3.8, 1, 2, sharey=True)
    for ax, (code, title) in zip(
        axes, (("first", "first-spike latency"), ("relative", "relative latency")), strict=True
    ):
        for array, colour, beside in zip(ARRAYS, ("C0", "C3"), (0.98, 1.02), strict=True):
            windows = [float(w) for w in summary["bits"][array]]
            shown = np.array([one[code] for one in summary["bits"][array].values()])
            off = np.abs(shown[:, 1:] - shown[:, :1]).T
            # The two curves are drawn a little apart, so that neither interval hides the other.
            ax.errorbar(np.multiply(windows, beside), shown[:, 0], off, color=colour, label=array, fmt="o-", capsize=3)
        ax.axhline(summary["most"], color="0.6", ls=":", label="ceiling")
        ax.set(xlabel="time since contact, ms", title=title)
        logarithmic(ax, x=windows)
    axes[0].set_ylabel("bits")
    axes[0].legend(fontsize="small")
    return figure
