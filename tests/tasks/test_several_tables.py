"""Several tables of labels are one: each is of the recording that it is named after, or names its recordings."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.tasks.recordings import mat

import taxel
from taxel.tasks.labels import references

BEGINS = [100 + 60 * k for k in range(8)]


def labels(place: Path, kind: str, stem: str) -> Path:
    """Write the labels of a mat in one of several forms; return the table."""
    times = [k / 100 for k in BEGINS]
    if kind == "track":
        file, rows = f"{stem}.txt", [f"{t:.6f}\t{t + 0.2:.6f}\tcontact" for t in times]
    elif kind == "bids":
        file, rows = f"{stem}_events.tsv", ["onset\tduration\ttrial_type", *(f"{t}\t0.2\tcontact" for t in times)]
    elif kind == "named":
        rows = ["recording,label,t_us", *(f"{stem},contact,{10_000 * k}" for k in BEGINS)]
        file = "all.csv"
    else:
        file, rows = f"{stem}.csv", ["t_s;label", *(f"{t};contact".replace(".", ",") for t in times)]
    (place / file).write_text("\n".join(rows) + "\n")
    return place / file


@pytest.fixture
def mats(tmp_path: Path) -> list[Path]:
    places = [mat(tmp_path, seed) for seed in range(3)]
    for place in places:
        place.with_suffix("").with_suffix(".notes.csv").unlink()
    return places


@pytest.mark.parametrize("kinds", [("track", "bids", "semicolons"), ("named", "track", "semicolons")])
def test_tables_are_of_the_recordings_that_they_are_named_after(
    tmp_path: Path, mats: list[Path], kinds: tuple[str, ...]
) -> None:
    (tmp_path / "labels").mkdir()
    tables = [labels(tmp_path / "labels", kind, place.stem) for kind, place in zip(kinds, mats, strict=True)]
    opened = [taxel.open(place) for place in mats]
    expected = [10_000 * k for k in BEGINS]
    found = references(tables, opened)
    assert [events["contact"].tolist() for events in found] == 3 * [expected]
    # One whose recording no table names had no event.
    assert [len(events.get("contact", ())) for events in references(tables[:2], opened)] == [8, 8, 0]


def test_a_table_of_no_recording_is_refused(tmp_path: Path, mats: list[Path]) -> None:
    tables = [labels(tmp_path, "track", "other"), labels(tmp_path, "bids", mats[0].stem)]
    with pytest.raises(
        taxel.ProblemError, match=r"other\.txt: does not state the recording of each label; .*mat0\.csv"
    ):
        references(tables, [taxel.open(place) for place in mats])
