"""Which ball fell from how high on which slant: the shipped drops made anew, answers on other boards, what is said."""

import json
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from taxel.demo import naming
from taxel.demo.evaluation import evaluate_acts
from taxel.demo.naming import ANSWERED_MS, LOOKED_MS, QUESTIONS, Drops, estimates, shipped_drops
from taxel.demo.script import TRAINING_SEED, script
from taxel.demo.shipped import shipped
from taxel.simulate import Scene, Silence
from taxel.spikes import to_ms
from taxel.wire import FRAME_US

#: Number of drops for one board of the shipped set, and for three boards.
BOARD, FOLD = naming._DROPS, 3 * naming._DROPS


@pytest.fixture(scope="module")
def evaluation():
    return evaluate_acts(script(23, 3), shipped(), seed=23)


def test_the_shipped_drops_are_what_the_command_writes():
    """Its last board, made anew, row by row: and no seed of it is one that the demo plays."""
    kept = json.loads(files("taxel.demo").joinpath("drops.json").read_text())
    assert kept["looked_ms"] == list(LOOKED_MS)
    assert len(kept["rows"]) == naming._BOARDS * BOARD
    seed = naming._FIRST_SEED + naming._BOARDS - 1
    assert seed >= TRAINING_SEED
    assert naming.board_of_drops(seed, BOARD) == kept["rows"][-BOARD:]
    assert len(files("taxel.demo").joinpath("drops.json").read_bytes()) < 100_000


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("ball", [0.58, 0.65, 0.8, 0.85]),
        ("height", [0.45, 0.5, 0.8, 0.85]),
        ("slant", [0.5, 0.58, 0.83, 0.88]),
    ],
)
def test_answers_on_other_boards_are_right_as_often_as_they_say(name, least):
    known = shipped_drops()
    question = QUESTIONS[name]
    truth = np.array([question.of(value) for value in getattr(known, question.column)])
    fold = np.arange(len(truth)) // FOLD
    for after_ms, at_least in zip(ANSWERED_MS, least, strict=True):
        probable = np.zeros((len(truth), len(question.answers)))
        for k in range(fold.max() + 1):
            columns = known.diameter_mm, known.height_mm, known.slant_deg, known.pictures
            rest = Drops(*(column[fold != k] for column in columns))
            probable[fold == k] = rest.posterior(name, after_ms, known.pictures[fold == k])
        np.testing.assert_allclose(probable.sum(1), 1.0)
        right = float(np.mean(probable.argmax(1) == truth))
        assert right > at_least
        assert right == pytest.approx(probable.max(1).mean(), abs=0.05)


def test_an_answer_rests_only_on_what_came_before_it():
    known = shipped_drops()
    changed = known.pictures[:4].copy()
    changed[:, [t > 2 for t in LOOKED_MS]] += 50
    for name in QUESTIONS:
        before, after = (known.posterior(name, 2, pictures) for pictures in (known.pictures[:4], changed))
        np.testing.assert_array_equal(before, after)
        assert not np.allclose(known.posterior(name, 5, changed), known.posterior(name, 5, known.pictures[:4]))


def test_the_middle_moves_down_the_slant_and_not_on_a_level_array():
    """By more the steeper: what tells a slant apart from a lower fall."""
    known = shipped_drops()
    moved = known.pictures[:, -1, -1] / 100
    level, slanted = moved[known.slant_deg == 0], moved[known.slant_deg > 0]
    assert abs(np.median(level)) < 0.1
    assert np.median(slanted) > 0.5
    assert np.corrcoef(known.slant_deg[known.slant_deg > 0], slanted)[0, 1] > 0.5


def test_each_drop_of_a_play_is_named_and_judged(evaluation):
    scenes = [act for act in script(23, 3) if isinstance(act, Scene)]
    found = estimates(evaluation, scenes)
    assert [drop["true"]["height"] for drop in found["drops"]] == [
        s.parameters["bodies"][0]["motion"]["dropped"]["height_mm"] for s in scenes
    ]
    assert [drop["true"]["slant"] for drop in found["drops"]] == [s.parameters["slant_deg"] for s in scenes]
    assert [drop["true"]["slant"] > 0 for drop in found["drops"]] == [False, True, False]
    for name, question in QUESTIONS.items():
        for k in range(len(ANSWERED_MS)):
            said = [drop["said"][name][k] for drop in found["drops"]]
            assert found["right"][name][k] == sum(one["right"] for one in said)
            for drop, one in zip(found["drops"], said, strict=True):
                most = int(np.argmax(one["probable"]))
                edges = [-1.0, *question.edges, np.inf]
                assert one["right"] == (edges[most] < drop["true"][name] <= edges[most + 1])
    # A stamp is the start of its frame, which may precede the touch.
    assert all(-to_ms(FRAME_US) < drop["felt_ms"] < 2 for drop in found["drops"])


def test_a_play_without_drops_and_drops_that_were_not_felt(evaluation):
    quiet = evaluate_acts([Silence(400.0)], shipped(), seed=3)
    assert estimates(quiet, [])["drops"] == []
    begin = evaluation.area.start
    deaf = replace(evaluation, area=evaluation.area.between(begin, begin + 1.0))
    found = estimates(deaf, [act for act in script(23, 3) if isinstance(act, Scene)])
    assert [drop["felt_ms"] for drop in found["drops"]] == [None] * 3
    assert found["right"] == {"ball": [0] * 4, "height": [0] * 4, "slant": [0] * 4}
