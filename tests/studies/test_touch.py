"""The study of touch: its parts against what is known, and the recipe that it shows."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel.detect import Recipe, recipes
from taxel.studies import touch


def test_the_discriminant_finds_the_direction_of_two_clouds() -> None:
    """With equal covariances the best direction is known; more dimensions than samples do little harm."""
    rng = np.random.default_rng(1)
    classes = np.arange(200) % 2
    move = np.zeros(400)
    move[:4] = 3.0

    def cloud(of: np.ndarray) -> np.ndarray:
        return (rng.normal(size=(len(of), 400)) + np.outer(of, move)).astype(np.float32)

    tell, new = touch._lda(cloud(classes), classes), cloud(classes)
    best = ((new - move / 2) @ move > 0) == classes
    assert np.mean(tell(new) == classes) > np.mean(best) - 0.1
    for kind in (0, 1):
        assert np.mean(tell(cloud(np.full(2000, kind))) == kind) > 0.85


def test_the_best_rule_is_the_feature_that_differs() -> None:
    def felt(peak: float) -> taxel.Frames:
        values = np.full((1, 4, 4), 10.0)
        values[0, 0, 0] = peak
        return taxel.Frames(values, [0], unit="ticks")

    rng = np.random.default_rng(2)
    kinds = np.arange(40) % 2
    sets = [[felt(20 + 30 * kind + rng.normal(0, 2)) for kind in kinds] for _ in range(2)]
    name, said = touch._best_rule(sets, kinds)
    assert "peak" in name or "total" in name
    assert (said == kinds).all()


def test_scenes_come_back_from_their_files_with_their_labels(tmp_path) -> None:
    params = {"question": "contact", "radii_mm": [25.0, 35.0], "drop_mm": [100.0, 200.0]}
    trials = touch.drawn(params, 5, 2, tmp_path)
    assert [trial.kind for trial in trials] == [0, 1]
    for trial in trials:
        assert trial.labels["contact"].tolist() == [round(c.start_us) for c in trial.contacts]
        assert trial.labels["lift"].tolist() == [round(c.stop_us) for c in trial.contacts]
        assert (trial.events.t <= trial.contacts[-1].stop_us + touch.AFTER_US).all()
    told = touch._tally([touch._by_area(trial, 2) for trial in trials], trials, 10.0)
    assert told["contact"]["missed"] == told["lift"]["missed"] == 0
    assert abs(np.median(told["contact"]["error_ms"])) < 2.0
    (tmp_path / "again").mkdir()
    assert touch.drawn(params, 5, 1, tmp_path / "again")[0].events == trials[0].events


def test_the_recipe_is_chosen_for_events_and_has_a_neuron_for_every_label() -> None:
    events = taxel.Events([0], [0], [0], [1], array=taxel.Array(2, 2), intensity=[5])
    assert recipes.fitting(events) == "touch"
    recipe = Recipe.load("touch", labels=["contact", "Lift", "ball"])
    assert isinstance(recipe.encoder, taxel.encode.Moments)
    assert recipe.encoder.displacement_mm is None
    assert [recipe.learner_of(label)[1] for label in ("contact", "Lift", "ball")] == [2.0, 4.0, 6.0]


@pytest.mark.slow
def test_the_spheres_are_told_apart_from_labels_alone() -> None:
    params = {**touch.PARAMETERS, "question": "kind", "train": 100, "test": 40}
    found = touch.realise(params, 300)
    assert found["neuron"][params["times_ms"].index(10.0)] >= 0.9
    assert 3.0 < np.median(found["said_ms"]) < 8.0
