"""A neuron that learns without labels when touches of an array begin (thesis 3.6.2 asks for such learning)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.array import Array
from taxel.simulate import Scene, Silence, play, truth
from taxel.spikes import SpikeTrains, to_ms
from taxel_rules import STDP
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary, one_task_per_seed
from taxel_studies.unlabelled import moved, threshold, unlearning

WHERE = "thesis 3.6.2, which calls for it; the rule of Masquelier, Guyonneau and Thorpe 2008"
PROTOCOL = (
    "Balls fall on the emulated board: 35 % of them the same one from the same height on the same place (to "
    "2 mm and 1 mm, standard deviations), the others of any radius (25 to 35 mm), height (10 to 20 cm) and place. One "
    "neuron receives the rises and falls of all taxels, 8192 trains, with the paper's constants: half of the touches "
    "four times, then the others for the first time, always learning; judged by these. Before it learns, its threshold "
    "lets it fire twice a second; a touch comes three times a second. Beside it a neuron that never learns and fires "
    "as often."
)

PARAMETERS: dict[str, Any] = {
    "touches": 240,
    "same": 0.35,
    "tau_m": 10.0,
    "tau_s": 2.5,
    "tau_plus": 16.8,
    "tau_minus": 33.7,
    "untrained_hz": 2.0,
    "passes": 4,
    "boards": 5,
}
SIZES = {"toy": {"touches": 24, "boards": 1, "passes": 2}}
#: How long after a contact a spike belongs to it, and how much before it a stamp may lie, ms.
TOUCH_MS, STAMP_MS = 60.0, 0.5
#: How far random places keep from the array's edge, and the one that comes again from its middle, mm.
EDGE_MM, ASIDE_MM = 35.0, 20.0
#: What counts as every touch, and as none.
EVERY, NONE = 0.95, 0.1


class Play(NamedTuple):
    """The spikes that a neuron receives, and the true contacts."""

    spikes: SpikeTrains
    """Two trains a taxel: its rises, then its falls."""
    contacts: NDArray[np.float64]
    """When balls touched, ms."""
    same: NDArray[np.bool_]
    """Whether each touch was by the ball that falls again and again on one place."""


def tasks(p: Parameters) -> list[Task]:
    """List one board a task."""
    return one_task_per_seed(p, "boards")


def played(p: Parameters, seed: int) -> Play:
    """Drop balls on one board: often the same one on the same place, else any ball from any height on any place."""
    rng = np.random.default_rng([seed, 362])
    same = rng.random(p["touches"]) < p["same"]
    acts: list[Silence | Scene] = [Silence(100.0), *(_scene(rng, bool(one)) for one in same)]
    events = play(acts, seed=seed).events
    events = events.between(events.markers[0][0], np.inf).sorted()
    train = 2 * events.array.index(events.x, events.y) + ~events.p
    order = np.argsort(train, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(train, minlength=2 * 4096))])
    times = to_ms(events.t)
    spikes = SpikeTrains(times[order], offsets, 0.0, float(np.ceil(times[-1] + 1)))
    contacts = [to_ms(contact.start_us) for contact in truth(acts)[0] if contact.kind == "first"]
    return Play(spikes, np.array(contacts), same)


def _scene(rng: np.random.Generator, same: bool) -> Scene:
    array = Array.thesis()
    width = (array.columns - 1) * array.column_mm
    if same:
        x, y = width / 2 - ASIDE_MM + rng.normal(0, 1, 2)
        radius, height = 30.0, 150 + rng.normal(0, 2)
    else:
        x, y = rng.uniform(EDGE_MM, width - EDGE_MM, 2)
        radius, height = rng.uniform(25, 35), rng.uniform(100, 200)
    fall_ms = float(np.sqrt(2 * height / 9.81e-3))
    ending = {"left_to_rest": {"rest_ms": fall_ms + 40.0, "lift_mm_s": 500.0}}
    ball = {
        "shape": {"sphere": {"radius_mm": float(radius)}},
        "mass_g": 36.0,
        "x_mm": float(x),
        "y_mm": float(y),
        "motion": {"dropped": {"height_mm": float(height), "ending": ending}},
    }
    return Scene({"surface": "columns", "foam": {}, "bodies": [ball], "lead_ms": float(rng.uniform(0, 150))})


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train a neuron on half of the touches, many times over; test it on the others, beside an untrained one."""
    play = played(params, seed)
    # A whole ms, so that each piece begins where the last one ends, and between two touches.
    half = float(np.floor(play.contacts[params["touches"] // 2] - 20))
    first, second = play.spikes.between(0, half), play.spikes.between(half, play.spikes.stop)
    taus = {name: params[name] for name in ("tau_m", "tau_s", "tau_plus", "tau_minus")}
    stdp = STDP(threshold=threshold(first, params["untrained_hz"], taus), **taus)
    course: list[list[float]] = []
    for k in range(params["passes"]):
        stdp.partial_fit(moved(first, k * half))
        late = latencies(stdp.spikes_ - k * half, play.contacts)
        course += [[len(play.contacts) // 2 * k + n, round(float(t), 2)] for n, t in enumerate(late) if t < TOUCH_MS]
    last = (params["passes"] - 1) * half
    stdp.partial_fit(moved(second, last))
    # For comparison a neuron that does not learn, with a threshold at which it fires as often.
    hz = 1000 * len(stdp.spikes_) / (play.spikes.stop - half)
    untrained = unlearning(threshold(first, max(hz, params["untrained_hz"]), taus), taus).partial_fit(play.spikes)
    return {
        "learnt": judged(stdp.spikes_ - last, play, half),
        "untrained": judged(untrained.spikes_[untrained.spikes_ >= half], play, half),
        "strong": int(np.count_nonzero(stdp.weights_ > 0.5)),
        "course": course,
    }


def latencies(times: NDArray[np.float64], contacts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how long after each contact the first spike came that belongs to it, ms; infinite where none did."""
    touch = np.searchsorted(contacts, times + STAMP_MS, side="right") - 1
    delays = np.full(len(contacts), np.inf)
    since = times - contacts[np.maximum(touch, 0)]
    mine = (touch >= 0) & (since < TOUCH_MS)
    np.minimum.at(delays, touch[mine], since[mine])
    return delays


def judged(times: NDArray[np.float64], play: Play, begin: float) -> dict[str, Any]:
    """Return at which share of the touches from `begin` on a neuron fired, how soon, and how often outside them."""
    there = play.contacts >= begin
    late = latencies(times, play.contacts)
    fired = np.isfinite(late)
    touch = np.searchsorted(play.contacts, times + STAMP_MS, side="right") - 1
    beside = (touch < 0) | (times - play.contacts[np.maximum(touch, 0)] >= TOUCH_MS)
    share = {
        name: round(float(np.mean(fired[there & which])), 4)
        for name, which in (("same", play.same), ("other", ~play.same))
    }
    in_touch = late[there & fired]
    return {
        **share,
        "latency_ms": round(float(np.median(in_touch)), 2) if len(in_touch) else None,
        "beside": int(beside.sum()),
    }


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """List the boards."""
    del p
    boards = [{**row.result, "course": None} for row in rows]
    return {"boards": boards, "course": rows[0].result["course"]}


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Judge how often and how soon neurons fire at touches."""
    boards = summary["boards"]

    def middle(how: str, what: str) -> float:
        values = [one[how][what] for one in boards if one[how][what] is not None]
        return float(np.median(values)) if values else float("nan")

    size = f"medians of {len(boards)} boards, {p['touches'] - p['touches'] // 2} new touches each"
    same, other, beside = (middle("learnt", what) for what in ("same", "other", "beside"))
    soon, untrained = middle("learnt", "latency_ms"), middle("untrained", "latency_ms")
    return [
        Statement(
            "A neuron without labels comes to fire at every touch, and at nothing else.",
            "called for in 3.6.2",
            f"at {same:.0%} of the touches that come again, {other:.0%} of the others, {beside:g} times beside them",
            bool(min(same, other) >= EVERY and beside == 0),
            f"every: {EVERY:.0%} or more; {size}",
        ),
        Statement(
            "It comes to fire at the touch's beginning.",
            "called for in 3.6.2",
            f"{soon:.1f} ms after contact; a neuron that learns nothing and fires as often: {untrained:.1f} ms",
            bool(soon < untrained),
            size,
        ),
        Statement(
            "It distinguishes the touch that comes again from the others.",
            "called for in 3.6.2",
            f"it fires at {same:.0%} of these and {other:.0%} of those",
            bool(same >= EVERY and other <= NONE),
            f"told: at {EVERY:.0%} and at {NONE:.0%} at the most; nothing in the rule takes weights from taxels that "
            "are silent, and in time all taxels are touched",
        ),
    ]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw how soon after contact one neuron fires while it learns."""
    del p
    figure = Figure(figsize=(6.5, 3.6), layout="constrained")
    axes = figure.subplots()
    if summary["course"]:
        axes.plot(*np.transpose(summary["course"]), ".", markersize=3)
    axes.set(xlabel="touches presented", ylabel="ms from contact to spike", ylim=(0, None))
    return figure
