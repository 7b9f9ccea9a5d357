"""Learners that an earlier version pickled load, hold what was learnt, and go on."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np

from taxel import SpikeTrains
from taxel.learn import ConeR, ConeX

#: Made at commit f5f3a7d: (learner, its weights, what it predicted), one of each kind.
FILE = Path(__file__).parents[1] / "data/learners/fitted.pickle"


def test_learners_of_an_earlier_version_load_and_predict_what_they_did():
    trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0], []], stop=60.0)
    kept = pickle.loads(FILE.read_bytes())
    assert len(kept) == 14
    for learner, weights, predicted in kept:
        assert np.array_equal(np.asarray(learner.weights_), weights), learner
        again = learner.predict([trains])
        assert len(again) == len(predicted)
        for mine, theirs in zip(again, predicted, strict=True):
            assert np.allclose(mine, theirs, rtol=0, atol=1e-9), learner
        if isinstance(learner, ConeX | ConeR):
            assert learner.fit([trains], [[20.0]]).status_ == "solved"
