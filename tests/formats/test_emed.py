"""emed steps: an excerpt as published, files made here with each trap, and the whole step where it is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from refusal import refused_saying as refused

from taxel import FormatError, formats
from taxel.formats import emed

from .making import shared, write_emed

EXCERPT = Path(__file__).parents[1] / "data" / "formats" / "emed.lst"


def test_an_excerpt_as_published_makes_the_forces_that_it_states_in_every_row_and_column():
    (trial,) = formats.trials(EXCERPT)
    frames = trial.frames
    assert (frames.values.shape, frames.unit, frames.array.pitch_mm) == ((3, 95, 64), "kPa", pytest.approx(5.0))
    assert frames.t.tolist() == [0, 400_000, 410_000]
    # Read once more, by what stands in the margins alone; 0.25 cm2 of 1 kPa are 0.025 N.
    pages = EXCERPT.read_text("latin-1").split("Pict-No.")[1:]
    for values, page in zip(frames.values * 0.025, pages, strict=True):
        rows = {int(m[1]) - 1: float(m[2]) for m in re.finditer(r"^(\d+)\t.*\t([\d.]+)$", page, re.M)}
        columns = [float(n) for n in re.search(r"^Force\t(.*)$", page, re.M)[1].split()]
        for row in range(95):
            assert values[row].sum() == pytest.approx(rows.get(row, 0.0), abs=0.0051)
        for k, force in enumerate(columns[:-1]):
            assert values[:, 25 + k].sum() == pytest.approx(force, abs=0.0051)
        assert values.sum() == pytest.approx(columns[-1], abs=0.0051)


def test_margins_are_no_sensors_and_summaries_no_frames(tmp_path):
    summary = ["\t\t\t\tPage 4", "\tMVP, maximum over all", "\t2\t3\t4\tForce", "3\t9\t9\t9\t1", "Force\t1\t1\t1\t1"]
    (trial,) = emed.trials(write_emed(tmp_path, lambda rows: [*rows, *summary]))
    frames = trial.frames
    assert frames.values.shape == (3, 10, 8)
    assert frames.values[1, 2:6, 1:4].tolist() == [[0, 10, 0], [20, 30, 10], [40, 60, 20], [10, 20, 0]]
    assert frames.total().tolist() == [110.0, 220.0, 330.0]
    assert trial.series["total"] == pytest.approx(frames.total() * 0.025)
    assert frames.t.tolist() == [0, 10_000, 20_000]


def test_cells_in_newton_per_square_centimetre_are_known_by_the_forces(tmp_path):
    def tenth(rows):
        every = []
        for row in rows:
            cells = row.split("\t")
            if re.fullmatch(r"\d", cells[0]):
                cells[1:4] = [f"{float(cell) / 10:.2f}" for cell in cells[1:4]]
            every.append("\t".join(cells))
        return every

    (trial,) = emed.trials(write_emed(tmp_path, tenth))
    assert trial.frames.unit == "N/cm2"
    assert trial.frames.total() == pytest.approx([11.0, 22.0, 33.0])


def swap(old, new):
    return lambda rows: "\n".join(rows).replace(old, new, 1).split("\n")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            swap("5\t20.00", "5\t21.00"),
            "line 13: Force is 2.75 N, but the cells of frame 1 add up to 2.775 N .kPa on 0.25 cm2.",
        ),
        (swap("5\t20.00", "5\t20,00"), "line 11: column 2 has a decimal comma"),
        (swap("5\t20.00", "5\tB"), "line 11: column 2 is 'B', not a number"),
        (swap("5\t20.00", "5\t1\t20.00"), "line 11: 6 cells; must have 5"),
        (swap("5\t20.00", "4\t20.00"), "line 11: row is 4; must be whole numbers from 1 to 10 that ascend"),
        (swap("\t2\t3\t4", "\t2\t3\t9"), "line 8: column is 9; must be whole numbers from 1 to 8 that ascend"),
        (swap("4\tForce", "4"), "line 8: a line of column numbers that ends in Force is missing here"),
        (swap("Force\t", "Power\t"), "line 19: frame 1 ends without the line Force"),
        (swap("Matrix: 8x10", "Matrix: 8"), "a line like 'Matrix: 64x95' is missing above"),
        (swap("Matrix: 8x10", "Matrix: 0x10"), "the matrix above is 0"),
        (swap("Time/picture:10.0", "Time/picture:0.0"), "the period above is 0"),
        (swap("Pict-No.: 2", "Pict-No.: 1"), "line 20: frame 1 follows frame 1"),
        (lambda rows: [r for r in rows if "Pict-No" not in r], "no page states the number of its frame"),
        (lambda rows: rows[:-5], "frame 3 ends without the line Force"),
    ],
)
def test_a_spoilt_line_is_named(tmp_path, change, said):
    file = write_emed(tmp_path, change)
    with refused(f"step.lst.*{said}", FormatError):
        list(emed.trials(file))


def test_the_whole_step_makes_the_forces_that_it_states():
    (trial,) = emed.trials(shared("pressure_formats"))
    assert len(trial.frames) == 106
    assert trial.series["total"][0] == 39.63
    assert trial.frames.total() * 0.025 == pytest.approx(trial.series["total"], abs=0.0051)
