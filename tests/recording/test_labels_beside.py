"""Tables of labels that other programs wrote beside a recording are found by its name, and are its notes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.recording.beside import is_label_table
from taxel.tasks.labels import references

BIDS = "onset\tduration\ttrial_type\tvalue\n0.25\t0.1\theel\t1\n0.5\t0\tn/a\t2\n0.75\tn/a\ttoe\t3\n"
TRACK = "0.250000\t0.350000\theel\n\\\t100.0\t200.0\n0.750000\t0.750000\ttoe\n"
GERMAN = "t_s;label;Bemerkung\n0,25;heel;spät\n0,75;toe;\n"
EXPECTED = [("heel", 250_000), ("toe", 750_000)]


def write(place: Path, begin_us: int = 0) -> Path:
    frames = taxel.Frames(np.zeros((100, 2, 2)), begin_us + np.arange(100) * 10_000, unit="N", array=taxel.Array(2, 2))
    taxel.convert(frames, place)
    return place


def noted(place: Path) -> list[tuple[str, int | None]]:
    return [(note.text, note.t) for note in taxel.open(place).notes]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("_events.csv", "label,t_us\nheel,250000\ntoe,750000\n"),
        ("_labels.csv", GERMAN),
        ("_labels.csv", "t_ms;Label\n250;heel\n750;toe\n"),
        ("_events.tsv", BIDS),
        (".txt", TRACK),
        (".txt", TRACK.replace(".", ",")),
        (".txt", "t_s\tLabel\n0.25\theel\n0.75\ttoe\n"),
        ("_labels.csv", "side,t_ms,label\r\n1,250,heel\r\n2,7.5e2,toe\r\n"),
    ],
)
@pytest.mark.parametrize("stem", ["walk", "Gäng Müller 1.5 N"])
@pytest.mark.parametrize("code", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_a_table_beside_a_recording_is_its_notes(tmp_path: Path, name: str, content: str, stem: str, code: str) -> None:
    place, table = write(tmp_path / f"{stem}.npz"), tmp_path / f"{stem}{name}"
    table.write_bytes(content.encode(code))
    assert noted(place) == EXPECTED
    assert is_label_table(table)
    [of_folder] = taxel.open_all(tmp_path)
    assert [(note.text, note.t) for note in of_folder.notes] == EXPECTED
    [found] = references(table, [taxel.open(place)])
    assert {label: t.tolist() for label, t in found.items()} == {"heel": [250_000], "toe": [750_000]}
    with pytest.raises(taxel.FormatError, match="a table of labels"):
        taxel.open(table)


@pytest.mark.parametrize("begin_us", [0, 3_000_000, 1_741_947_667_480_000])
@pytest.mark.parametrize(("name", "content"), [("walk_events.tsv", BIDS), ("walk.txt", TRACK)])
def test_tables_that_count_from_the_beginning_do_so_in_any_recording(
    tmp_path: Path, begin_us: int, name: str, content: str, recwarn: pytest.WarningsRecorder
) -> None:
    place, table = write(tmp_path / "walk.h5", begin_us), tmp_path / name
    table.write_text(content)
    expected = {label: [begin_us + t] for label, t in EXPECTED}
    recording = taxel.open(place)
    for source in ("notes", table):
        [found] = references(source, [recording])
        assert {label: t.tolist() for label, t in found.items()} == expected
    assert not recwarn.list


def test_a_label_of_two_tables_is_one_and_a_converted_recording_has_it_once(tmp_path: Path) -> None:
    place = write(tmp_path / "walk.npz")
    (tmp_path / "walk_events.tsv").write_text(BIDS)
    (tmp_path / "walk.txt").write_text(TRACK)
    taxel.convert(taxel.open(place), tmp_path / "walk.mcap")
    assert noted(place) == noted(tmp_path / "walk.mcap") == EXPECTED
    (tmp_path / "walk.notes.csv").write_text("label,t_us,replaces_us\nball,260000,250000\n")
    assert sorted(noted(place)) == [("ball", 260_000), ("toe", 750_000)]


def test_other_texts_beside_a_recording_are_none_of_its_labels(tmp_path: Path) -> None:
    place = write(tmp_path / "walk.npz")
    (tmp_path / "walk_events.csv").write_text("t_us,x,y,p\n5,1,1,1\n")
    (tmp_path / "walk.txt").write_text("0.1\t0.2\t3\n")
    (tmp_path / "run.txt").write_text(TRACK)
    assert noted(place) == []
    assert taxel.open(tmp_path / "walk_events.csv").events.t.tolist() == [5]
    for name in ("walk_labels.csv", "walk_events.tsv"):
        (tmp_path / name).write_text("")
        assert is_label_table(tmp_path / name)
    assert noted(place) == []


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("0.5\t0.6\theel\nend\n", r"walk\.txt, line 2: 'end'; must be begin and end, s, and label, between tabs"),
        ("0.5\t0.6\theel\n0.7\tinf\theel\n", r"walk\.txt, line 2"),
        ("0.5\t0.6\theel\n0.7\n", r"walk\.txt, line 2"),
    ],
)
def test_a_wrong_line_of_a_label_track_is_named(tmp_path: Path, content: str, said: str) -> None:
    place = write(tmp_path / "walk.npz")
    (tmp_path / "walk.txt").write_text(content)
    with pytest.raises(taxel.FormatError, match=said):
        taxel.open(place)


def test_labels_of_a_track_outside_its_recording_or_without_a_name_are_left_out(tmp_path: Path) -> None:
    place = write(tmp_path / "walk.npz")
    (tmp_path / "walk.txt").write_text("0.5\t0.6\theel\n-0.5\t0.1\theel\n0.7\t0.7\t\n")
    with pytest.warns(UserWarning, match=r"walk\.txt: left out 1 label without a name"):
        recording = taxel.open(place)
    with pytest.warns(UserWarning, match="1 of the 2 events of the notes of .* left out: outside"):
        [found] = references("notes", [recording])
    assert found["heel"].tolist() == [500_000]
    # The end of a label is kept, as further columns are.
    with pytest.warns(UserWarning, match="without a name"):
        assert taxel.Labels(tmp_path / "walk.txt").rows[0].others == (("stop_us", "600000"),)
