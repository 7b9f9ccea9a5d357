"""What questions about information say that makes no answer possible."""

import numpy as np
from refusal import messages

import taxel
from taxel import Frames
from taxel.information import (
    LabelledTrial,
    answer,
    confusion_matrix,
    estimate,
    folds,
    nested_predictions,
    panzeri_treves,
    plug_in,
)

CALLS = {
    "classes": lambda _: estimate(["a", "a"], ["a", "b"]),
    "responses": lambda _: estimate(["a", "b"], ["a"]),
    "two kinds": lambda _: estimate(["a", "b"], [1, 2]),
    "confidence": lambda _: estimate(["a", "b"], ["a", "b"], confidence=1.0),
    "folds": lambda _: folds(["a", "b"] * 2, count=10),
    "one trial": lambda _: folds(["a", "a", "b"], count=2),
    "one group": lambda _: folds(["a", "a", "b", "b"], count=2, groups=["x", "y", "z", "z"]),
    "groups": lambda _: estimate(["a", "b"], ["a", "b"], groups=["x"]),
    "no number": lambda _: plug_in([[0, 0], [0, 0]]),
    "negative number": lambda _: plug_in([[1, -2], [0, 1]]),
    "half a number": lambda _: panzeri_treves([[0.5, 1]]),
    "names of a matrix": lambda _: confusion_matrix(["a", 1.5], ["a", "b"], ["b"]),
    "one class": lambda _: nested_predictions([np.eye(4)], [4], [0, 0, 0, 0], count=2),
    "features": lambda _: nested_predictions([np.eye(4)], [4, 4], [0, 1, 0, 1], count=2),
    "ridge": lambda _: nested_predictions([np.eye(4)], [4], [0, 1, 0, 1], count=2, ridges=[0.0]),
    "not symmetric": lambda _: nested_predictions([[[1.0, 2.0], [3.0, 1.0]]], [3], [0, 1], count=2),
    "arrays": lambda _: answer(
        [LabelledTrial(Frames(np.zeros((5, 1, n)), np.arange(5)), str(n), 0) for n in (2, 3)], window_ms=20
    ),
    "table": lambda folder: taxel.information.read_trials(written(folder / "trials.csv"), []),
}


def written(table):
    table.write_text("label,t_us\n")
    return table


def test_messages(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
