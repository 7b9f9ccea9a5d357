"""F-Scan and I-Scan movies: excerpts as published, files made here with each trap, and the whole movies where there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from refusal import refused_saying as refused
from typer.testing import CliRunner

import taxel
from taxel import FormatError, formats
from taxel.cli import app
from taxel.formats import tekscan

from .making import shared, write_tekscan

EXCERPTS = Path(__file__).parents[1] / "data" / "formats"


def by_hand(file: Path) -> np.ndarray:
    """Read the cells of every frame without a thought for errors: each line with a cell, in order; no cell is -1."""
    lines = [line for line in file.read_text().splitlines() if line[:1] in "B0123456789" and "," in line]
    return np.array([[float(cell.replace("B", "-1")) for cell in line.split(",")] for line in lines])


@pytest.mark.parametrize(
    ("name", "shape", "unit", "pitch", "taxels"),
    [("fscan.asf", (3, 60, 21), "kPa", 5.08, 955), ("iscan.csv", (3, 28, 28), "counts", 1.27, 484)],
)
def test_an_excerpt_as_published_is_read_as_by_hand(name, shape, unit, pitch, taxels):
    file = EXCERPTS / name
    (trial,) = formats.trials(file)
    cells = by_hand(file).reshape(shape)
    frames = trial.frames
    assert np.array_equal(frames.values, np.maximum(cells, 0))
    assert np.array_equal(frames.array.exists, cells[0] >= 0)
    assert (frames.unit, frames.array.pitch_mm, frames.array.taxels) == (unit, pytest.approx(pitch), taxels)
    assert frames.values.max() > 0


def test_times_are_those_that_the_frames_state_else_their_numbers_times_the_period():
    assert taxel.open_all(EXCERPTS / "iscan.csv")[0].frames().t.tolist() == [5_550_000, 5_660_000, 5_760_000]
    assert taxel.open_all(EXCERPTS / "fscan.asf")[0].frames().t.tolist() == [928_000, 960_000, 992_000]


def test_a_missing_frame_and_unequal_spacings(tmp_path):
    (trial,) = tekscan.trials(write_tekscan(tmp_path, unit="KPa", name="press.asf"))
    frames = trial.frames
    assert frames.t.tolist() == [0, 32_000, 64_000, 128_000, 160_000]
    assert frames.unit == "kPa"
    # 2 mm x 5 mm: a loaded cell is 10 mm2, whatever its aspect.
    assert frames.area() == pytest.approx(10.0 * np.count_nonzero(frames.values, axis=(1, 2)))
    assert (trial.about["row_spacing_mm"], trial.about["column_spacing_mm"]) == (2.0, 5.0)
    assert trial.about["SENSOR_TYPE"] == "6900"
    assert trial.series == {}
    assert not frames.array.exists[0, 0]


def test_line_ends_of_both_kinds_and_a_mark_at_the_beginning_read_the_same(tmp_path):
    file = write_tekscan(tmp_path)
    (plain,) = tekscan.trials(file)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n"))
    (other,) = tekscan.trials(file)
    assert other.recorded == plain.recorded
    assert np.array_equal(other.series["raw_sum"], plain.frames.total())


def test_rows_that_a_spreadsheet_filled_up_read_the_same(tmp_path):
    """Rows of fewer cells than the frame's line has commas get the rest of them; more cells are still an error."""
    (plain,) = tekscan.trials(write_tekscan(tmp_path))
    (other,) = tekscan.trials(write_tekscan(tmp_path, lambda rows: [row + "," * (8 - row.count(",")) for row in rows]))
    assert other.recorded == plain.recorded


def swap(old, new):
    return lambda rows: "\n".join(rows).replace(old, new, 1).split("\n")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (swap("MOVIE", "FRAME"), "line 1: DATA_TYPE is 'FRAME'; must be a MOVIE"),
        (swap("ROWS 4\n", ""), "the line ROWS is missing in the header"),
        (swap("ROWS 4", "ROWS 0"), "line 4: ROWS is 0; must be above 0"),
        (swap("ROWS 4", "ROWS 4.5"), "line 4: ROWS is 4.5; must be from 1 to 65535"),
        (swap("a thumb", "ROWS 9"), "line 10: ROWS appears a second time, with another value"),
        (swap("0.2 centimeters", "0.2 furlongs"), "line 6: ROW_SPACING is '0.2 furlongs'; must be a number and milli"),
        (swap("0.2 centimeters", "0,2 centimeters"), "line 6: ROW_SPACING has a decimal comma"),
        (swap("UNITS raw\n", ""), "the line UNITS is missing in the header"),
        (swap("ASCII_DATA @@", "ASCII"), "a line ASCII_DATA @@ must follow the header, but is missing"),
        (swap("Frame 2", "Frame 1"), "line 20: frame 1 follows frame 1"),
        (swap(", 0.032,", ", 0,"), "line 20: time 0 us is not after 0 us"),
        (swap(", 0.032,", ", 0:32,"), "line 20: time is '0:32', not a number"),
        (swap("\n10,12", "\n10,B"), "line 22: cell 2 is 'B'; in frame 1 it is a number"),
        (swap("\n10,12", "\n10,x"), "line 22: cell 2 is 'x', not a number"),
        (swap("\n10,12", "\n10,12,12"), "line 22: 6 cells; must have 5"),
        (swap("\n10,12", "\n10,13"), "line 20: Raw Sum is 380, but the cells add up to 381"),
        (lambda rows: rows[:-1], "ends without @@; its end is missing"),
        (lambda rows: rows[:-3], "ends within frame 6; its end is missing"),
        (swap("Frame 2", "Film 2"), "line 20: 'Film 2.*must be the first line of a frame"),
        (lambda rows: [*rows[:13], "@@"], "line 12: no frame follows this line"),
    ],
)
def test_a_spoilt_line_is_named(tmp_path, change, said):
    file = write_tekscan(tmp_path, change)
    with refused(f"press.csv.*{said}", FormatError):
        list(tekscan.trials(file))


def test_info_draws_a_movie_and_says_its_unit(tmp_path):
    picture, table = tmp_path / "foot.png", tmp_path / "foot.csv"
    ran = CliRunner().invoke(
        app, ["info", str(EXCERPTS / "fscan.asf"), "--picture", str(picture), "--table", str(table)]
    )
    assert ran.exit_code == 0, ran.output
    assert "3 (kPa)" in ran.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert len(table.read_text().splitlines()) == 4


def test_the_whole_fscan_movie_says_what_its_readme_says():
    (trial,) = tekscan.trials(shared("insole_fscan"))
    # kPa on cells of 5.08 mm x 5.08 mm: N.
    force = trial.frames.total() * 5.08**2 * 1e-3
    assert (len(force), round(force.max())) == (205, 924)
    assert (np.flatnonzero((force[1:] > 50) & (force[:-1] <= 50)) + 1).tolist() == [29, 65, 100, 136, 171]


def test_the_whole_iscan_movie_makes_the_sums_that_it_states():
    (trial,) = tekscan.trials(shared("pressure_formats"))
    assert len(trial.frames) == 309
    assert np.array_equal(trial.frames.total(), trial.series["raw_sum"])
