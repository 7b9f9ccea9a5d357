"""Each trap of the format on files made here, and on novel pedar as published, where that is there."""

from __future__ import annotations

import pytest

from taxel import FormatError, formats
from taxel.formats import pedar

from .making import (
    shared,
    write_pedar,
)


def test_pedar_gives_two_insoles_and_its_own_sum_as_truth(tmp_path):
    write_pedar(tmp_path)
    left, right = formats.trials(tmp_path)
    assert left.frames.values.shape == (200, 1, 5)
    assert left.frames.unit == "kPa"
    assert list(left.truth["contact"]) == [200_000, 700_000, 1_200_000, 1_700_000][: len(left.truth["contact"])]
    assert len(right.truth["contact"]) == len(right.truth["foot_off"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r: [*r[:9], r[9] + "\t1.0", *r[10:]], "line 10: 12 cells; must have 11"),
        (lambda r: [*r[:9], r[9].replace(".", ","), *r[10:]], "line 10: column 'time.secs.' has a decimal comma"),
        (
            lambda r: [r[0], r[1].replace("100", "50"), *r[2:]],
            "line 7: the time is 10000 us after that of the line above; must fit 50 Hz",
        ),
        (lambda r: [r[0], *r[2:]], "a line 'scanning rate"),
        (lambda r: [*r[:4], *r[5:]], "the line of column names"),
    ],
)
def test_a_spoilt_pedar_line_is_named(tmp_path, change, said):
    write_pedar(tmp_path, change)
    with pytest.raises(FormatError, match=f"walk.asc.*{said}"):
        list(formats.trials(tmp_path))


def test_a_pedar_table_without_rows_is_two_empty_recordings(tmp_path):
    write_pedar(tmp_path, lambda rows: rows[:5])
    for trial in formats.trials(tmp_path):
        assert trial.frames.values.shape == (0, 1, 5)
        assert not any(map(len, trial.truth.values()))


def test_pedar_contacts_are_the_rows_that_the_readme_lists():
    left, right = pedar.trials(shared("pressure_formats"))
    assert list(left.truth["contact"] // 10_000 - 1) == [343, 477, 603, 734, 859, 988, 1119, 1249, 1389]
    assert list(right.truth["contact"] // 10_000 - 1) == [406, 536, 665, 793, 922, 1056, 1181, 1320]
