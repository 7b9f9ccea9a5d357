"""Each trap of the format on files made here, and on Moticon OpenGo as published, where that is there."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import taxel
from taxel import FormatError, formats
from taxel.cli import app
from taxel.formats import moticon

from .making import (
    shared,
    write_moticon,
)


def test_moticon_rows_that_are_missing_for_a_foot_are_missing_not_zero(tmp_path):
    write_moticon(tmp_path)
    left, right = formats.trials(tmp_path)
    assert (len(left.frames), len(right.frames)) == (199 - 11, 199)
    assert left.frames.t[0] == 100_000
    assert 600_000 not in left.frames.t
    assert 1_200_000 not in right.frames.t
    assert left.frames.values[left.frames.t == 610_000].min() == 2.5
    assert [list(left.truth[e]) for e in ("contact", "foot_off")] == [[500_000], [1_000_000]]
    assert left.series["total"].max() == 400


def test_a_moticon_insole_that_sent_nothing_is_an_empty_recording(tmp_path):
    def silent(rows):
        return [*rows[:3], *("\t".join([row.split("\t")[0], *[""] * 25, *row.split("\t")[26:]]) for row in rows[3:])]

    write_moticon(tmp_path, silent)
    left, right = formats.trials(tmp_path)
    assert (left.frames.values.shape, right.frames.values.shape) == ((0, 1, 16), (199, 1, 16))


def test_what_a_file_holds_beside_its_taxels_is_said_and_goes_with_the_file(tmp_path):
    left, right = taxel.open_all(write_moticon(tmp_path))
    columns = [
        f"left {what}" for what in ("acceleration X[g]", "angular Z[dps]", "center of pressure X[-0.5...+0.5]", "cop Y")
    ]
    for recording, other in ((left, "right "), (right, "left ")):
        [line] = recording.lost
        assert line.startswith("columns that are not taxels: total, ")
        assert other not in line
        assert "pressure 1" not in line
    assert all(column in left.lost[0] for column in columns)
    assert taxel.convert(left, tmp_path / "left.mcap")[0] == left.lost[0]
    assert taxel.open(tmp_path / "left.mcap").lost[0] == left.lost[0]
    facts = json.loads(CliRunner().invoke(app, ["info", str(tmp_path / "left.mcap"), "--json"]).stdout)
    assert left.lost[0] in facts["lost"]
    page = CliRunner().invoke(app, ["info", str(tmp_path / "left.mcap")]).stdout
    assert f"not in file         {left.lost[0]}" in page


def test_moticon_reports_are_taken_where_they_are(tmp_path):
    write_moticon(tmp_path)
    (tmp_path / "steps.csv").write_text("recording,foot,contact_s,toe_off_s\n240101_000000,left,0.503,1.004\n")
    left, _ = formats.trials(tmp_path)
    assert [list(left.truth[e]) for e in ("contact", "foot_off")] == [[503_000], [1_004_000]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:20], r[20] + "\t", *r[21:]], "line 21: 54 cells; must have 53"),
        (lambda r: [*r[:20], r[20].replace("0.00\t", "\t", 1), *r[21:]], "line 21: .* is empty; must have a number"),
        (lambda r: [*r[:20], r[20].replace("0.17", "0,17"), *r[21:]], "line 21: column 'time' has a decimal comma"),
        (
            lambda r: [r[0], r[1], r[2].replace("left pressure", "left force"), *r[3:]],
            "column 'left pressure 1' is missing",
        ),
    ],
)
def test_a_spoilt_moticon_line_is_named(tmp_path, change, said):
    write_moticon(tmp_path, change)
    with pytest.raises(FormatError, match=f"240101_000000.txt, line \\d+.*{said}|{said}"):
        list(formats.trials(tmp_path))


def test_moticon_markers_and_reports_agree_within_6_ms(tmp_path):
    folder = shared("insole_moticon")
    for file in moticon.files(folder):
        (tmp_path / file.name).symlink_to(file)
    counts = []
    for marked, told in zip(moticon.trials(tmp_path), moticon.trials(folder), strict=True):
        for event in ("contact", "foot_off"):
            counts.append(len(told.truth[event]))
            assert np.abs(marked.truth[event] - told.truth[event]).max() <= 6500
    assert counts == [7, 7, 7, 7, 9, 9, 9, 9]
