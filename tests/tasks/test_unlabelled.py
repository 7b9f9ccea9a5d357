"""Sources that no row of labels names: neither trained nor scored, where rows name sources."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from shell import call
from tests.tasks.recordings import mat

import taxel
from taxel.reading import Facts, InMemory, Marks
from taxel.tasks import train


@pytest.fixture
def feet(tmp_path: Path) -> Path:
    """Write a recording of two sources, each touched eight times, with labels of the left one alone."""
    frames = {name: taxel.open(mat(tmp_path, seed)).frames() for name, seed in (("left", 3), ("right", 4))}
    feet = (InMemory(Facts(path=tmp_path, array=each.array, label=name), each) for name, each in frames.items())
    taxel.convert(taxel.Recording.of(*feet), tmp_path / "both.mcap")
    return tmp_path / "both.mcap"


def table(place: Path, rows: str) -> Path:
    place.write_text("source,label,t_us\n" + rows)
    return place


def rows(frames_at: list[int], source: str, label: str = "contact") -> str:
    return "".join(f"{source},{label},{10_000 * k}\n" for k in frames_at)


BEGINS = [100 + 60 * k for k in range(8)]


def test_a_source_that_no_row_names_is_neither_trained_nor_scored(feet: Path, tmp_path: Path) -> None:
    labels = table(tmp_path / "l.csv", rows(BEGINS, "left"))
    training = train(taxel.open(feet), labels)
    assert [each.label for each in training.recordings] == ["left"]
    assert (training.score.found, training.score.false) == (8, 0)
    assert "left out, because no row of labels names this source: right" in training.lines()
    assert training.to_dict()["unlabelled"] == ["right"]


def test_a_source_without_notes_beside_one_with_them_is_left_out(feet: Path, tmp_path: Path) -> None:
    frames = {name: each.frames() for name, each in taxel.open(feet).sources.items()}
    marks = {"left": Marks(tuple(taxel.Note("contact", 10_000 * k) for k in BEGINS)), "right": Marks()}
    facts = Facts(path=tmp_path, array=frames["left"].array)
    opened = taxel.Recording.of(*(InMemory(replace(facts, label=name), frames[name], marks[name]) for name in frames))
    taxel.convert(opened, tmp_path / "noted.mcap")
    for each in (opened, taxel.open(tmp_path / "noted.mcap")):
        training = train(each)
        assert (training.unlabelled, len(training.recordings)) == (("right",), 1)


def test_where_rows_name_no_source_nothing_happened_where_no_row_is(feet: Path, tmp_path: Path) -> None:
    each = taxel.open_all(feet)
    training = train(each, [{"contact": [10_000 * k for k in BEGINS]}, {}])
    assert training.unlabelled == ()
    assert len(training.recordings) == 2
    # Rows of another source alone say of this recording's own that nothing happened, as other rows name that source.
    places = [tmp_path / f"{name}.mcap" for name in "ab"]
    for place in places:
        place.write_bytes(feet.read_bytes())
    text = "recording,source,label,t_us\n" + "".join(
        f"{name},{source},contact,{10_000 * k}\n"
        for name, source in (("a", "left"), ("a", "right"), ("b", "left"))
        for k in BEGINS
    )
    (tmp_path / "l.csv").write_text(text)
    training = train([source for place in places for source in taxel.open_all(place)], tmp_path / "l.csv")
    assert training.unlabelled == ()
    assert len(training.recordings) == 4
    assert training.score.events == 24
    assert training.score.false + training.score.missed >= 8


def test_a_name_without_any_label_is_not_scored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    place, labels, rule = mat(tmp_path, 3), tmp_path / "l.csv", tmp_path / "rule.json"
    labels.write_text("label,t_us\n" + "".join(f"contact,{10_000 * k}\n" for k in BEGINS))
    taxel.detect.PlainRule("area", 2, labels=("contact", "lift"), noise_floor=6.0, unit="counts").save(rule)
    code, out, _ = call(capsys, "detect", place, "--readout", rule, "--truth", labels)
    assert (code, "do not rely on" in out) == (0, False), out
    assert f"not scored, because no row of {labels} names it: lift\n" in out
    found = taxel.tasks.detect(taxel.detect.load(rule), taxel.open(place), labels)
    assert (found.score.found, found.score.false, found.to_dict()["unlabelled"]) == (8, 0, ["lift"])
    found = taxel.tasks.detect(taxel.detect.load(rule), taxel.open(place), [{"contact": [], "lift": []}])
    assert (found.score.false, found.unlabelled) == (16, ()), "nothing happened"
