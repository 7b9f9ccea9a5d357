"""Learners keep scikit-learn's manners, tried against scikit-learn itself; laws run over the registry of learners."""

import pickle
import warnings
from pathlib import Path

import manners
import numpy as np
import pytest
from manners import LEARNERS, examples
from refusal import refused

import taxel
from taxel import Events, Neuron, SpikeTrains
from taxel._base.parameters import described
from taxel.encode import ContactArea
from taxel.learn import ConeR, ConeX, OnlineConeR

sklearn = pytest.importorskip("sklearn")


def test_a_learner_has_a_file_in_each_place_and_nothing_is_left_out():
    root = Path(__file__).parents[2]
    files = {f.stem for f in (root / "python/taxel/learn").glob("*.py") if not f.stem.startswith("_")}
    kinds = {kind._kind for kind in LEARNERS.values()}
    assert kinds == files - {"certificate", "solution"}, (
        "python/taxel/learn/NAME.py with _kind NAME, a line in learn/__init__.py"
    )
    for name in kinds:
        assert (root / f"tests/learn/test_{name}.py").exists(), f"tests/learn/test_{name}.py"
        assert described(name)["defaults"]


@pytest.mark.parametrize("law", manners.LAWS)
@pytest.mark.parametrize("name", sorted(LEARNERS))
def test_a_learner_has_the_manners_of_scikit_learn(law, name):
    law(name)


def test_a_fit_goes_on_in_a_window_that_was_pickled():
    patterns, targets = examples()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        one = OnlineConeR(window=2, tolerance=1e-8).fit(patterns, targets)
        other = pickle.loads(pickle.dumps(one))
        moved = SpikeTrains(patterns[0].times, patterns[0].offsets, 0.0, 100.0)
        for learner in (one, other):
            learner.partial_fit(moved, [40.0])
    assert other.patterns_ == one.patterns_ == 2
    assert other.objective_ == pytest.approx(one.objective_, rel=2e-8)


def touches(seed, rate=3):
    """A board at rest, then a touch that spreads over some taxels; when it begins, ms."""
    random = np.random.default_rng(seed)
    array = taxel.Array(4, 4)
    begin = 300_000 + 1000 * int(random.integers(0, 300))
    t, x, y, value = [], [], [], []
    for moment, level in ((0, 50), (50_000, 50), *((begin + 2000 * k, 55 + 5 * k) for k in range(rate))):
        for n in range(16 if level == 50 else 10):
            t.append(moment)
            x.append(n % 4)
            y.append(n // 4)
            value.append(level)
    t.append(1_000_000)
    x.append(0)
    y.append(0)
    value.append(50)
    return Events(t, x, y, [True] * len(t), array=array, intensity=value), begin / 1000.0


def test_a_search_over_a_pipeline_finds_touches_in_recordings():
    """Recordings in, targets in their own ms, the rest taken from each: scikit-learn's own search, folds and all."""
    from sklearn.model_selection import GridSearchCV
    from sklearn.pipeline import Pipeline

    recordings, begins = map(list, zip(*(touches(seed) for seed in range(9)), strict=True))
    targets = [[begin + 5.0] for begin in begins]
    pipe = Pipeline([("encode", ContactArea(tare=0.2)), ("cone", ConeR(neuron=Neuron(refractory=20.0), lb=0.0))])
    grid = {"cone__neuron__tau": [1.0, 5.0], "cone__ub": [0.01, 3.0], "encode__levels": [(2, 4, 8)]}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        search = GridSearchCV(pipe, grid, cv=3, error_score="raise").fit(recordings, targets)
    assert search.best_score_ == 1.0
    assert search.best_params_["cone__ub"] == 3.0
    assert min(search.cv_results_["mean_test_score"]) < 0.5
    (spikes,) = search.predict(recordings[:1])
    assert np.abs(spikes - targets[0]).min() < 50.0
    assert search.score(recordings, targets) == 1.0


def test_tags_are_those_that_scikit_learn_asks_for():
    tags = sklearn.utils.get_tags(ConeX())
    assert tags.requires_fit
    assert tags.estimator_type is None


def test_a_fit_without_weights_says_so_where_it_is_used():
    trains = SpikeTrains.from_lists([[10.0], [20.0]], stop=100.0)
    cone = ConeX().fit([trains], [[5.0]])
    assert cone.status_ == "infeasible"
    for use in (lambda: cone.predict([trains]), lambda: cone.score([trains], [[5.0]])):
        with refused():
            use()
