"""Sound calls of `taxel.information`."""

from collections.abc import Callable
from typing import Any

import numpy as np

import taxel
from sound.things import ARRAY, EVENTS, PLAIN, Sound, method, plain

FOUND_BITS = taxel.information.estimate(["a", "b"] * 4, ["a", "b"] * 4, redraws=2)
CLOUD = np.array([[0.0, 1.0], [3.0, 2.0], [0.5, 0.0], [2.0, 2.5], [1.0, 1.0], [3.5, 3.0], [0.2, 0.4], [2.5, 2.0]])
NESTED = taxel.information.nested_predictions([CLOUD @ CLOUD.T], [2], [0, 1] * 4, count=2, inner=2)
READOUTS = [
    taxel.information.ConeRReadout(tau=5.0, bound=1.0).fit([PLAIN, PLAIN], [0, 1]),
]
PRESSES = taxel.Events(
    np.arange(8) * 10_000 + 1000, np.arange(8) % 2, [0] * 8, [True] * 8, array=ARRAY, intensity=np.arange(8) * 50 + 50
)
TOUCHES = [taxel.information.LabelledTrial(PRESSES, "ab"[k % 2], k * 10_000) for k in range(8)]


def answer() -> taxel.information.Answer:
    return taxel.information.answer(TOUCHES, window_ms=5.0, draws=1, folds=2, shuffles=1)


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.information.confusion_matrix": plain(
        taxel.information.confusion_matrix, labels=["a", "b"], responses=["a", "a"], classes=["a", "b"]
    ),
    **{
        f"taxel.information.{name}": plain(getattr(taxel.information, name), counts=[[5, 1], [2, 4]])
        for name in ("label_entropy", "local_information", "panzeri_treves", "plug_in", "relevant_responses")
    },
    "taxel.information.quadratic_extrapolation": plain(
        taxel.information.quadratic_extrapolation, counts=[[5, 1], [2, 4]], repetitions=2, seed=1
    ),
    "taxel.information.estimate": plain(
        taxel.information.estimate,
        labels=["a", "b"] * 4,
        responses=["a", "b"] * 4,
        groups=["x", "y", "z", "z"] * 2,
        redraws=5,
        confidence=0.9,
        seed=1,
    ),
    "taxel.information.zero_test": plain(
        taxel.information.zero_test,
        answer=lambda labels: labels,
        labels=["a", "b"] * 4,
        found=1.0,
        groups=["x", "y"] * 4,
        shuffles=2,
        seed=1,
    ),
    "taxel.information.folds": plain(
        taxel.information.folds, labels=["a", "b"] * 4, count=2, groups=["x", "x", "y", "y"] * 2, seed=1
    ),
    "taxel.information.keeps": plain(
        taxel.information.keeps, cheap=FOUND_BITS, dear=FOUND_BITS, share=0.9, groups=["x", "y"] * 4
    ),
    "taxel.information.nested_predictions": plain(
        taxel.information.nested_predictions,
        grams=[CLOUD @ CLOUD.T],
        features=[2],
        y=[0, 1] * 4,
        groups=["x", "x", "y", "y"] * 2,
        count=2,
        inner=2,
        ridges=[1.0],
        neighbours=(),
        seed=1,
    ),
    "taxel.information.ConeRReadout": plain(taxel.information.ConeRReadout, tau=5.0, bound=1.0, max_seconds=1.0),
    "taxel.information.ConeRReadout.fit": method(
        taxel.information.ConeRReadout(tau=5.0, bound=1.0), "fit", patterns=[PLAIN, PLAIN], y=[0, 1]
    ),
    **{
        f"taxel.information.{type(readout).__name__}.{name}": method(readout, name, patterns=[PLAIN])
        for readout in READOUTS
        for name in ("predict", "decision_function")
    },
    **{
        f"taxel.information.{type(readout).__name__}.score": method(readout, "score", patterns=[PLAIN], y=[0])
        for readout in READOUTS
    },
    "taxel.information.LabelledTrial": plain(
        taxel.information.LabelledTrial,
        source=EVENTS,
        label="a",
        start_us=0,
        stop_us=500,
        group="x",
        parameters={"radius": "5"},
        name="one",
    ),
    "taxel.information.read_trials": lambda: (
        taxel.information.read_trials,
        {"table": "here_trials.csv", "recordings": [taxel.open("here_events.npz")], "window_ms": 0.1},
    ),
    "taxel.information.notes_as_trials": lambda: (
        taxel.information.notes_as_trials,
        {"recordings": [taxel.open("here_events.npz").with_notes([taxel.Note("ball", 0, 0)])], "window_ms": 0.1},
    ),
    "taxel.information.recordings_as_trials": lambda: (
        taxel.information.recordings_as_trials,
        {"recordings": [taxel.open("here_events.npz")], "window_ms": 0.1},
    ),
    "taxel.information.answer": plain(
        taxel.information.answer,
        trials=TOUCHES,
        encoder=taxel.encode.ChangeEvents(),
        window_ms=5.0,
        windows_ms=[2.0],
        periods_ms=[1.0],
        taxels=[1],
        pools=[2],
        taxels_at_ms=1.0,
        draws=1,
        folds=2,
        shuffles=1,
        classifiers=["neighbours"],
        seed=1,
        progress=lambda *_: None,
        watch=lambda *_: None,
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.information.Answer": answer,
    "taxel.information.Control": lambda: answer().controls[0],
    "taxel.information.Estimate": lambda: FOUND_BITS,
    "taxel.information.Nested": lambda: NESTED,
    "taxel.information.Point": lambda: answer().full,
    "taxel.information.Keeping": lambda: taxel.information.keeps(FOUND_BITS, FOUND_BITS),
    "taxel.information.ZeroTest": lambda: answer().zero,
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
