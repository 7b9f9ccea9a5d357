"""Which ball fell from how high on which slant: what is simulated, what answers rest on, how they are counted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.demo.script import TRAINING_SEED, drawn
from taxel_studies import which_drop
from taxel_studies.study import Row
from taxel_studies.which_drop import LOOKED_MS, QUESTIONS, answers, features, realise, summarise


@pytest.fixture(scope="module")
def drops() -> list[dict[str, Any]]:
    return realise({"drops": 12}, seed=1)


def test_drops_are_those_of_their_scenes_on_boards_that_the_demo_never_plays(drops: list[dict[str, Any]]) -> None:
    assert which_drop._FIRST_SEED >= TRAINING_SEED
    scenes = [drawn(which_drop._FIRST_SEED + 1, n).parameters for n in range(12)]
    assert len(drops) == len(scenes), "every ball was felt"
    for drop, scene in zip(drops, scenes, strict=True):
        ball = scene["bodies"][0]
        assert drop["height"] == pytest.approx(ball["motion"]["dropped"]["height_mm"], abs=0.05)
        assert drop["ball"] == pytest.approx(2 * ball["shape"]["sphere"]["radius_mm"], abs=0.05)
    assert [drop["slant"] > 0 for drop in drops] == [False, True] * 6


def test_the_middle_moves_down_the_slant_and_not_on_a_level_array(drops: list[dict[str, Any]]) -> None:
    moved = np.array([drop["frames"][-1][-1] for drop in drops]) / 100
    slanted = np.array([drop["slant"] > 0 for drop in drops])
    assert abs(np.median(moved[~slanted])) < 0.1
    assert np.median(moved[slanted]) > 0.5


def test_an_answer_rests_only_on_what_came_before_it(drops: list[dict[str, Any]]) -> None:
    frames = np.array([drop["frames"] for drop in drops])
    changed = frames.copy()
    changed[:, [t > 2 for t in LOOKED_MS]] += 50
    np.testing.assert_array_equal(features(frames, 2), features(changed, 2))
    assert not np.allclose(features(frames, 5), features(changed, 5))


def made(boards: int, told: bool) -> list[Row]:
    """Return drops whose numbers of loaded taxels follow their properties, or follow nothing."""
    random = np.random.default_rng(5)
    rows = []
    for board in range(boards):
        board_drops = []
        for _ in range(20):
            values = {
                "ball": random.choice([55, 65]),
                "height": random.choice([110, 150, 190]),
                "slant": random.choice([0, 15, 25]),
            }
            classes = [np.searchsorted(edges, values[name]) for name, (_, edges) in QUESTIONS.items()]
            frames = random.integers(20, 22, (len(LOOKED_MS), 4))
            if told:
                frames[:, :3] += 40 * np.array(classes)
            board_drops.append({**{name: float(value) for name, value in values.items()}, "frames": frames.tolist()})
        rows.append(Row({"drops": 20}, board, board_drops))
    return rows


def test_what_frames_tell_is_classified_and_what_they_do_not_is_chance() -> None:
    p = {"boards": 6, "drops": 20, "folds": 3}
    told, untold = summarise(p, made(6, told=True)), summarise(p, made(6, told=False))
    assert told["drops"] == 120
    for name in QUESTIONS:
        assert told["questions"][name]["right"] == [1.0] * 4
        assert untold["questions"][name]["right"][-1] < untold["questions"][name]["chance"] + 0.15


def test_a_drop_is_classified_by_other_folds_alone() -> None:
    """With its own label turned round, a fold's answers stay."""
    frames: NDArray[np.int64] = np.array([drop["frames"] for row in made(4, told=True) for drop in row.result])
    y = np.array([drop["ball"] > 60 for row in made(4, told=True) for drop in row.result]).astype(np.int64)
    fold = np.repeat([0, 0, 1, 1], 20)
    answer, probable = answers(frames, y, fold, 10)
    turned, _ = answers(frames, np.where(fold == 0, 1 - y, y), fold, 10)
    np.testing.assert_array_equal(answer[fold == 0], turned[fold == 0])
    assert (answer[fold == 1] != turned[fold == 1]).mean() > 0.9
    assert ((probable >= 0.5) & (probable <= 1)).all()
