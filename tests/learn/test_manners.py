"""Learners keep scikit-learn's manners, tried against scikit-learn itself; laws run over the registry of learners."""

import copy
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import Events, Neuron, NotFittedError, SpikeTrains, learn
from taxel._base.parameters import Parameters, described
from taxel.encode import ContactArea
from taxel.learn import ConeR, ConeX, OnlineConeR

sklearn = pytest.importorskip("sklearn")

#: Arguments without defaults: the learners of taxel have none, the rules beside taxel, which are tried too, have.
GIVEN: dict[str, Any] = {}
LEARNERS = {
    name: kind
    for name, kind in vars(learn).items()
    if isinstance(kind, type) and issubclass(kind, Parameters) and not name.startswith("_")
}
each_learner = pytest.mark.parametrize("name", sorted(LEARNERS))


def make(name):
    from inspect import Parameter, signature

    asked = signature(LEARNERS[name]).parameters.values()
    return LEARNERS[name](**{p.name: GIVEN[p.name] for p in asked if p.default is Parameter.empty})


def examples(shift=0.0):
    """Two patterns of forty trains, and targets; of the Tempotron, labels."""
    random = np.random.default_rng(3)
    patterns = [
        SpikeTrains.from_lists(np.sort(random.uniform(0, 80, (40, 3))) + shift, start=shift, stop=100.0 + shift)
        for _ in range(2)
    ]
    return patterns, [[50.0 + shift], [60.0 + shift]]


def fitted(name, shift=0.0):
    patterns, targets = examples(shift)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return make(name).fit(patterns, [True, False] if name == "Tempotron" else targets), patterns


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


@each_learner
def test_a_clone_has_the_same_parameters_and_nothing_learnt(name):
    one, _ = fitted(name)
    other = sklearn.base.clone(one)
    assert other.get_params() == one.get_params()
    assert repr(other) in repr(one)
    assert not hasattr(other, "weights_")
    with refused(NotFittedError):
        other.predict([])


@each_learner
def test_what_was_learnt_survives_a_copy_and_a_pickle(name):
    one, patterns = fitted(name)
    for other in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert np.array_equal(other.weights_, one.weights_)
        for here, there in zip(other.predict(patterns), one.predict(patterns), strict=True):
            assert np.array_equal(here, there)


@each_learner
def test_weights_that_are_assigned_have_no_verdict_of_the_fit_and_a_new_fit_has_its_own(name):
    learner, patterns = fitted(name)
    before = {key: value for key, value in vars(learner).items() if key in ("status_", "gap_", "objective_")}
    copied = copy.copy(learner)
    copied.weights_ = 0.9 * learner.weights_
    assert {key: value for key, value in vars(learner).items() if key in before} == before, "the fit stays as it was"
    if "status_" not in before:
        assert not hasattr(copied, "status_")
        return
    assert copied.status_ == "assigned"
    assert not {"gap_", "objective_", "parts_", "violation_", "margin_", "reason_"} & vars(copied).keys()
    assert "solved" not in repr(copied)
    assert len(copied.predict(patterns)) == len(patterns)
    if "gap_" in before:
        copied.weights_ *= 1.1
        assert copied.status_ == "assigned"
        assert copied.fit(*examples()).status_ == before["status_"]
        assert copied.gap_ <= copied.tolerance


#: The learners that read the values of graded trains; all others refuse them.
READ_VALUES = {"ConeR", "ConeX", "OnlineConeR"}


@each_learner
def test_scores_lie_between_0_and_1_and_predictions_are_spikes(name):
    one, patterns = fitted(name)
    if name == "Tempotron":
        assert one.score(patterns, one.predict(patterns)) == 1.0
        return
    spikes = one.predict(patterns)
    assert [type(times) for times in spikes] == [np.ndarray] * 2
    assert 0.0 <= one.score(patterns, examples()[1]) <= 1.0
    # The learner's own prediction must agree with the score.
    assert one.score(patterns, spikes, window_ms=0.0) == 1.0
    assert one.score(patterns, [[1.0], [1.0]], window_ms=0.0) == 0.0


@each_learner
def test_values_are_read_or_graded_trains_are_refused_by_name(name):
    patterns, targets = examples()
    graded = [
        SpikeTrains(p.times, p.offsets, p.start, p.stop, np.full(len(p.times), 0.5), kind="graded") for p in patterns
    ]
    targets = [True, False] if name == "Tempotron" else targets
    one, plain = fitted(name)
    # Some learners have more methods that read patterns.
    calls = {
        "fit": lambda: make(name).fit(graded, targets),
        "fit one": lambda: make(name).fit([patterns[0], graded[1]], targets),
        "predict": lambda: one.predict(graded),
        "score": lambda: one.score(graded, targets),
    }
    if hasattr(one, "change"):
        calls["change"] = lambda: one.change(one.weights_, graded[0], targets[0])
        calls["change in silence"] = lambda: one.change(one.weights_, graded[0], False if name == "Tempotron" else [])
    if name == "Tempotron":
        calls["peak"] = lambda: one.peak(one.weights_, graded[0])
    for method in ("rows", "output", "partial_fit"):
        if hasattr(one, method) and name not in READ_VALUES:
            calls[method] = lambda method=method: getattr(one, method)(graded[0])
    if name in READ_VALUES:
        assert not all(np.array_equal(a, b) for a, b in zip(one.predict(graded), one.predict(plain), strict=True))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            assert not np.array_equal(make(name).fit(graded, targets).weights_, one.weights_, equal_nan=True)
        return
    for run in calls.values():
        with refused():
            run()


@each_learner
@pytest.mark.parametrize("shift", [1000.0, 1e9])
def test_moved_in_time_it_learns_the_same(name, shift):
    here, _ = fitted(name)
    there, _ = fitted(name, shift)
    assert there.weights_ == pytest.approx(here.weights_, abs=2e-4 * np.abs(here.weights_).max())


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


def test_tags_are_asked_by_scikit_learn_alone():
    tags = sklearn.utils.get_tags(ConeX())
    assert tags.requires_fit
    assert tags.estimator_type is None
    code = "import sys, taxel; taxel.learn.ConeX(); assert not any(name.startswith('sklearn') for name in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_a_fit_without_weights_says_so_where_it_is_used():
    trains = SpikeTrains.from_lists([[10.0], [20.0]], stop=100.0)
    cone = ConeX().fit([trains], [[5.0]])
    assert cone.status_ == "infeasible"
    for use in (lambda: cone.predict([trains]), lambda: cone.score([trains], [[5.0]])):
        with refused():
            use()
