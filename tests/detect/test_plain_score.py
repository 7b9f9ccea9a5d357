"""The plain rules beside a readout: as tuned and run one by one, and stored with it."""

from dataclasses import replace

import numpy as np
import pytest
from plain_rules import played
from touching import pressed

import taxel
from taxel.detect import Example, Fold, Part, Recipe, judge, run, score, tune
from taxel.encode import ContactArea

pytestmark = pytest.mark.usefixtures("undrawn")

RECIPE = Recipe(
    ContactArea(),
    {"tau": 0.5, "refractory": 15.0, "after_spike": "reset", "lb": 0.0, "ub": 3.0, "delay_ms": 0.1, "step_ms": 0.1},
    align=True,
)


@pytest.fixture(scope="module")
def examples() -> list[Example]:
    """Labels 100 us after the first event that they cause."""
    drawn = [played(seed, touches=6) for seed in range(3)]
    return [one._replace(labels={name: t + 400 for name, t in one.labels.items()}) for one in drawn]


def test_rules_are_tuned_on_the_training_part_of_each_fold_and_scored_on_its_tested_part(examples) -> None:
    judged = judge(examples, RECIPE, 3)
    missed = false = 0
    for k, held_out in enumerate(examples):
        rules = tune([one for n, one in enumerate(examples) if n != k], noise_floor=3.0)
        for name, rule in rules.items():
            counts = score(run(rule, held_out.source, tare=held_out.tare), {name: held_out.labels[name]})
            missed, false = missed + counts.missed, false + counts.false
    assert (judged.plain.together.missed, judged.plain.together.false) == (missed, false)
    assert judged.plain.together.events == judged.together.events == 36
    assert judged.plain.rules == tune(examples, noise_floor=3.0)
    assert judged.plain.lacks == ""


def test_there_is_no_rule_where_none_finds_anything_held_out() -> None:
    frames, truth = pressed(1, 6, begin_s=2.5)
    mixed = {"contact": np.r_[truth["contact"][:4], truth["lift"][4:]]}
    middle = float(truth["contact"][4] - 100_000)
    example = Example(frames, mixed, taxel.Tare.take(frames, stop_us=2_000_000))
    assert tune([example], noise_floor=3.0)["contact"] is not None
    recipe = replace(RECIPE, encoder=ContactArea(noise_floor=3.0))
    halves = [Part(0, stop=middle), Part(0, start=middle)]
    judged = judge([example], recipe, [Fold([halves[0]], [halves[1]]), Fold([halves[1]], [halves[0]])])
    assert (judged.plain.together.found, judged.plain.rules) == (0, {"contact": None})
    assert judged.by_rule == ()


def test_the_labels_own_rule_stands_apart(examples) -> None:
    """Where labels are thresholds of the area, its rules are none beside the neuron."""
    own = [one._replace(labels_of="area") for one in examples]
    judged = judge(own, RECIPE, 3)
    assert judged.plain.rules["hit"].quantity != "area"
    rules, scored = judged.plain.own
    assert rules["hit"].quantity == "area"
    assert scored["hit"].missed == scored["hit"].false == 0
    assert judged.plain.to_dict()["own"]["rules"]["hit"]["quantity"] == "area"
    assert tune(own, noise_floor=3.0) == judged.plain.rules
