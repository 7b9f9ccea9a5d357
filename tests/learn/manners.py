"""Manners of every learner: each law takes the name of one."""

import copy
import pickle
import warnings
from typing import Any

import numpy as np
import pytest
from refusal import refused

from taxel import NotFittedError, SpikeTrains, learn
from taxel._base.parameters import Parameters

sklearn = pytest.importorskip("sklearn")

#: Arguments without defaults: the learners of taxel have none, the rules beside taxel, which are tried too, have.
GIVEN: dict[str, Any] = {}


LEARNERS = {
    name: kind
    for name, kind in vars(learn).items()
    if isinstance(kind, type) and issubclass(kind, Parameters) and not name.startswith("_")
}


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


def a_clone_has_the_same_parameters_and_nothing_learnt(name):
    one, _ = fitted(name)
    other = sklearn.base.clone(one)
    assert other.get_params() == one.get_params()
    assert repr(other) in repr(one)
    assert not hasattr(other, "weights_")
    with refused(NotFittedError):
        other.predict([])


def what_was_learnt_survives_a_copy_and_a_pickle(name):
    one, patterns = fitted(name)
    for other in (copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert np.array_equal(other.weights_, one.weights_)
        for here, there in zip(other.predict(patterns), one.predict(patterns), strict=True):
            assert np.array_equal(here, there)


def weights_that_are_assigned_have_no_verdict_of_the_fit_and_a_new_fit_has_its_own(name):
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


def scores_lie_between_0_and_1_and_predictions_are_spikes(name):
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


def values_are_read_or_graded_trains_are_refused_by_name(name):
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


def moved_in_time_it_learns_the_same(name):
    here, _ = fitted(name)
    for shift in (1000.0, 1e9):
        there, _ = fitted(name, shift)
        assert there.weights_ == pytest.approx(here.weights_, abs=2e-4 * np.abs(here.weights_).max())


LAWS = [
    a_clone_has_the_same_parameters_and_nothing_learnt,
    what_was_learnt_survives_a_copy_and_a_pickle,
    weights_that_are_assigned_have_no_verdict_of_the_fit_and_a_new_fit_has_its_own,
    scores_lie_between_0_and_1_and_predictions_are_spikes,
    values_are_read_or_graded_trains_are_refused_by_name,
    moved_in_time_it_learns_the_same,
]
