"""Each trap of the format on files made here, and on PhysioNet gaitpdb as published, where that is there."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import FormatError, formats
from taxel.formats import gaitpdb

from .making import (
    shared,
    write_gaitpdb,
)


@pytest.mark.parametrize("name", ["GaCo99_01.txt", "SiPt01_01.txt.gz"])
def test_gaitpdb_gives_both_feet(tmp_path, name):
    write_gaitpdb(tmp_path, name)
    left, right = formats.trials(tmp_path)
    assert (left.foot, right.foot) == ("left", "right")
    assert left.group == ("healthy" if "Co" in name else "patient")
    assert left.frames.values.shape == (600, 1, 8)
    assert list(left.truth["contact"]) == [1_000_000 * k for k in range(1, 6)]  # the first is cut by the start
    assert list(left.truth["foot_off"]) == [1_000_000 * k + 600_000 for k in range(1, 6)]


def test_short_stances_do_not_count():
    total = np.zeros(300)
    total[50:69], total[100:120] = 60.0, 60.0
    assert gaitpdb.contacts(total).tolist() == [[100, 120]]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:6], r[6] + "\t1", *r[7:]], "line 7: 20 cells; must have 19"),
        (lambda r: [*r[:6], r[6].replace("0.06", "0,06"), *r[7:]], "line 7: column 'time' has a decimal comma"),
        (lambda r: [*r[:6], "\t" + r[6].split("\t", 1)[1], *r[7:]], "line 7: column 'time' is empty"),
        (lambda r: [*r[:6], "x" + r[6], *r[7:]], "line 7: column 'time' is 'x0.06', not a number"),
        (lambda r: [*r[:6], "nan" + r[6][4:], *r[7:]], "line 7: column 'time' is 'nan', not a finite number"),
        (lambda r: [*r[:6], r[2], *r[7:]], "line 7: time 0.02 s is not after"),
        (lambda r: r[:1], "the file has fewer than 2 lines"),
    ],
)
def test_a_spoilt_gaitpdb_line_is_named(tmp_path, change, said):
    write_gaitpdb(tmp_path, change=change)
    with pytest.raises(FormatError, match=f"GaCo99_01.txt[,:] {said}"):
        list(formats.trials(tmp_path))


def test_a_damaged_gzip_file_is_one_error(tmp_path):
    file = write_gaitpdb(tmp_path, "GaCo99_01.txt.gz")
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(FormatError, match="the gzip file is damaged or not complete"):
        list(formats.trials(tmp_path))


def test_derived_truth_equals_events_csv_of_gaitpdb(tmp_path):
    folder = shared("insole_gaitpdb")
    for file in gaitpdb.files(folder):
        (tmp_path / file.name).symlink_to(file)
    pairs = list(zip(gaitpdb.trials(tmp_path), gaitpdb.trials(folder), strict=True))
    assert len(pairs) == 48
    for derived, told in pairs:
        assert all(np.array_equal(derived.truth[e], told.truth[e]) for e in told.truth)
