"""What is judged was not trained on, each thing is judged once, and the better point is chosen."""

import dataclasses
import warnings

import numpy as np
import pytest
from test_readout import recipe, tare, touches

import taxel
from taxel.detect import Example, choose, judge, run, score, train
from taxel.detect.folds import _folds as folds


def examples(*seeds: int) -> list[Example]:
    return [Example(*touches(seed), tare()) for seed in seeds]


def test_whole_recordings_are_judged_by_what_was_trained_on_the_others() -> None:
    data = examples(1, 2, 9)
    judged = judge(data, recipe(), 3, window_ms=10.0)
    assert judged.how == "whole recordings, 3 folds"
    for n, example in enumerate(data):
        readout = train([one for k, one in enumerate(data) if k != n], recipe())
        by_hand = score(run(readout, example.source, tare=example.tare), example.labels, 10.0)
        assert judged.scores[n].to_dict() == by_hand.to_dict()
    counts = ("events", "found", "missed", "false")
    for name in counts:
        assert getattr(judged.together, name) == sum(getattr(one, name) for one in judged.scores)
    assert judged.together.found == judged.together.events > 0


@pytest.mark.parametrize("k", [2, 3])
def test_of_one_recording_each_event_is_judged_once_by_what_never_heard_it(k: int) -> None:
    (data,) = examples(9)
    ways, how = folds([data], k)
    assert how == f"{k} blocks of time"
    events = np.sort(np.concatenate(list(data.labels.values())))
    held = [(stretch.start, stretch.stop) for way in ways for stretch in way.test]
    assert [sum(start <= t < stop for start, stop in held) for t in events] == [1] * len(events)
    sizes = [int(np.count_nonzero((events >= start) & (events < stop))) for start, stop in held]
    assert 2 * k * min(sizes) >= len(events), "about equally many"
    for way in ways:
        (out,) = way.test
        assert all(stretch.stop <= out.start or stretch.start >= out.stop for stretch in way.train)
    judged = judge([data], recipe(), k, window_ms=10.0)
    assert judged.together.events == len(events)
    assert judged.together.missed == 0


def test_a_point_that_finds_nothing_is_not_chosen() -> None:
    plan = recipe()
    neurons = {
        label: {**own, "ub": 1e-6, "search": [{"ub": own.get("ub", 3.0)}]} for label, own in plan.neurons.items()
    }
    silent = dataclasses.replace(plan, neurons=neurons)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of readouts that nobody keeps nothing is said
        best = choose(examples(1, 2), silent, window_ms=10.0)
    assert {label: own["ub"] for label, own in best.neurons.items()} == dict.fromkeys(plan.neurons, 3.0)
    assert judge(examples(1, 9), best, 2, window_ms=10.0).together.missed == 0


def test_events_out_of_reach_are_named_by_label_time_and_example() -> None:
    data = examples(1, 2)
    plan = recipe()
    neurons = {label: {**own, "ub": 1e-6} for label, own in plan.neurons.items()}
    with pytest.warns(UserWarning, match="out of reach") as caught:
        train(data, dataclasses.replace(plan, neurons=neurons))
    for label in plan.neurons:
        (said,) = [str(one.message) for one in caught if str(one.message).startswith(f"{label}: ")]
        first = data[0].labels[label][0] / 1000.0
        count = sum(len(example.labels[label]) for example in data)
        assert said.startswith(f"{label}: {count} of {count} events are out of reach")
        assert f"({first:.10g} ms of example 0, " in said
        assert "pattern" not in said


def test_the_first_of_equal_points_is_kept() -> None:
    plan = recipe()
    same = {label: {**own, "search": [dict(own)]} for label, own in plan.neurons.items()}
    best = choose(examples(1, 2), dataclasses.replace(plan, neurons=same))
    assert best.neurons == {label: dict(own) for label, own in plan.neurons.items()}


def test_more_folds_than_there_are_recordings_or_events_are_refused() -> None:
    with pytest.raises(taxel.ProblemError, match="folds is 3: must be 2 to 2, the number of recordings"):
        judge(examples(1, 2), recipe(), 3)
    with pytest.raises(taxel.ProblemError, match="has room for"):
        judge(examples(1), recipe(), 100)


def test_every_recipe_lists_points_that_its_learner_knows() -> None:
    for name in taxel.detect.recipes.names():
        plan = taxel.detect.Recipe.load(name, labels=["contact"])
        assert len(plan.points_of("contact")) > 1, name
