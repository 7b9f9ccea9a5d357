"""Which ball fell, from how high, on which slant: classified soon after the contact (after thesis 5.6.4)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taxel.demo.script import SLANTS_DEG, TRAINING_SEED, drawn, fall_ms
from taxel.encode import ContactArea
from taxel.events import Events
from taxel.simulate import Scene, Silence, play, truth
from taxel.spikes import to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US
from taxel_studies.discriminants import LDA
from taxel_studies.runner import Task
from taxel_studies.study import Parameters, Row, Statement, Summary, Table

WHERE = "after thesis 5.6.4"
PROTOCOL = (
    "Balls of 50 to 70 mm fall from 100 to 200 mm, as in taxel demo; every other one on the array tilted by 10 to 30 "
    "degrees. Linear discriminants classify each from the number of loaded taxels, the sum and the largest of their "
    "readings and how far their middle has moved, at times since the first event. They are trained on other boards; "
    "balls, places and foams are others too."
)

PARAMETERS: dict[str, Any] = {"boards": 30, "drops": 20, "folds": 10}
SIZES = {"toy": {"boards": 3, "drops": 8, "folds": 3}}

#: Times after the contact for which an answer is computed, ms.
ANSWERED_MS = (1, 2, 5, 10)
#: Times of the frames, ms: an answer depends on those up to its own time.
LOOKED_MS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
#: The properties asked for: the unit, and the values that divide the answers. A level array has a slant of 0.
QUESTIONS = {
    "ball": ("mm", (60.0,)),
    "height": ("mm", (133.0, 167.0)),
    "slant": ("degrees", (SLANTS_DEG[0] - 0.5, 20.0)),
}
#: What a loaded taxel reads above rest, ticks: the board's noise floor and half a tick.
_ABOVE = 3.5
#: Seeds of boards that neither the demo nor the training of its readout plays.
_FIRST_SEED = TRAINING_SEED + 500_000
#: How long a ball is recorded after its fall, ms, and how fast a hand then lifts it, mm/s.
_AFTER_FALL_MS, _LIFT_MM_S = 30.0, 500.0
#: Ridge of the discriminants: consecutive frames are nearly equal.
_RIDGE = 0.01
#: The move of the middle is stored in hundredths of a taxel.
_MOVED = 100
#: From so many drops on, shares are compared with probabilities: their standard error is 2 %.
_JUDGED = 500


def tasks(p: Parameters) -> list[Task]:
    """List one task a board."""
    return [Task({"drops": p["drops"]}, board) for board in range(p["boards"])]


def realise(params: dict[str, Any], seed: int) -> list[dict[str, Any]]:
    """Drop balls on one board; return those that gave events: their properties, and a frame for each time."""
    scenes = []
    for n in range(params["drops"]):
        scene = drawn(_FIRST_SEED + seed, n)
        ending = {"left_to_rest": {"rest_ms": fall_ms(scene) + _AFTER_FALL_MS, "lift_mm_s": _LIFT_MM_S}}
        scenes.append(scene.body(motion={"dropped": {"ending": ending}}).replace(lead_ms=20.0, tail_ms=10.0))
    acts: list[Silence | Scene] = [Silence(100.0), *scenes]
    events = play(acts, seed=_FIRST_SEED + seed).events
    tare = Tare.take(events, stop_us=events.markers[0][0])
    rises = to_us(ContactArea(tare=tare).encode(events)[0])
    firsts = [contact for contact in truth(acts)[0] if contact.kind == "first"]
    found = []
    for scene, contact in zip(scenes, firsts, strict=True):
        inputs = rises[(rises >= contact.start_us - FRAME_US) & (rises < contact.stop_us)]
        if len(inputs):
            ball = scene.parameters["bodies"][0]
            found.append(
                {
                    "ball": round(2 * ball["shape"]["sphere"]["radius_mm"], 1),
                    "height": round(ball["motion"]["dropped"]["height_mm"], 1),
                    "slant": round(scene.parameters["slant_deg"], 1),
                    "frames": look(events.sorted(), tare, float(inputs[0])).tolist(),
                }
            )
    return found


def look(events: Events, tare: Tare, begin_us: float) -> NDArray[np.int64]:
    """Return what the host holds at each time of `LOOKED_MS` after the first event, shape (times, 4).

    Loaded taxels; ticks above rest, summed; the largest; how far along the rows, the way that the array falls, their
    middle has moved since the first frame, in hundredths of a taxel.
    """
    assert events.intensity is not None  # the board sends them
    index = events.array.index(events.x, events.y)
    rest, features = tare.rest.ravel(), np.zeros((len(LOOKED_MS), 4), np.int64)
    x = np.arange(len(rest)) % events.array.columns
    first = middle = None
    begin = int(np.searchsorted(events.t, begin_us - FRAME_US))
    for k, t in enumerate(LOOKED_MS):
        seen = slice(begin, int(np.searchsorted(events.t, begin_us + to_us(t))))
        held = np.full(len(rest), np.nan)
        held[index[seen]] = events.intensity[seen]
        above = np.nan_to_num(held - rest)
        loaded = above > _ABOVE
        if loaded.any():
            middle = float(np.average(x[loaded], weights=above[loaded]))
            first = middle if first is None else first
        moved = 0.0 if first is None or middle is None else middle - first
        above = above[loaded]
        features[k] = len(above), round(float(above.sum())), round(float(above.max(initial=0.0))), round(_MOVED * moved)
    return features


def features(frames: NDArray[np.int64], after_ms: float) -> NDArray[np.float64]:
    """Return what the discriminants see of frames up to a time."""
    seen = frames[:, [k for k, t in enumerate(LOOKED_MS) if t <= after_ms]].astype(np.float64)
    held, moved = np.log1p(seen[:, :, :-1]), seen[:, 1:, -1] / _MOVED
    return np.concatenate([held.reshape(len(seen), -1), moved], axis=1)


def answers(
    frames: NDArray[np.int64], y: NDArray[np.int64], fold: NDArray[np.int64], after_ms: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the most probable answer for each drop and its probability, by discriminants of the other folds.

    Probabilities are the softmax of the discriminants: the posterior where frames scatter alike about each answer's
    mean.
    """
    x = features(frames, after_ms)
    answer, probable = np.zeros(len(y), np.int64), np.zeros(len(y))
    for k in np.unique(fold):
        lda = LDA(ridge=_RIDGE).fit(x[fold != k], y[fold != k])
        scores = lda.decision_function(x[fold == k])
        weights = np.exp(scores - scores.max(1, keepdims=True))
        weights /= weights.sum(1, keepdims=True)
        answer[fold == k], probable[fold == k] = lda.classes_[weights.argmax(1)], weights.max(1)
    return answer, probable


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Return by question how many are right after each time, how probable the answers were, and what chance gives."""
    drops = [(row.seed * p["folds"] // p["boards"], drop) for row in rows for drop in row.result]
    fold = np.array([k for k, _ in drops])
    frames = np.array([drop["frames"] for _, drop in drops])
    summary: Summary = {"drops": len(drops), "questions": {}}
    for name, (_, edges) in QUESTIONS.items():
        y = np.searchsorted(edges, [drop[name] for _, drop in drops]).astype(np.int64)
        found = [answers(frames, y, fold, t) for t in ANSWERED_MS]
        summary["questions"][name] = {
            "right": [float(np.mean(answer == y)) for answer, _ in found],
            "probable": [float(probable.mean()) for _, probable in found],
            "chance": float(np.bincount(y).max() / len(y)),
        }
    return summary


def statements(p: Parameters, summary: Summary) -> list[Statement]:
    """Judge how soon a drop's properties can be classified."""
    del p
    found = summary["questions"]
    late = ", ".join(f"{name} {100 * one['right'][-1]:.0f} %" for name, one in found.items())
    chance = ", ".join(f"{name} {100 * one['chance']:.0f} %" for name, one in found.items())
    gains = [one["right"][-1] - one["right"][0] for one in found.values()]
    off = [abs(a - b) for one in found.values() for a, b in zip(one["right"], one["probable"], strict=True)]
    enough = summary["drops"] >= _JUDGED
    return [
        Statement(
            "A drop can be classified within 10 ms.",
            "the information of 18 conditions reaches its plateau in under 10 ms",
            f"after {ANSWERED_MS[-1]} ms right: {late}; by chance: {chance}",
            min(one["right"][-1] - one["chance"] for one in found.values()) > 0.3 if enough else None,
            "fewer and coarser classes than the thesis has" if enough else "too few drops",
        ),
        Statement(
            "Later answers are right more often.",
            "not stated",
            f"from {ANSWERED_MS[0]} to {ANSWERED_MS[-1]} ms: {100 * min(gains):.0f} to {100 * max(gains):.0f} % more",
            min(gains) > 0 if enough else None,
            "" if enough else "too few drops",
        ),
        Statement(
            "An answer is right as often as its probability says.",
            "not stated",
            f"at most {100 * max(off):.1f} % apart",
            max(off) < 0.05 if enough else None,
            "" if enough else "too few drops",
        ),
    ]


def tables(p: Parameters, summary: Summary) -> list[Table]:
    """List how many answers are right."""
    del p
    return [
        Table(
            "Answers that are right, and their mean probability",
            ["property", "answers divided at", *(f"after {t} ms" for t in ANSWERED_MS), "by chance"],
            [
                [
                    name,
                    f"{', '.join(f'{edge:g}' for edge in QUESTIONS[name][1])} {QUESTIONS[name][0]}",
                    *(
                        f"{100 * right:.0f} % ({100 * probable:.0f} %)"
                        for right, probable in zip(one["right"], one["probable"], strict=True)
                    ),
                    f"{100 * one['chance']:.0f} %",
                ]
                for name, one in summary["questions"].items()
            ],
            f"Of {summary['drops']} drops; each is classified by drops on other boards.",
        )
    ]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw the share of right answers over time, and chance."""
    del p
    figure = Figure(figsize=(6, 3.5), layout="constrained")
    axes = figure.subplots()
    for k, (name, one) in enumerate(summary["questions"].items()):
        axes.plot(ANSWERED_MS, [100 * right for right in one["right"]], "o-", color=f"C{k}", label=name)
        axes.axhline(100 * one["chance"], color=f"C{k}", linestyle=":")
    axes.set(xlabel="time since the first event, ms", ylabel="right, % (dotted: chance)", ylim=(0, 100))
    axes.legend(fontsize="small")
    return figure
