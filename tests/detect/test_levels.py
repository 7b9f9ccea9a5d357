"""Levels from the training data, where the recipe's lie outside what the sensor reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from formats.making import write_pedar

import taxel
from taxel.detect import Example, Fold, Part, Recipe, judge
from taxel.encode import LevelCrossing
from taxel.tasks import TrainOptions, train


def steps(scale: float, *, unit: str = "N", noise: float = 0.005, seed: int = 1, count: int = 12) -> Example:
    """Return steps on eight channels whose largest readings are about `scale`, with their labels."""
    rng, period = np.random.default_rng(seed), 110
    values, begins = np.zeros(((count + 1) * period + 60, 8)), []
    for k in range(count):
        begin = 100 + k * period + int(rng.integers(-8, 8))
        for channel in range(8):
            lag = begin + 2 * channel
            values[lag : lag + 40, channel] += np.sin(np.linspace(0, np.pi, 40)) * rng.uniform(0.4, 1.0)
        begins.append(begin)
    values = np.maximum(values + rng.normal(0, noise, values.shape), 0) * scale
    t = np.arange(len(values)) * 10_000
    frames = taxel.Frames((np.round(values) if unit == "counts" else values)[:, None, :], t, unit=unit)
    return Example(frames, {"contact": t[begins], "foot_off": t[np.array(begins) + 50]})


def recipe() -> Recipe:
    return Recipe.load("gait_insole", labels=["contact", "foot_off"])


@pytest.mark.parametrize("scale", [1.0, 10.0, 1e4])
def test_readings_below_or_beyond_the_levels_are_learnt(scale: float) -> None:
    judged = judge([steps(scale)], recipe(), 3)
    assert judged.together["contact"].found == 12
    assert judged.together.rank[0] <= 1


@pytest.mark.parametrize(("scale", "unit", "noise"), [(3.0, "N", 0.02), (300.0, "N", 0.02), (10.0, "counts", 0.005)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_labels_before_the_first_input_are_learnt(scale: float, unit: str, noise: float, seed: int) -> None:
    """The label is the true onset; what the sensor reads of it reaches a level after the trained delay."""
    examples = [steps(scale, unit=unit, noise=noise, seed=seed, count=25) for seed in (seed, seed + 10)]
    readout = taxel.detect.fit(examples[:1], recipe())
    scored = taxel.detect.score(taxel.detect.run(readout, examples[1].source), examples[1].labels, 50.0)
    for label in ("contact", "foot_off"):
        assert scored[label].missed + scored[label].false <= 2


def test_levels_follow_the_unit_and_those_within_stay() -> None:
    levels = {}
    for scale in (0.01, 1.0, 100.0, 1e4):
        [trained] = judge([steps(scale), steps(scale, seed=2)], recipe(), [Fold([Part(0)], [Part(1)])]).trained
        levels[scale] = np.array(trained.readout.encoder.levels)
    assert levels[100.0].tolist() == recipe().encoder.levels
    np.testing.assert_allclose(levels[1.0] * 1e4, levels[1e4], rtol=0.01)
    np.testing.assert_allclose(levels[0.01] * 100, levels[1.0], rtol=0.01)
    assert (np.diff(levels[1.0]) > 0).all()


def test_each_fold_has_the_levels_of_its_training_part_alone() -> None:
    examples = [steps(1.0), steps(3.0)]
    judged = judge(examples, recipe(), [Fold([Part(0)], [Part(1)]), Fold([Part(1)], [Part(0)])])
    alone = [taxel.detect.fit([example], recipe()).encoder.levels for example in examples]
    assert [trained.readout.encoder.levels for trained in judged.trained] == alone
    assert alone[0] != alone[1]
    [part] = judge([examples[0]], recipe(), [Fold([Part(0, 0, 8e6)], [Part(0, 8e6, 1e9)])]).trained
    first = Example(examples[0].source.between(0, 8e6), {k: t[t < 8e6] for k, t in examples[0].labels.items()})
    assert part.readout.encoder == taxel.detect.fit([first], recipe()).encoder


def test_levels_that_a_user_states_stay(tmp_path: Path) -> None:
    example = steps(1.0)
    taxel.convert(example.source, tmp_path / "a.npz")
    labels = [{name: t.tolist() for name, t in example.labels.items()}]
    fitted = train(taxel.open(tmp_path / "a.npz"), labels)
    assert fitted.fitted_levels == tuple(fitted.readout.encoder.levels)
    assert any(line.startswith("levels: 0.0") and "from the training data" in line for line in fitted.lines())
    assert taxel.Readout.from_json(fitted.readout.to_json()).encoder == fitted.readout.encoder
    stated = train(taxel.open(tmp_path / "a.npz"), labels, TrainOptions("gait_insole", {"encoder.levels": [0.1, 0.3]}))
    assert stated.readout.encoder.levels == [0.1, 0.3]
    assert stated.fitted_levels == ()
    of_ones_own = Recipe(LevelCrossing([5.0, 10.0]), recipe().learner, recipe().neurons)
    assert not of_ones_own.fit_levels


def test_the_kept_recordings_keep_the_recipes_levels(tmp_path: Path) -> None:
    contacts = [100_000 * k for k in range(1, 6)]
    walk = taxel.open(write_pedar(tmp_path))
    examples = [Example(each.frames(), {"contact": contacts}) for each in walk.sources.values()]
    [trained] = judge(examples, Recipe.load("gait_insole", labels=["contact"]), [Fold([Part(0)], [Part(1)])]).trained
    assert trained.readout.encoder.levels == recipe().encoder.levels
