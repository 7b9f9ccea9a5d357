"""A neuron that is trained to fire at an age of the touch needs a train that begins at that age."""

from __future__ import annotations

import pytest
from refusal import refused

import taxel
from taxel.detect import Recipe
from taxel.encode import Moments

ENCODER = Moments(levels=0, graded=True, ages_ms=[0.0, 5.0, 6.3])


@pytest.mark.parametrize("delay_ms", [0.0, 5.0, 6.3, 6.3004])
def test_a_delay_at_which_an_age_begins_is_trained(delay_ms: float) -> None:
    recipe = Recipe(ENCODER, {"delay_ms": 5.0}, {"large": {"delay_ms": delay_ms}, "small": {}})
    assert recipe.learner_of("large")[1] == delay_ms


def test_labels_that_a_recipe_does_not_name_are_refused_when_they_are_trained() -> None:
    recipe = Recipe(ENCODER, {"delay_ms": 5.5})
    two = taxel.Array(1, 2, pitch_mm=2.0)
    rest = taxel.Frames([[[50.0, 50.0]]] * 2, [0, 1000], unit="ticks", array=two)
    frames = [[[50.0, 50.0]]] * 5 + [[[90.0, 90.0]]] * 45
    touch = taxel.Frames(frames, range(0, 50_000, 1000), unit="ticks", array=two)
    example = taxel.detect.Example(touch, {"contact": [5_000]}, tare=taxel.Tare.take(rest))
    with refused():
        taxel.detect.fit([example], recipe)
    trained = taxel.detect.fit([example], Recipe(ENCODER, {"delay_ms": 5.0, "tau": 1.0, "ub": 2.0, "lb": -2.0}))
    found = taxel.detect.run(trained, touch, tare=example.tare)
    assert abs(found.t[0] - 5_000) <= 1000
