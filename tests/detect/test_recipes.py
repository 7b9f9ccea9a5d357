"""Recipes: those that taxel ships say what they said when they were tuned, and files kept from then still load."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from taxel import Frames, ProblemError
from taxel.detect import Recipe, recipes
from taxel.encode import ContactArea

#: The results of each recipe at version 0.1, as files of that version.
KEPT = Path(__file__).parents[1] / "data" / "recipes"
FILES = sorted(KEPT.glob("*.json"))


def said(recipe: Recipe, label: str) -> tuple[str, float]:
    """Return a label's learner in full, and its delay."""
    learner, delay_ms = recipe.learner_of(label)
    return repr(learner), delay_ms


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_shipped_recipe_is_what_it_was(file: Path) -> None:
    then = Recipe.load(file)
    now = Recipe.load(file.stem, labels=list(then.neurons))
    assert now.encoder == then.encoder
    assert {label: said(now, label) for label in then.neurons} == {label: said(then, label) for label in then.neurons}
    assert now.run_threshold == then.run_threshold == 1.0


def test_counts_of_an_event_camera_have_their_recipe_whatever_window_and_label() -> None:
    for unit in ("events/2.5 ms", "on events/5 ms", "off events/5 ms"):
        frames = Frames(np.zeros((2, 3, 4)), [0, 1000], unit=unit)
        for labels in (["contact", "lift"], ["slip"], ["foot_off"], []):
            assert recipes.chosen(frames, labels)[0] == "event_counts"
    # A row of channels has no neighbours.
    assert recipes.chosen(Frames(np.zeros((2, 1, 4)), [0, 1000], unit="events/5 ms"))[0] == "gait_channel"


@pytest.mark.parametrize(
    ("labels", "inputs"),
    [
        (["grasp_begin", "Grasp end"], {"area"}),
        (["soft_press", "hard_press"], {"moments"}),
        (["contact", "heel contact"], {"area", "moments"}),
        (["soft", "hard"], {"moments"}),
    ],
)
def test_the_last_word_of_a_label_counts_where_one_label_alone_has_it(labels: list[str], inputs: set[str]) -> None:
    recipe = Recipe.load("touch", labels=labels)
    assert {recipe.inputs_of(label)[0] for label in labels} == inputs
    if labels[0] == "grasp_begin":
        assert said(recipe, "Grasp end") == said(Recipe.load("touch"), "lift")


def test_a_recipe_for_certain_labels_refuses_others(tmp_path: Path) -> None:
    (tmp_path / "certain.toml").write_text('fits = ["events"]\n[encoder]\nname = "fa1"\n[neurons.contact]\ntau = 2.0\n')
    with pytest.raises(
        ProblemError, match=r"recipe: is for contact, not for 'ball': .* the recipes are event_counts, gait_channel, "
    ):
        Recipe.load(tmp_path / "certain.toml", labels=["contact", "ball"])


def test_a_recipe_takes_every_option_of_its_learner_and_of_the_neuron() -> None:
    options = {"divide_c_by": "targets", "divide_d_by": "targets", "sides_b": "below", "sides_c": "below", "rearm": 0.3}
    for name, value in options.items():
        recipe = Recipe(ContactArea(), {"tau": 5.0}, {"contact": {name: value}})
        cone, _ = recipe.learner_of("contact")
        assert getattr(cone.neuron if name == "rearm" else cone, name) == value
    with pytest.raises(ProblemError, match="rearm is 2"):
        Recipe(ContactArea(), {"rearm": 2.0})
