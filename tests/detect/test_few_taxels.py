"""Touches of one taxel, channels without places, and grids of several sizes in one training."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from draws import mixed

import taxel
from taxel import Array, Frames, Readout, Tare
from taxel.detect import Example, Recipe, fit, judge, recipes, run, score, tune
from taxel.tasks import DetectOptions, detect, train


def touched(
    shape: tuple[int, int], seed: int, noise: float, load: float, *, side: int = 1, count: int = 14, unit: str = "N"
) -> Example:
    """Return touches that load `side` x `side` taxels each, somewhere on a sensor."""
    rng = np.random.default_rng(seed)
    begins = 200 + 80 * np.arange(count)
    values = rng.normal(0.0, noise, (int(begins[-1]) + 150, *shape))
    for begin in begins:
        y, x = (rng.integers(0, size - side + 1) for size in shape)
        values[begin : begin + 30, y : y + side, x : x + side] += load
    t = np.arange(len(values)) * 10_000
    frames = Frames(np.maximum(values, 0.0) if unit == "N" else np.rint(values + 40), t, unit=unit, array=Array(*shape))
    return Example(frames, {"contact": t[begins], "lift": t[begins + 30]}, Tare.take(frames, stop_us=1_900_000))


def sized(shape: tuple[int, int], seed: int) -> Example:
    """Return touches of nine taxels on a grid of one size."""
    return touched(shape, seed, 0.4, 60.0, side=3, count=8, unit="counts")


@pytest.mark.parametrize(("shape", "times"), mixed([(1, 1), (1, 6), (2, 2), (8, 8)], [10.0, 100.0]))
def test_one_loaded_taxel_is_learnt_on_any_array(shape: tuple[int, int], times: float) -> None:
    learnt, unseen = (touched(shape, seed, 0.1, 0.1 * times) for seed in (1, 2))
    assert recipes.chosen(learnt.source, ["contact", "lift"])[0] == "touch"
    readout = fit([learnt], Recipe.load("touch", labels=["contact", "lift"], noise_floor=0.6))
    assert score(run(readout, unseen.source, tare=unseen.tare), unseen.labels, 50.0).rank[0] <= 1
    for label, rule in tune([learnt], noise_floor=0.6).items():
        assert rule is not None
        assert rule.quantity in ("load", "count")
        assert score(run(rule, learnt.source, tare=learnt.tare), {label: learnt.labels[label]}, 50.0).rank[0] <= 1


def test_grids_of_several_sizes_are_padded_at_their_far_edges(tmp_path: Path) -> None:
    examples = [sized(shape, seed) for seed, shape in enumerate([(6, 8), (8, 6), (8, 7)])]
    recipe = Recipe.load("touch", labels=["contact", "lift"], noise_floor=3.0)
    assert judge(examples, recipe, 3).together.rank[0] == 0
    readout = fit(examples, recipe)
    assert readout.array.shape == (8, 8)
    again = Readout.from_json(readout.to_json())
    for example in [*examples, sized((5, 5), 9)]:
        found = run(again, example.source, tare=example.tare)
        assert score(found, example.labels, 50.0).rank[0] == 0
    with pytest.raises(taxel.ProblemError, match="9 x 8 taxels: the readout was trained on 8 x 8"):
        run(readout, sized((9, 8), 1).source, tare=sized((9, 8), 1).tare)
    # One that was trained on one size takes this one alone.
    alone = fit([sized((8, 8), 4)], recipe)
    with pytest.raises(taxel.ProblemError, match="6 x 8 taxels: the readout was trained on 8 x 8"):
        run(alone, examples[0].source, tare=examples[0].tare)
    places = []
    for k, example in enumerate(examples):
        places.append(tmp_path / f"{k}.npz")
        taxel.convert(example.source, places[-1])
    labels = [{name: t.tolist() for name, t in example.labels.items()} for example in examples]
    training = train([taxel.open(place) for place in places], labels)
    assert any(
        "3 sizes, the smallest 6 x 8 taxels, are padded at their far edges to 8 x 8" in w for w in training.warnings
    )
    for example, place in zip(examples, places, strict=True):
        [detected] = detect(training.readout, taxel.open(place), options=DetectOptions(tare=1.9)).each
        assert score(detected.outcome.found, example.labels, 50.0).rank[0] == 0
