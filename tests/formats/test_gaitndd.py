"""Each trap of the format on files made here, and on PhysioNet gaitndd as published, where that is there."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import FormatError, formats
from taxel.formats import gaitndd, text

from .making import (
    pack_212,
    shared,
    write_gaitndd,
)


@given(st.lists(st.integers(-2048, 2047), min_size=2, max_size=40).filter(lambda v: len(v) % 2 == 0))
def test_format_212_round_trip(values):
    assert gaitndd.format_212(pack_212(np.array(values))).tolist() == values


def test_gaitndd_gives_step_times_and_leaves_out_invalid_samples(tmp_path):
    write_gaitndd(tmp_path)
    left, right = formats.trials(tmp_path)
    assert list(left.truth["contact"]) == [1_000_000 * k for k in range(2, 9)]
    assert list(left.truth["foot_off"]) == [1_000_000 * k - 400_000 for k in range(3, 9)]
    assert (len(left.frames), len(right.frames)) == (3000, 2999)
    assert right.truth == {}
    assert right.frames.t[0] == 3333


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (".hea", " 212 ", " 16 ", "line 2: the format is 16; must be 212"),
        (".hea", "300 3000\r", "300 3001\r", "4500 bytes; must be 4503 for 3001 samples of format 212"),
        (".hea", " 0 500 ", " 0 501 ", "the first value is 500; must be 501, as the header states"),
        (".hea", "control99.let", "../control99.let", "is not a plain file name"),
        (".ts", "5.0000\t1.0000", "5,0000\t1.0000", "line 3: column 'time' has a decimal comma"),
        (
            ".ts",
            "5.0000\t1.0000",
            "4.0000\t1.0000",
            "line 3: times must ascend, and swing must be above 0 and below stride",
        ),
    ],
)
def test_a_spoilt_gaitndd_file_is_named(tmp_path, file, old, new, said):
    path = write_gaitndd(tmp_path).with_suffix(file)
    content = path.read_bytes().decode()
    assert old in content
    path.write_bytes(content.replace(old, new, 1).encode())
    with pytest.raises(FormatError, match=said):
        list(formats.trials(tmp_path))


def test_a_wrong_checksum_is_found(tmp_path):
    path = write_gaitndd(tmp_path).with_suffix(".let")
    data = bytearray(path.read_bytes())
    data[100] ^= 1
    path.write_bytes(data)
    with pytest.raises(FormatError, match="the sum of the samples is"):
        list(formats.trials(tmp_path))


def test_gaitndd_has_the_strides_that_its_table_of_people_says():
    folder = shared("insole_gaitndd")
    people = {row["person"]: row for row in text.table(folder / "people.csv", ["person"])}
    for trial in gaitndd.trials(folder):
        if trial.foot == "left":
            row = people[trial.person]
            assert len(trial.truth["foot_off"]) == int(row["reference_strides"])
            assert trial.truth["contact"][1] == round(float(row["reference_from_s"]) * 1e6)
