"""The comparison of rules that learn times: protocols, search, summary."""

import numpy as np
import pytest

from taxel_rules import INST
from taxel_studies.rivals import protocols
from taxel_studies.rivals.protocols import gardner_gruning, realise, thesis
from taxel_studies.rivals.rules import RULES, learner


@pytest.mark.parametrize("draw", [gardner_gruning, thesis])
def test_a_larger_load_begins_with_the_patterns_of_a_smaller_one(draw):
    few, many = draw(3, 20, 10), draw(3, 20, 25)
    assert many[0][:10] == few[0]
    assert many[1][:10] == few[1]
    assert draw(4, 20, 10)[0] != few[0]


def test_patterns_and_targets_are_those_of_the_protocols():
    for seed in range(20):
        patterns, targets = gardner_gruning(seed, 30, 10)
        at = np.sort([t[0] for t in targets[:5]])
        assert at.min() >= 40
        assert at.max() <= 200
        assert np.diff(at).min() >= 7
        assert all(len(train) == 1 and 0 <= train[0] <= 200 for train in patterns[0])
    patterns, targets = thesis(1, 500, 10)
    assert [t[0] for t in targets[:5]] == pytest.approx([200 * c / 6 for c in range(1, 6)])
    times = np.concatenate(list(patterns[0]))
    assert np.array_equal(times, times.round())
    assert (times.min(), times.max()) == (1, 200)


def test_the_published_rate_is_what_inst_takes_by_itself():
    given = learner("INST", "a", 200, 15, 0, epochs=1)
    assert given.eta == pytest.approx(600 / (200 * 15))
    assert given.initial == (0.0, 200 / 200)
    assert INST(epochs=1).after_spike == given.after_spike == "subtract"


@pytest.mark.parametrize(("most", "begin"), [(40, 20), (40, 60), (0, 30), (40, 40)])
@pytest.mark.parametrize("protocol", ["a", "b"])
def test_the_search_ends_at_the_largest_load_that_holds(monkeypatch, most, begin, protocol):
    looked = []

    def share(_params, count, seed):
        looked.append((count, seed))
        return 1.0 if count <= most else 0.85

    monkeypatch.setattr(protocols, "share_right", share)
    inputs = round(begin / RULES["FILT"].begin)
    found = realise(
        {"rule": "FILT", "protocol": protocol, "inputs": inputs, f"runs_{protocol}": 3, f"epochs_{protocol}": 1}, 0
    )
    assert found["p"] == most
    assert found["load"] == round(most / inputs, 4)
    failed = [entry for entry in found["tried"] if entry[0] > most]
    assert all(runs == (1 if protocol == "b" else 3) for _, runs, _, _ in failed)
    assert {count for count, _ in looked} == {entry[0] for entry in found["tried"]}
