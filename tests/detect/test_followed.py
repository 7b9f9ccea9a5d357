"""The quantity that follows labels, and the point of a recipe that a training chooses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import Frames, ProblemError, SpikeTrains, Tare
from taxel.detect import Example, Recipe, run, score
from taxel.detect.fitting import fit_aligned, possible
from taxel.detect.followed import follow, silence
from taxel.encode import Composite, ContactArea, LocalLoad

STEP_MS = 0.5


def graded(columns: np.ndarray, start_ms: float) -> SpikeTrains:
    """Return quantities, one a column, as an encoder gives them: with a clock behind them."""
    times = start_ms + STEP_MS * np.arange(len(columns))
    logs = np.log1p(np.column_stack([columns, np.full(len(columns), np.e - 1)])).astype(np.float32)
    spikes = [np.flatnonzero(column) for column in logs.T]
    values = np.concatenate([logs[places, k] for k, places in enumerate(spikes)])
    offsets = np.concatenate([[0], np.cumsum([len(places) for places in spikes])])
    return SpikeTrains(times[np.concatenate(spikes)], offsets, start_ms, times[-1] + STEP_MS, values, kind="graded")


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    planted=st.integers(0, 2),
    height=st.sampled_from([2.0, 5.0, 30.0]),
    start_ms=st.sampled_from([0.0, 1e6, -50.3]),
)
def test_a_planted_quantity_is_found_and_the_labels_come_to_its_onsets(seed, planted, height, start_ms) -> None:
    draw = np.random.default_rng(seed)
    onsets = np.cumsum(draw.integers(400, 600, 6))
    columns = np.zeros((4000, 3))
    for place in onsets:
        columns[place : place + draw.integers(20, 200), planted] = height
    for other in set(range(3)) - {planted}:
        for place in draw.integers(0, 3900, 6):
            columns[place : place + 50, other] = 30.0
    pattern = graded(columns, start_ms)
    felt_us = np.rint(1000 * (start_ms + STEP_MS * onsets)).astype(np.int64)
    labels = felt_us - draw.integers(0, 20_000, 6)
    best = follow([pattern], "touch", [labels], 0.0, [0, 1, 2])[0]
    assert best.train == planted
    assert (best.score.missed, best.score.false) == (0, 0)
    assert np.rint(1000 * best.edges[0].onsets).astype(np.int64).tolist() == felt_us.tolist()
    # Silence is asked before each touch and long after it, at samples, and nowhere from 5 ms before it to its target.
    targets = best.edges[0].onsets + 3.0
    (windows,) = silence(best, [pattern], [targets], [np.empty(0)], 3.0, 0.1)
    assert (np.diff(windows.ravel()) > 0).all()
    inside = [((windows[:, 0] > t - 7.9) & (windows[:, 0] < t + 3.0)).sum() for t in targets]
    assert inside == [0] * 6
    assert all(((windows[:, 0] > t - 30.0) & (windows[:, 0] < t - 8.0)).any() for t in targets)


def test_where_nothing_is_found_no_quantity_follows() -> None:
    pattern = graded(np.zeros((100, 2)), 0.0)
    assert follow([pattern], "touch", [np.array([20_000])], 0.0, [0, 1]) == []


def frames(seed: int, away: float) -> Example:
    """Frames of 10 touches; after the tare all readings are away from it by as much."""
    draw, count = np.random.default_rng(seed), 5200
    values = draw.normal(50.0, 0.4, (count, 8, 8))
    onsets = 300 + 480 * np.arange(10) + draw.integers(0, 60, 10)
    for start, stop in zip(onsets, onsets + draw.integers(60, 250, 10), strict=True):
        y, x = draw.integers(0, 5, 2)
        values[start:stop, y : y + 3, x : x + 3] += 15.0
    values[200:] += draw.normal(0.0, away, (8, 8))
    t = np.arange(count) * 500
    frames = Frames(np.rint(values), t, unit="ticks", array=taxel.Array(8, 8, pitch_mm=2.67))
    return Example(frames, {"contact": t[onsets]}, Tare.take(frames, stop_us=90_000))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_training_takes_levels_of_the_local_load_and_with_a_stale_tare_those_of_its_changes() -> None:
    recipe = Recipe.load("touch", labels=["contact"])
    # One recording with a stale tare shows one error of it; two show that levels above the rest do not carry over.
    for away, inputs in ((0.0, ["levels"]), (10.0, ["changes"])):
        made = fit_aligned([frames(1, away), frames(3, away)], recipe, None)
        assert made.recipe.neurons["contact"]["inputs"] == inputs
        assert "choose" in made.recipe.neurons["contact"]
        unseen = frames(2, away)
        found = score(run(made.readout, unseen.source, tare=unseen.tare), unseen.labels)
        assert (found.missed, found.false) == (0, 0), away
        assert made.readout.encoder == recipe.encoder.parts[inputs[0]]


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(("fewer", "inputs"), [(0, ["levels"]), (1, ["area"])])
def test_a_point_that_leaves_no_more_counts_only_where_that_is_enough(fewer, inputs) -> None:
    encoder = Composite({"area": ContactArea(), "levels": LocalLoad(levels=[4.0])})
    neuron = {"inputs": ["area"], "refractory": 15.0, "tau": 0.3, "ub": 3.0, "lb": 0.0, "delay_ms": 0.1}
    choose = [{"inputs": ["levels"], "fewer": fewer}]
    recipe = Recipe(encoder, {}, {"contact": {**neuron, "choose": choose}}, run_threshold=0.8, align=True)
    made = fit_aligned([frames(1, 0.0)], recipe, None)
    assert made.recipe.neurons["contact"] == {**neuron, "inputs": inputs, "choose": choose}


def test_without_a_tare_no_input_that_needs_one_is_chosen() -> None:
    recipe, one = Recipe.load("touch", labels=["contact"]), frames(1, 10.0)
    assert possible(recipe, [one]) == recipe
    left = possible(recipe, [one._replace(tare=None)])
    names = [name for point in left.neurons["contact"].get("choose", ()) for name in point.get("inputs", ())]
    assert LocalLoad.name not in {left.encoder.parts[name].name for name in names}
    assert len(left.neurons["contact"].get("choose", ())) < len(recipe.neurons["contact"]["choose"])


def test_points_to_choose_from_are_checked_by_name() -> None:
    encoder = Composite({"area": ContactArea(), "load": LocalLoad()})
    with pytest.raises(ProblemError, match=r"neurons\.contact\.choose: no parameter 'taus'"):
        Recipe(encoder, {}, {"contact": {"choose": [{"taus": 1.0}]}})
    with pytest.raises(ProblemError, match=r"neurons\.contact\.choose: fewer is -1"):
        Recipe(encoder, {}, {"contact": {"choose": [{"fewer": -1}]}})
    with pytest.raises(ProblemError, match=r"neurons\.contact\.choose: inputs: 'loads' is not the name of an encoder"):
        Recipe(encoder, {}, {"contact": {"choose": [{"inputs": ["loads"]}]}})
