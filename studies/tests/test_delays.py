"""The study of delays: the inputs of each arm, and that weights chosen among copies fire at the targets."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel_studies import delays
from taxel_studies.capacity import patterns
from taxel_studies.mapping import LEARN, TABLE

PARAMS = {"inputs": 40, "classes": 3, "longest_ms": 90.0, "time": "continuous", "arm": "none"}


def delayed(arm: str, seed: int = 3) -> list:
    return delays.delayed({**PARAMS, "arm": arm}, patterns(seed, 40, 4, 3)[0], seed)


@pytest.mark.parametrize("arm", ["none", "4 copies"])
def test_what_l1_chooses_fires_at_the_targets_and_nowhere_else(arm: str) -> None:
    params = {**PARAMS, "inputs": 60, "arm": arm}
    cone = delays.fit(params, 9, 1, (1.0, 0.0, 0.0))
    assert cone.status_ == "solved"
    drawn, targets = patterns(1, 60, 9, 3)
    for pattern, target in zip(delays.delayed(params, drawn, 1), targets, strict=True):
        fired = cone.neuron_.run(cone.weights_, pattern.between(0.0, 200.0))
        assert len(fired) == 1
        assert abs(fired[0] - target[0]) < 1e-6
    result = delays.realise({**params, "asks": "weights", "share": 0.15}, 1)
    assert result["weights"] == np.count_nonzero(np.abs(cone.weights_) > delays.NONE)
    assert result["heard"] <= result["weights"] < len(cone.weights_)


def test_decays_of_one_kind_leave_the_weights_that_cone_leaves_on_the_grid() -> None:
    params = {"inputs": 60, "classes": 3, "share": 0.15, "asks": "decays", "taus_ms": [TABLE["tau"]]}
    cone = ConeX(neuron=Neuron(**TABLE, time="grid"), **LEARN, lambdas=(1.0, 0.0, 0.0), horizon=200.0, margin=0.0)
    cone.fit(*patterns(1, 60, 9, 3))
    result = delays.realise(params, 1)
    assert result == {"p": 9, "solved": True, "weights": result["heard"], "heard": result["weights"]}
    assert result["weights"] == np.count_nonzero(np.abs(cone.weights_) > delays.NONE)
    more = delays.realise({**params, "taus_ms": [7.5, TABLE["tau"], 30.0]}, 1)
    assert more["solved"]
    assert more["heard"] <= more["weights"]
