"""`taxel.information.answer` takes the classifier of Tempotrons by its name."""

import numpy as np

import taxel
from taxel.encode import ChangeEvents
from taxel.information import LabelledTrial, answer


def test_the_order_of_two_touches_is_told_by_tempotrons() -> None:
    random = np.random.default_rng(1)
    trials = []
    for k in range(40):
        first, late = k % 2, int(random.integers(0, 1000))
        t, x = np.array([50_000, 56_000]) + late, [first, 1 - first]
        events = taxel.Events(t, x, [0, 0], [True, True], array=taxel.Array(1, 2), intensity=[100, 100])
        trials.append(LabelledTrial(events, ("right first", "left first")[first], 49_500 + late))
    answered = answer(trials, encoder=ChangeEvents(), window_ms=30, shuffles=2, classifiers=["tempotron"])
    assert answered.classifiers["tempotron"].bits > 0.9
