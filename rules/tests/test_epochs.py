"""What all rules that learn by epochs share: the order of things, seeds, stopping, keeping the best."""

import numpy as np
import pytest
from interrupts import ctrl_c_after
from rule_examples import is_right, patterns

from taxel_rules import FILT, FP, HTP, INST, PSD, SPAN, Chronotron, ReSuMe

GIVEN = {"epochs": 30, "initial": (0.0, 1.0), "updates": "pattern"}
NEURON = {"tau": 10.0, "tau_s": 5.0, "theta_0": 15.0}
RULES = {
    "INST": lambda **o: INST(**{"epochs": 30, **o}),
    "FILT": lambda **o: FILT(**{"epochs": 30, **o}),
    "E": lambda **o: Chronotron(rule="E", **{"eta": 0.1, **GIVEN, **NEURON, **o}),
    "I": lambda **o: Chronotron(rule="I", **{"eta": 0.1, **GIVEN, **NEURON, **o}),
    "ReSuMe": lambda **o: ReSuMe(**{"eta": 0.1, **GIVEN, **NEURON, **o}),
    "SPAN": lambda **o: SPAN(**{"tau_a": 5.0, "eta": 0.01, **GIVEN, **NEURON, **o}),
    "PSD": lambda **o: PSD(**{"eta": 0.1, **GIVEN, "theta_0": 5.0, **o}),
    "FP": lambda **o: FP(**{"window_ms": 1.0, "eta": 0.1, **GIVEN, **NEURON, **o}),
    "HTP": lambda **o: HTP(**{"window_ms": 0.5, "eta": 0.1, **GIVEN, **NEURON, **o}),
}


@pytest.mark.parametrize("name", RULES)
def test_a_batch_epoch_adds_up_what_each_pattern_asks(name):
    shown, wanted = patterns(1, targets=2)
    learner = RULES[name](updates="batch", epochs=1, until_right=False)
    start = np.random.default_rng(1).uniform(0, 2, 40)
    trained = learner.fit(shown, wanted, start=start)
    asked = sum(learner.change(start, p, t)[0] for p, t in zip(shown, wanted, strict=True))
    eta = learner.eta if learner.eta is not None else 600 / (40 * 6)
    after = RULES[name](updates="batch", epochs=0).fit(shown, wanted, start=start + eta * asked)
    assert np.any(asked != 0)
    assert trained.right_[1] == after.right_[0]
    assert trained.best_epoch_ == 1  # of weights that are right equally often the latest are kept
    assert trained.weights_ == pytest.approx(start + eta * asked, rel=1e-12)


@pytest.mark.parametrize("name", RULES)
def test_a_pattern_epoch_adds_what_each_asks_of_the_weights_that_it_meets(name):
    """Whichever order is drawn, the weights are those of one of the orders."""
    shown, wanted = patterns(2, count=2)
    learner = RULES[name](updates="pattern", epochs=1, until_right=False)
    start = np.random.default_rng(2).uniform(0, 2, 40)
    eta = learner.eta if learner.eta is not None else 600 / (40 * 2)
    ends = []
    for order in ((0, 1), (1, 0)):
        weights = start.copy()
        for p in order:
            weights = weights + eta * learner.change(weights, shown[p], wanted[p])[0]
        ends.append(weights)
    trained = learner.fit(shown, wanted, start=start)
    assert trained.best_epoch_ == 1
    assert any(trained.weights_ == pytest.approx(end, rel=1e-12) for end in ends)


@pytest.mark.parametrize("name", RULES)
def test_the_same_seed_gives_the_same_bits_and_another_seed_another_order(name):
    shown, wanted = patterns(3, count=6)
    first, again, other = (RULES[name](updates="pattern", seed=s).fit(shown, wanted) for s in (1, 1, 2))
    assert first.weights_.tobytes() == again.weights_.tobytes()
    assert first.right_.tobytes() == again.right_.tobytes()
    assert not np.array_equal(first.weights_, other.weights_)


@pytest.mark.parametrize("name", RULES)
def test_the_share_right_is_that_of_the_kept_weights(name):
    shown, wanted = patterns(4, count=4)
    learner = RULES[name]().fit(shown, wanted)
    share = np.mean([is_right(t, f) for t, f in zip(wanted, learner.predict(shown), strict=True)])
    assert share == learner.right_.max() == learner.right_[learner.best_epoch_]
    assert (learner.status_ == "right") == (learner.right_[-1] == 1.0)
    assert len(learner.right_) == learner.epochs_ + 1


@pytest.mark.parametrize("name", ["INST", "FILT", "E", "ReSuMe", "SPAN", "PSD", "FP", "HTP"])
def test_every_rule_learns_one_easy_pattern(name):
    shown, wanted = patterns(5, trains=100, count=1)
    assert RULES[name](epochs=500).fit(shown, wanted).status_ == "right"


@pytest.mark.parametrize("name", RULES)
def test_where_spikes_are_at_the_targets_nothing_changes(name):
    (pattern,), wanted = patterns(6, trains=100, count=1)
    learner = RULES[name](epochs=500, step_ms=0.1)
    weights = np.random.default_rng(6).uniform(0, 3, 100)
    fired = learner.change(weights, pattern, wanted[0])[1]
    assert len(fired) > 0
    change, again = learner.change(weights, pattern, fired)
    assert list(again) == list(fired)
    if name != "HTP":  # it forces spikes at the targets: two on the grid may come from one stretch above the threshold
        assert change == pytest.approx(np.zeros(100), abs=1e-12)


def test_control_c_stops_at_once_and_keeps_the_best_so_far():
    shown, wanted = patterns(8, count=40)
    learner = INST(epochs=10**9, until_right=False)
    with ctrl_c_after(0.3, answered_within=60):
        learner.fit(shown, wanted)
    assert learner.status_ == "stopped"
    assert learner.weights_.shape == (40,)
    assert learner.right_[learner.best_epoch_] == learner.right_.max()


def test_the_neuron_is_a_taxel_neuron_where_it_forgets_at_a_spike():
    shown, wanted = patterns(11, trains=100, targets=2)
    learner = FP(window_ms=1.0, eta=0.1, **{**GIVEN, "epochs": 5}, **NEURON).fit(shown, wanted)
    for pattern, fired in zip(shown, learner.predict(shown), strict=True):
        assert learner.neuron_.run(learner.weights_, pattern) == pytest.approx(fired, abs=1e-9)
    assert INST(epochs=1).fit(shown, wanted).neuron_ is None
