"""Which of two spheres fell, learnt from labels alone (after thesis 5.6.2).

No rule is written by hand: the recipe `touch` learns it from labelled recordings of the emulated board. For comparison
the best plain rule that we could think of, an LDA on frames around the touch and an LDA on three numbers run on the
same scenes. Contact and lift are judged by ``taxel bench training``.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel import detect
from taxel.detect import Example, Recipe, fit, run
from taxel.events import Events
from taxel.frames import Frames
from taxel.simulate import Act, Contact, Scene, Silence, play, truth
from taxel.spikes import to_ms, to_us
from taxel.tare import Tare
from taxel_studies.study import Parameters, Row, Statement, Summary, Table, Task, subplots
from taxel_studies.touch_rivals import around, best_rule, lda, numbers

WHERE = "after 5.6.2"
PROTOCOL = (
    "Balls of 36 g, 50 and 70 mm across, fall on foam over the emulated board; heights (100 to 200 mm), places and "
    "foams are drawn by seed. The label is the sphere's name at its first contact; the recipe `touch` was chosen on "
    "other seeds. Judged on other seeds, so other places. It is also learnt from 20 of the training scenes, ten each, "
    "in ten draws, and judged by the same scenes. Beside the neuron: the best of some plain rules, chosen on the "
    "training scenes (a threshold on area, total, peak or a ratio of them), and linear discriminants on the 16 x 16 "
    "taxels above rest around the touch, as 5.6.2 takes them (on the whole array they learn places by heart), and on "
    "the logarithms of area, total and peak; ridges chosen inside the training scenes."
)

PARAMETERS: dict[str, Any] = {
    "parts": 4,
    "train": 200,
    "test": 100,
    "radii_mm": [25.0, 35.0],
    "drop_mm": [100.0, 200.0],
    "times_ms": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.5, 7.0, 8.0, 10.0, 15.0],
    "few": 20,
    "draws": 10,
    "seed": 1,
}
SIZES = {"toy": {"parts": 1, "train": 16, "test": 8, "times_ms": [1.0, 6.5, 10.0], "few": 8, "draws": 2}}

#: By when after the true contact the sphere is to be known, ms; of how many scenes, and learnt from few of how many.
BY_MS, GOAL, FEW_GOAL = 6.5, 0.995, 0.98
#: The two spheres, as labels.
KINDS = ("small", "large")
#: The methods, with their colours.
WAYS = {
    "neuron": "neuron, learnt",
    "rule": "best plain rule",
    "numbers": "LDA on log area, total, peak",
    "lda": "LDA on frames",
}
COLOURS = {"neuron": "C3", "rule": "C0", "numbers": "C4", "lda": "C2"}
#: Rest that a recording holds before the board marks its start, us; and how long it goes on after the touch.
REST_US, AFTER_US = 10_000, 50_000


class Drop(NamedTuple):
    """A labelled recording, with the true contact."""

    example: Example
    events: Events
    tare: Tare
    contact: Contact
    kind: int

    def since_contact(self, times_ms: Sequence[float]) -> NDArray[np.float32]:
        """Return the readings above rest at times since the touch really began, (times, rows, columns)."""
        at = [round(self.contact.start_us + to_us(t)) for t in times_ms]
        return np.concatenate([self.tare.off(Frames.from_events(self.events, 1, t, t + 1)).values for t in at])


def drawn(params: dict[str, Any], seed: int, scenes: int) -> list[Drop]:
    """Draw scenes by seed, and play them; the two spheres take turns."""
    rng = np.random.default_rng([seed, 56])
    drops = []
    for k in range(scenes):
        kind = k % 2
        scene = Scene.draw(seed, k).body(
            shape={"sphere": {"radius_mm": params["radii_mm"][kind]}},
            motion={"dropped": {"height_mm": float(rng.uniform(*params["drop_mm"]))}},
        )
        acts: list[Act] = [Silence(60.0), scene]
        fall = next(c for c in truth(acts)[0] if c.kind in ("first", "bounce"))
        events = play(acts, seed=1000 * seed + k).events
        started = events.markers[0][0]
        events = events.between(started - REST_US, fall.stop_us + AFTER_US)
        tare = Tare.take(events, stop_us=started)
        drops.append(Drop(Example(events, {KINDS[kind]: [round(fall.start_us)]}, tare), events, tare, fall, kind))
    return drops


def tasks(p: Parameters) -> list[Task]:
    """List the parts: other seeds, so other places, heights and foams, to learn from and to judge by."""
    shared = {k: p[k] for k in ("train", "test", "radii_mm", "drop_mm", "times_ms", "few")}
    return [
        Task(shared | {"draws": len(range(part, p["draws"], p["parts"]))}, 100 * p["seed"] + 2 * part)
        for part in range(p["parts"])
    ]


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Draw scenes, learn from some, judge all methods by the others, by time since contact."""
    train, test = (drawn(params, seed + n, params[which]) for n, which in enumerate(("train", "test")))
    truths = [np.array([drop.kind for drop in which]) for which in (train, test)]
    firsts, times = _firsts(train, test), params["times_ms"]
    known = [(first, drop) for first, drop in zip(firsts, test, strict=True) if first is not None]
    right = [first[1] if first[0] == KINDS[drop.kind] else np.inf for first, drop in known]
    shares: dict[str, Any] = {"neuron": [sum(at <= t for at in right) / len(test) for t in times]}
    shares |= {"rule": [], "numbers": [], "lda": [], "rules": []}
    by_moment = [np.stack([drop.since_contact(times) for drop in which], axis=1) for which in (train, test)]
    for now in zip(*by_moment, strict=True):
        # A frame a scene.
        learnt, judged = (Frames(one, np.arange(len(one)), unit="ticks", array=train[0].events.array) for one in now)
        name, by_rule = best_rule(learnt, judged, truths[0])
        shares["rules"].append(name)
        answers = {way: lda(of(learnt), truths[0])(of(judged)) for way, of in (("numbers", numbers), ("lda", around))}
        answers["rule"] = by_rule
        for way, kinds in answers.items():
            shares[way].append(float(np.mean(kinds == truths[1])))
    few = [
        sum(_in_time(first, drop) for first, drop in zip(_firsts(some, test), test, strict=True)) / len(test)
        for some in _few(params, seed, train)
    ]
    return shares | {
        "scenes": len(test),
        "in_time": sum(_in_time(first, drop) for first, drop in zip(firsts, test, strict=True)),
        "silent": len(test) - len(known),
        "said_ms": np.round([first[1] for first, _ in known], 3).tolist(),
        "few": few,
    }


def _few(params: dict[str, Any], seed: int, train: list[Drop]) -> list[list[Drop]]:
    """Return draws of a few training scenes, half of each sphere."""
    of = [[n for n, drop in enumerate(train) if drop.kind == kind] for kind in range(len(KINDS))]
    draws = []
    for draw_ in range(params["draws"]):
        rng = np.random.default_rng([seed, 57, draw_])
        draws.append([train[k] for mine in of for k in rng.choice(mine, params["few"] // 2, False)])
    return draws


def _firsts(train: Sequence[Drop], test: Sequence[Drop]) -> list[tuple[str, float] | None]:
    """Return of each scene the first label that is known after contact, and how long after it (ms); None in silence."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # targets out of reach are counted as missed
        # Of neurons alone.
        readout = fit([drop.example for drop in train], Recipe.load("touch", labels=KINDS), by_rule=())
    return [_first(readout, drop) for drop in test]


def _first(readout: detect.Readout, drop: Drop) -> tuple[str, float] | None:
    contact_us = drop.contact.start_us
    detected = [d for d in run(readout, drop.events, tare=drop.tare) if d.known >= contact_us]
    first = min(detected, key=lambda d: d.known, default=None)
    return None if first is None else (first.label, float(to_ms(first.known - contact_us)))


def _in_time(first: tuple[str, float] | None, drop: Drop) -> bool:
    return first is not None and first[0] == KINDS[drop.kind] and first[1] <= BY_MS


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Merge the results of the parts."""
    kinds = [row.result for row in rows]
    late = [ms for one in kinds for ms in one["said_ms"]]
    return {
        "times_ms": list(p["times_ms"]),
        "scenes": sum(one["scenes"] for one in kinds),
        "in_time": sum(one["in_time"] for one in kinds),
        "few": [share for one in kinds for share in one["few"]],
        "silent": sum(one["silent"] for one in kinds),
        "said_ms": [float(v) for v in np.percentile(late, [5, 50, 95])] if late else None,
        "kinds": {way: np.mean([one[way] for one in kinds], axis=0).tolist() for way in WAYS},
        "rules": [max(set(names), key=names.count) for names in zip(*(one["rules"] for one in kinds), strict=True)],
    }


def statements(p: Parameters, summary: Summary) -> Iterator[Statement]:
    """Judge what the study is to show, and name the other method where it does better."""
    at = summary["times_ms"].index(10.0) if 10.0 in summary["times_ms"] else len(summary["times_ms"]) - 1
    shares = {way: summary["kinds"][way][at] for way in WAYS}
    best = max(shares, key=lambda way: shares[way])
    middle = "never" if summary["said_ms"] is None else f"{summary['said_ms'][1]:.1f} ms after contact (median)"
    ways = ", ".join(f"{WAYS[way]} {shares[way]:.1%}" for way in WAYS)
    few = summary["few"]
    yield Statement(
        f"Which of the two spheres of 5.6.2 fell is learnt from labels alone; known {BY_MS:g} ms after contact.",
        f"{GOAL:.1%} right by then (our goal)",
        f"{summary['in_time']} of {summary['scenes']} right by then, {summary['silent']} without a word; {middle}",
        summary["in_time"] >= GOAL * summary["scenes"],
        "heights, places and foams drawn; learnt from other seeds",
    )
    yield Statement(
        f"{p['few']} labelled touches are enough.",
        f"{FEW_GOAL:.0%} right by then, mean of {p['draws']} draws (our goal)",
        f"{np.mean(few):.1%} of the same scenes right by then (mean), the worst draw {min(few):.1%}",
        bool(np.mean(few) >= FEW_GOAL),
        "drawn from the training scenes, half of each sphere",
    )
    yield Statement(
        f"No rule and no LDA does better at {summary['times_ms'][at]:g} ms.",
        "the neuron first (our goal)",
        ways,
        best == "neuron",
        f"the rule looks at {summary['rules'][at]}; rule and LDA are given the time of contact, the neuron is not; "
        "they look at one moment, and see less when the ball leaves (after 15 to 19 ms)",
    )


def tables(_p: Parameters, summary: Summary) -> Iterator[Table]:
    """List the shares by method."""
    yield Table(
        "Which sphere fell: detected and right, per cent, by ms since contact",
        ["way", *(f"{t:g}" for t in summary["times_ms"])],
        [(WAYS[way], *(f"{100 * share:.0f}" for share in summary["kinds"][way])) for way in WAYS],
        "The neuron's share counts what was detected by then and right; what the rule looks at at each time: "
        + ", ".join(summary["rules"]),
    )


def draw(_p: Parameters, summary: Summary) -> Figure:
    """Draw the shares by time since contact."""
    figure, ax = subplots(6.5, 4.2)
    for way, words in WAYS.items():
        shares = [100 * share for share in summary["kinds"][way]]
        ax.plot(summary["times_ms"], shares, "o-", color=COLOURS[way], label=words, markersize=4)
    ax.axhline(50, color="grey", linestyle=":", linewidth=0.8, label="by chance")
    ax.set(xlabel="time since contact (ms)", ylabel="detected and right (%)", title="which of two spheres fell")
    ax.set_ylim(0, 103)
    figure.legend(loc="outside lower center", ncols=3, fontsize="small")
    return figure
