"""Recordings of one person are held out together: by a column of the labels, or of a table beside."""

from __future__ import annotations

from pathlib import Path

import pytest
from sklearn.model_selection import LeaveOneGroupOut
from tests.tasks.recordings import mat

import taxel
from taxel.detect import Example
from taxel.detect.folds import folds_of
from taxel.tasks.held_together import held_together

BEGINS = [100 + 60 * k for k in range(8)]
PEOPLE = ["Bo", "Al", "Bo", "Cy"]


@pytest.fixture
def mats(tmp_path: Path) -> list[Path]:
    return [mat(tmp_path, seed) for seed in range(4)]


def labels(place: Path, column: str, people: list[str]) -> Path:
    """Write the labels of the mats, with a column that says of whom each is."""
    rows = [f"mat{seed},contact,{10_000 * k},{person}" for seed, person in enumerate(people) for k in BEGINS]
    (place / "labels.csv").write_text("\n".join([f"recording,label,t_us,{column}", *rows]) + "\n")
    return place / "labels.csv"


def beside(place: Path, column: str, people: list[str]) -> str:
    rows = [f"mat{seed};{person}" for seed, person in enumerate(people)]
    (place / "recordings.csv").write_text("\n".join([f"recording;{column}", *rows]) + "\n")
    return "notes"


@pytest.mark.parametrize("table", [labels, beside])
@pytest.mark.parametrize(("column", "asked"), [("person", None), ("group", None), ("hand", "hand")])
def test_no_person_is_on_both_sides(tmp_path: Path, mats: list[Path], table, column: str, asked: str | None) -> None:
    source, opened = table(tmp_path, column, PEOPLE), [taxel.open(place) for place in mats]
    assert held_together(source, opened, asked) == (column, PEOPLE)
    spikes = taxel.SpikeTrains.from_lists([[]], stop=1e9)
    examples = [Example(spikes, {"contact": BEGINS}, held_with=person) for person in PEOPLE]
    folds, how = folds_of(examples, 3)
    assert how == "whole groups, 3 folds"
    tested = {tuple(part.example for part in fold.test) for fold in folds}
    assert tested == {tuple(test) for _, test in LeaveOneGroupOut().split(PEOPLE, groups=PEOPLE)}
    with pytest.raises(taxel.ProblemError, match=r"^folds is 4: .* 3"):
        folds_of(examples, 4)


@pytest.mark.parametrize(
    ("column", "people", "asked", "where"),
    [
        ("person", PEOPLE, "hand", "^hold_out is 'hand'"),
        ("person", ["Bo", "Bo", "Bo", "Bo"], "person", "^hold_out is 'person'"),
        ("person", ["Bo", "", "Al", "Cy"], "person", "mat1.*: person is empty"),
        ("person", ["Bo", "", "Al", "Cy"], None, "mat1.*: person is empty"),
    ],
)
def test_a_column_that_cannot_be_held_out_is_refused(
    tmp_path: Path, mats: list[Path], column: str, people: list[str], asked: str | None, where: str
) -> None:
    opened = [taxel.open(place) for place in mats]
    with pytest.raises(taxel.ProblemError, match=where):
        held_together(labels(tmp_path, column, people), opened, asked)


def test_a_recording_of_two_people_is_refused_where_asked_and_else_said(tmp_path: Path, mats: list[Path]) -> None:
    table, opened = labels(tmp_path, "person", PEOPLE), [taxel.open(place) for place in mats]
    table.write_text(table.read_text() + "mat1,contact,10,Di\n")
    with pytest.raises(taxel.ProblemError, match=r"mat1.*: person is Al, Di"):
        held_together(table, opened, "person")
    with pytest.warns(UserWarning, match=r"mat1.*: person is Al, Di"):
        assert held_together(table, opened) == ("", [""] * 4)


def test_training_says_who_may_be_on_both_sides(tmp_path: Path, mats: list[Path]) -> None:
    opened = [taxel.open(place) for place in mats]
    known = taxel.train(opened, labels(tmp_path, "person", PEOPLE))
    unknown, one = taxel.train(opened), taxel.train(opened[0])
    assert [each.to_dict()["held_by"] for each in (known, unknown, one)] == ["person", None, None]
    assert known.scored.how == "whole groups, 3 folds"
    assert [each.lines()[0].partition("(window 50 ms)")[2] for each in (known, unknown, one)] == [
        ", no person on both sides",
        "; the same person may be on both sides (--hold-out)",
        "",
    ]
    assert one.scored.how.endswith("of one recording")
