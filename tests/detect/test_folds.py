"""What is judged was not trained on, each thing is judged once, and the better point is chosen."""

import dataclasses
import warnings

import numpy as np
import pytest
from discs import recipe, tare, touches

import taxel
from taxel.detect import Example, Fold, Part, Score, fit, judge, run, score
from taxel.detect.folds import count_of_folds
from taxel.detect.folds import folds_of as folds


def examples(*seeds: int) -> list[Example]:
    return [Example(*touches(seed), tare()) for seed in seeds]


def test_whole_recordings_are_judged_by_what_was_trained_on_the_others() -> None:
    data = examples(1, 2, 9)
    judged = judge(data, recipe(), 3, window_ms=10.0)
    assert judged.how == "whole recordings, 3 folds"
    by_hand = []
    for n, example in enumerate(data):
        readout = fit([one for k, one in enumerate(data) if k != n], recipe())
        by_hand.append(score(run(readout.using("neuron"), example.source, tare=example.tare), example.labels, 10.0))
    errors = np.concatenate([one.errors_ms for one in by_hand])
    assert np.sort(judged.neurons.errors_ms).tolist() == np.sort(errors).tolist()
    for name in ("missed", "false"):
        assert getattr(judged.neurons, name) == sum(getattr(one, name) for one in by_hand)
    counts = ("events", "found", "missed", "false")
    for name in counts:
        assert getattr(judged.together, name) == sum(getattr(one, name) for one in judged.scores)
    assert judged.together.found == judged.together.events > 0


@pytest.mark.parametrize("k", [2, 3])
def test_of_one_recording_each_event_is_judged_once_by_what_never_heard_it(k: int) -> None:
    (data,) = examples(9)
    ways, how = folds([data], k)
    assert how == f"{k} blocks of time of one recording"
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


def labelled(*counts: dict[str, int], gap_us: int = 200_000) -> list[Example]:
    """Give examples with so many labels each, one label name after the other in turn."""
    made = []
    for names in counts:
        times: dict[str, list[int]] = {name: [] for name in names}
        for k in range(max(names.values(), default=0)):
            for n, name in enumerate(names):
                if k < names[name]:
                    times[name].append(k * gap_us + n * 20_000)
        spikes = taxel.SpikeTrains.from_lists([[]], stop=1e9)
        made.append(Example(spikes, {name: np.array(t, np.int64) for name, t in times.items()}))
    return made


@pytest.mark.parametrize(
    ("examples", "count", "why"),
    [
        (labelled({"contact": 25, "lift": 25}), 5, ""),
        (labelled({"contact": 25, "lift": 25}, gap_us=3_600_000_000), 5, ""),
        (labelled({"contact": 25, "lift": 7}), 3, ""),
        (labelled({"contact": 60, "lift": 7}), 0, "all events lift are in the same stretch of the recording"),
        (labelled({"contact": 4}), 2, ""),
        (labelled({"contact": 3}), 0, "3 labels of contact, but two folds need 4"),
        (labelled({"contact": 20, "ball": 1}), 0, "1 label of ball, but two folds need 4"),
        (labelled(*[{"contact": 3, "lift": 3}] * 9), 5, ""),
        (labelled(*[{"contact": 9}] * 3), 3, ""),
        (labelled({"contact": 2}, {"contact": 2}, {}), 2, ""),
        (labelled({"contact": 9, "lift": 9}, {"contact": 9}), 0, "all events lift are in the same recording"),
        (labelled({"contact": 1}, {"contact": 2}), 0, "3 labels of contact, but two folds need 4"),
    ],
)
def test_folds_are_as_many_as_recordings_and_the_rarest_label_allow(
    examples: list[Example], count: int, why: str
) -> None:
    assert count_of_folds(examples) == (count, why)


def test_what_is_far_from_the_labels_is_not_scored_where_a_recipe_says_so() -> None:
    *data, last = examples(1, 2, 9)
    middle = last._replace(labels={name: times[2:-2] for name, times in last.labels.items()})
    around = dataclasses.replace(recipe(), around_labels_ms=5.0)
    fold = Fold([Part(0), Part(1)], [Part(2)])
    near, all_of_it = (judge([*data, middle], plan, [fold], window_ms=10.0).neurons for plan in (around, recipe()))
    assert (near.missed, near.false) == (0, 0)
    assert all_of_it.false == sum(len(times) for times in last.labels.values()) - near.events == 8


def test_a_point_that_finds_nothing_is_not_chosen() -> None:
    plan = recipe()
    neurons = {
        label: {**own, "ub": 1e-6, "choose": [{"ub": own.get("ub", 3.0)}]} for label, own in plan.neurons.items()
    }
    silent = dataclasses.replace(plan, neurons=neurons)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # readouts that are not chosen must not warn
        judged = judge(examples(1, 2), silent, 2, window_ms=10.0)
    for made in judged.trained:
        assert {label: own["ub"] for label, own in made.recipe.neurons.items()} == dict.fromkeys(plan.neurons, 3.0)
    assert judged.together.missed == 0


def test_events_that_cannot_be_learnt_are_named_by_label_time_and_example() -> None:
    data = examples(1, 2)
    plan = recipe()
    neurons = {label: {**own, "ub": 1e-6} for label, own in plan.neurons.items()}
    with pytest.warns(UserWarning, match="cannot be learnt") as caught:
        fit(data, dataclasses.replace(plan, neurons=neurons))
    for label in plan.neurons:
        (said,) = [str(one.message) for one in caught if str(one.message).startswith(f"{label}: ")]
        first = data[0].labels[label][0] / 1000.0
        count = sum(len(example.labels[label]) for example in data)
        assert said.startswith(f"{label}: {count} of {count} events cannot be learnt")
        assert f"({first:.10g} ms of example 0, " in said
        assert "pattern" not in said


def test_a_point_that_the_labels_do_not_allow_is_not_chosen() -> None:
    """Two labels lie within its refractory time."""
    plan = recipe()
    neurons = {label: {**own, "choose": [{"refractory": 9000.0}]} for label, own in plan.neurons.items()}
    judged = judge(examples(1, 2), dataclasses.replace(plan, neurons=neurons), 2, window_ms=10.0)
    for made in judged.trained:
        for label in plan.neurons:
            assert made.recipe.learner_of(label)[0].neuron == plan.learner_of(label)[0].neuron, label
    first = {label: {**own, "refractory": 9000.0, "choose": [dict(own)]} for label, own in plan.neurons.items()}
    with pytest.raises(
        taxel.ProblemError,
        match=r"contact: .* has a label at \d+ us, \d+ us after .*; labels must be more than 9000 ms",
    ):
        judge(examples(1, 2), dataclasses.replace(plan, neurons=first), 2)


def test_folds_that_are_stated_are_those_that_are_judged() -> None:
    data = examples(1, 2, 9)
    stated = [Fold([Part(k) for k in range(3) if k != n], [Part(n)]) for n in range(3)]
    by_number, by_data = judge(data, recipe(), 3, window_ms=10.0), judge(data, recipe(), stated, window_ms=10.0)
    assert [one.to_dict() for one in by_data.scores] == [one.to_dict() for one in by_number.scores]
    assert by_data.how == "3 given folds"
    for fold, made in zip(stated, by_data.trained, strict=True):
        alone = fit([data[part.example] for part in fold.train], recipe(), window_ms=10.0)
        assert made.readout == alone
        assert set(made.learners) == {"contact", "lift"}


@pytest.mark.parametrize(
    ("stated", "complaint"),
    [
        ([], "folds is empty"),
        ([Fold([Part(0)], [])], "fold 0 is .* must be a Fold with parts to train on and parts to test"),
        ([Fold([Part(0)], [Part(2)])], "not a Part of 2 examples"),
        ([Fold([Part(0)], [Part(1, 5.0, 5.0)])], "must start before it stops"),
        ([Fold([Part(0)], [Part(1)]), Fold([Part(0)], [Part(1, 0.0, 9.0)])], "fold 1: .* is tested twice"),
        ([((0,), (1,))], "must be a Fold"),
    ],
)
def test_folds_that_make_no_sense_are_refused(stated: list[Fold], complaint: str) -> None:
    with pytest.raises(taxel.ProblemError, match=complaint):
        judge(examples(1, 2), recipe(), stated)


def test_the_better_rank_misses_less_and_then_lies_nearer() -> None:
    def ranked(*times: int) -> Score:
        found = taxel.Detections(["a"] * len(times), list(times), list(times))
        return score(found, {"a": [10_000, 20_000]}, 5.0)

    order = [ranked(10_000, 20_000), ranked(10_500, 20_000), ranked(10_000), ranked()]
    assert [one.rank[0] for one in order] == [0, 0, 1, 2]
    assert sorted(order, key=lambda one: one.rank) == order
    assert ranked(11_000, 20_000).rank[1] == pytest.approx(np.sqrt(0.5))
    assert ranked().rank[1] == np.inf
