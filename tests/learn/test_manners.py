"""Learners keep scikit-learn's manners, tried against scikit-learn itself; laws run over the registry of learners."""

import pickle
import warnings
from pathlib import Path

import manners
import pytest
from manners import LEARNERS, examples
from refusal import refused

from taxel import SpikeTrains
from taxel._base.parameters import described
from taxel.learn import ConeX, OnlineConeR

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
