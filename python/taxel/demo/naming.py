"""Classify a drop soon after its contact: which ball, from how high, on which slant.

The answers rest on drops that were simulated beforehand and come with taxel (``drops.json``, written by
``taxel demo --drops``): balls, heights, slants, places, foams and boards that the demo never plays.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from taxel._base.files import write_whole
from taxel.demo.evaluation import Evaluation
from taxel.demo.script import SLANTS_DEG, TRAINING_SEED, drawn, fall_ms
from taxel.encode import ContactArea
from taxel.events import Events
from taxel.information import LDA
from taxel.simulate import Scene, Silence, play, truth
from taxel.spikes import to_ms, to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = [
    "ANSWERED_MS",
    "QUESTIONS",
    "Drops",
    "Question",
    "board_of_drops",
    "estimates",
    "shipped_drops",
    "write_drops",
]

#: Times after the contact for which an answer is computed, ms.
ANSWERED_MS = (1, 2, 5, 10)
#: Times of the pictures, ms: an answer depends on those up to its own time.
LOOKED_MS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
#: What a loaded taxel reads above rest, ticks: the board's noise floor and half a tick.
_ABOVE = 3.5
#: Boards of the shipped set, and drops on each; their seeds are the demo's training's own, far behind the readout's.
_BOARDS, _DROPS, _FIRST_SEED = 30, 20, TRAINING_SEED + 500_000
#: How long a ball is recorded after its fall, ms, and how fast a hand then lifts it, mm/s.
_AFTER_FALL_MS, _LIFT_MM_S = 30.0, 500.0
#: Ridge of the discriminants: consecutive pictures are nearly equal.
_RIDGE = 0.01


@dataclass(frozen=True)
class Question:
    """One property of a drop that is estimated."""

    column: str
    unit: str
    edges: tuple[float, ...]
    answers: tuple[str, ...]

    def of(self, value: float) -> int:
        """Return the number of the right answer."""
        return int(np.searchsorted(self.edges, value))


#: The demo's balls are 50 to 70 mm wide and fall from 100 to 200 mm, on a level array or on one tilted by 10 to 30.
QUESTIONS = {
    "ball": Question("diameter_mm", "mm", (60.0,), ("50 to 60 mm", "60 to 70 mm")),
    "height": Question("height_mm", "mm", (133.0, 167.0), ("100 to 133 mm", "133 to 167 mm", "167 to 200 mm")),
    "slant": Question(
        "slant_deg", "degrees", (SLANTS_DEG[0] - 0.5, 20.0), ("level", "10 to 20 degrees", "20 to 30 degrees")
    ),
}
#: Of a picture: loaded taxels, their sum, the largest, and how far along the rows their middle has moved.
_NUMBERS = 4
#: The move is stored in hundredths of a taxel.
_MOVED = 100


@dataclass(frozen=True)
class Drops:
    """Drops that were simulated beforehand.

    Attributes
    ----------
    diameter_mm, height_mm, slant_deg : float64, shape (drops,)
    pictures : int64, shape (drops, times of `LOOKED_MS`, 4)
        Loaded taxels; ticks above rest, summed; the largest; how far along the rows, the way that the array falls,
        their middle has moved since the first picture, in hundredths of a taxel.
    """

    diameter_mm: NDArray[np.float64]
    height_mm: NDArray[np.float64]
    slant_deg: NDArray[np.float64]
    pictures: NDArray[np.int64]

    def posterior(self, name: str, after_ms: float, pictures: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return how probable each answer is of other drops after a time, shape (other drops, answers).

        The softmax of linear discriminants: the posterior where pictures scatter alike about each answer's mean. In
        folds over boards the shipped set is right as often as these say (`tests/demo/test_naming.py`).
        """
        question = QUESTIONS[name]
        y = np.array([question.of(value) for value in getattr(self, question.column)])
        lda = LDA(ridge=_RIDGE).fit(_features(self.pictures, after_ms), y)
        scores = lda.decision_function(_features(pictures, after_ms))
        weights = np.exp(scores - scores.max(1, keepdims=True))
        return np.asarray(weights / weights.sum(1, keepdims=True))


def _features(pictures: NDArray[np.int64], after_ms: float) -> NDArray[np.float64]:
    seen = pictures[:, [k for k, t in enumerate(LOOKED_MS) if t <= after_ms]].astype(np.float64)
    held, moved = np.log1p(seen[:, :, :-1]), seen[:, 1:, -1] / _MOVED
    return np.concatenate([held.reshape(len(seen), -1), moved], axis=1)


def look(events: Events, tare: Tare, begin_us: float) -> NDArray[np.int64]:
    """Return what the host's picture holds at each time of `LOOKED_MS` after the first rise, shape (times, 4)."""
    assert events.intensity is not None  # the board sends them
    index = events.array.index(events.x, events.y)
    rest, features = tare.rest.ravel(), np.zeros((len(LOOKED_MS), _NUMBERS), np.int64)
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


def _truth(scene: Scene) -> tuple[float, float, float]:
    """Return the diameter of a drawn scene's ball, the height that it falls from, mm, and the slant, degrees."""
    ball = scene.parameters["bodies"][0]
    diameter, height = 2 * ball["shape"]["sphere"]["radius_mm"], ball["motion"]["dropped"]["height_mm"]
    return diameter, height, scene.parameters["slant_deg"]


def board_of_drops(seed: int, count: int) -> list[list[float | int]]:
    """Drop balls on one board; return a row for each that gave events: diameter, height, slant, then its pictures."""
    scenes = []
    for n in range(count):
        scene = drawn(seed, n)
        ending = {"left_to_rest": {"rest_ms": fall_ms(scene) + _AFTER_FALL_MS, "lift_mm_s": _LIFT_MM_S}}
        scenes.append(scene.body(motion={"dropped": {"ending": ending}}).replace(lead_ms=20.0, tail_ms=10.0))
    acts: list[Silence | Scene] = [Silence(100.0), *scenes]
    events = play(acts, seed=seed).events
    tare = Tare.take(events, stop_us=events.markers[0][0])
    rises = to_us(ContactArea(tare=tare).encode(events)[0])
    rows: list[list[float | int]] = []
    firsts = [contact for contact in truth(acts)[0] if contact.kind == "first"]
    for scene, contact in zip(scenes, firsts, strict=True):
        inputs = rises[(rises >= contact.start_us - FRAME_US) & (rises < contact.stop_us)]
        if len(inputs):
            rows.append(
                [
                    *(round(value, 1) for value in _truth(scene)),
                    *look(events.sorted(), tare, float(inputs[0])).ravel().tolist(),
                ]
            )
    return rows


def write_drops(path: Path, *, progress: Callable[[str], object] = lambda _: None) -> Path:
    """Simulate the shipped set and write it.

    Raises
    ------
    FileExistsError : there is such a file
    """
    rows: list[list[float | int]] = []
    for n in range(_BOARDS):
        progress(f"dropping balls, board {n + 1} of {_BOARDS}")
        rows += board_of_drops(_FIRST_SEED + n, _DROPS)
    lines = ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows)
    head = json.dumps({"made_by": "taxel demo --drops", "looked_ms": LOOKED_MS})
    text = f'{head[:-1]}, "rows": [\n{lines}\n]}}\n'

    def put(file: BinaryIO) -> None:
        file.write(text.encode())

    return write_whole(path, put)


@cache
def shipped_drops() -> Drops:
    """Return the drops that come with the demo."""
    rows = json.loads(files("taxel.demo").joinpath("drops.json").read_text(encoding="utf-8"))["rows"]
    table = np.array(rows, np.float64)
    pictures = table[:, 3:].astype(np.int64).reshape(len(table), len(LOOKED_MS), _NUMBERS)
    return Drops(table[:, 0], table[:, 1], table[:, 2], pictures)


def estimates(evaluation: Evaluation, scenes: Sequence[Scene]) -> dict[str, Any]:
    """Estimate which ball fell first in each scene, from how high on which slant, by time since the first event.

    Parameters
    ----------
    evaluation : Evaluation
        Of these scenes.
    scenes : sequence of Scene

    Returns
    -------
    dict
        ``answered_ms``; ``drops``, each with the truth (mm, degrees), the delay of the first event (ms; None for none)
        and by question the answers' probabilities and whether the most probable is right, by time; ``right``, how many
        of all drops, by question and time; ``chance``, the share of the answer that the shipped drops have most of.
    """
    known = shipped_drops()
    firsts = [contact for contact in evaluation.contacts if contact.kind == "first"]
    drops: list[dict[str, Any]] = []
    pictures = []
    for scene, contact in zip(scenes, firsts, strict=True):
        first_us = evaluation.first_input(contact, "contact")
        true = dict(zip(QUESTIONS, _truth(scene), strict=True))
        late = None if first_us is None else to_ms(first_us - contact.start_us)
        drops.append({"true": true, "felt_ms": late, "said": {}})
        if first_us is not None:
            pictures.append(look(evaluation.events, evaluation.tare, first_us))
    answered = [one for one in drops if one["felt_ms"] is not None]
    for name, question in QUESTIONS.items() if answered else ():
        for t in ANSWERED_MS:
            for one, p in zip(answered, known.posterior(name, t, np.array(pictures)), strict=True):
                right = bool(p.argmax() == question.of(one["true"][name]))
                one["said"].setdefault(name, []).append({"probable": p.round(4).tolist(), "right": right})
    return {
        "answered_ms": list(ANSWERED_MS),
        "drops": drops,
        "right": {
            name: [sum(one["said"][name][k]["right"] for one in answered) for k in range(len(ANSWERED_MS))]
            for name in QUESTIONS
        },
        "chance": _chance(known),
    }


def _chance(known: Drops) -> dict[str, float]:
    """Return how often the answer that the set has most of would be right, by question."""
    shares = {}
    for name, question in QUESTIONS.items():
        right = [question.of(value) for value in getattr(known, question.column)]
        shares[name] = float(np.bincount(right).max() / len(right))
    return shares
