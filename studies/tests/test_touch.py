"""The study of touch: its parts on cases with known answers, and the recipe that it shows."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel.detect import Recipe, recipes
from taxel_studies import touch, touch_rivals


def test_the_discriminant_finds_the_direction_of_two_clouds() -> None:
    """With equal covariances the best direction is known; more dimensions than samples do little harm."""
    rng = np.random.default_rng(1)
    classes = np.arange(200) % 2
    move = np.zeros(400)
    move[:4] = 3.0

    def cloud(of: np.ndarray) -> np.ndarray:
        return (rng.normal(size=(len(of), 400)) + np.outer(of, move)).astype(np.float32)

    tell, new = touch_rivals.lda(cloud(classes), classes), cloud(classes)
    best = ((new - move / 2) @ move > 0) == classes
    assert np.mean(tell(new) == classes) > np.mean(best) - 0.1
    for kind in (0, 1):
        assert np.mean(tell(cloud(np.full(2000, kind))) == kind) > 0.85


def test_the_discriminant_knows_at_other_places_what_it_learnt_at_some() -> None:
    """Two sizes of touch, learnt on the upper half of the array, are told apart on the lower half and at its edge."""
    rng = np.random.default_rng(3)
    kinds = np.arange(60) % 2
    rows, columns = np.indices((64, 64))

    def felt(rows_from: float, rows_to: float) -> taxel.Frames:
        values = []
        for kind in kinds:
            row, column = rng.uniform(rows_from, rows_to), rng.uniform(0, 63)
            away = (rows - row) ** 2 + (columns - column) ** 2
            value = 20.0 * np.maximum(1 - away / (9.0 + 20.0 * kind), 0) + rng.normal(0, 0.3, away.shape)
            values.append(value)
        return taxel.Frames(values, np.arange(len(kinds)), unit="ticks")

    tell = touch_rivals.lda(touch_rivals.around(felt(0, 30)), kinds)
    assert np.mean(tell(touch_rivals.around(felt(34, 63))) == kinds) > 0.9


def test_the_frame_around_a_touch_has_its_centre_in_the_middle_and_nothing_beyond_the_edge() -> None:
    values = np.zeros((3, 20, 40))
    values[0, 3:6, 30:33] = 9.0
    values[1, 0, 0] = 9.0
    values[2, 10, 20] = 3.0  # not loaded: the middle of the array is used
    inside, corner, nothing = touch_rivals.around(taxel.Frames(values, [0, 1, 2], unit="ticks")).reshape(3, 16, 16)
    assert np.argwhere(inside).mean(axis=0).tolist() == [8.0, 8.0]
    assert np.count_nonzero(inside) == 9
    assert np.argwhere(corner).tolist() == [[8, 8]]
    assert np.argwhere(nothing).tolist() == [[8, 8]]


def test_the_best_rule_is_the_feature_that_differs() -> None:
    rng = np.random.default_rng(2)
    kinds = np.arange(40) % 2
    sets = []
    for _ in range(2):
        values = np.full((40, 4, 4), 10.0)
        values[:, 0, 0] = 20 + 30 * kinds + rng.normal(0, 2, 40)
        sets.append(taxel.Frames(values, np.arange(40), unit="ticks", array=taxel.Array(4, 4, 1.0)))
    name, answers = touch_rivals.best_rule(*sets, kinds)
    assert "peak" in name or "total" in name
    assert (answers == kinds).all()


def test_scenes_are_drawn_by_seed_with_their_label_at_the_first_contact() -> None:
    params = {"radii_mm": [25.0, 35.0], "drop_mm": [100.0, 200.0]}
    trials = touch.drawn(params, 5, 2)
    assert [trial.kind for trial in trials] == [0, 1]
    for trial, label in zip(trials, touch.KINDS, strict=True):
        assert list(trial.example.labels[label]) == [round(trial.contact.start_us)]
        assert (trial.events.t <= trial.contact.stop_us + touch.AFTER_US).all()
    assert touch.drawn(params, 5, 1)[0].events == trials[0].events


def test_the_recipe_is_chosen_for_events_and_has_a_neuron_for_every_label() -> None:
    events = taxel.Events([0], [0], [0], [1], array=taxel.Array(2, 2), intensity=[5])
    labels = ["contact", "Lift", "ball"]
    assert recipes.chosen(events)[0] == "touch"
    recipe = Recipe.load("touch", labels=labels)
    assert isinstance(recipe.encoder, taxel.encode.Composite)
    assert recipe.encoder.parts["moments"].displacement_mm is None
    assert [recipe.learner_of(label)[1] for label in labels] == [0.1, 0.1, 5.0]


@pytest.mark.slow
def test_the_spheres_are_told_apart_from_labels_alone() -> None:
    params = {**touch.PARAMETERS, "train": 100, "test": 40}
    found = touch.realise(params, 300)
    assert found["neuron"][params["times_ms"].index(10.0)] >= 0.9
    assert 3.0 < np.median(found["said_ms"]) < 8.0
