"""Files of makers: excerpts as published, files made here with each trap, and whole recordings where they are."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from formats.making import shared, write_emed, write_moticon, write_pedar, write_tekscan

import taxel
from taxel import FormatError, Frames, Recording
from taxel.recording.kinds import kind_of

EXCERPTS = Path(__file__).parents[2] / "tests" / "data" / "formats"
WRITERS = {"pedar": write_pedar, "moticon": write_moticon, "tekscan": write_tekscan, "emed": write_emed}


def feet(path: Path) -> list[Recording]:
    return list(taxel.open(path).sources.values())


def swap(old: str, new: str) -> Callable[[list[str]], list[str]]:
    return lambda rows: "\n".join(rows).replace(old, new, 1).split("\n")


def only(path: Path) -> Frames:
    return taxel.open(path).frames()


@pytest.mark.parametrize("name", WRITERS)
def test_a_makers_file_is_known_whatever_its_line_ends_and_capitals(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path)
    plain = [each.frames() for each in feet(path)]
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    path = path.rename(tmp_path / path.name.upper())
    assert kind_of(path) == name
    assert [each.frames() for each in feet(path)] == plain


def test_moticon_rows_that_are_missing_for_a_foot_are_missing_not_zero(tmp_path: Path) -> None:
    left, right = feet(write_moticon(tmp_path))
    frames = left.frames()
    assert (len(frames), len(right.frames())) == (199 - 11, 199)
    assert frames.t[0] == 100_000
    assert 600_000 not in frames.t
    assert 1_200_000 not in right.frames().t
    assert frames.values[frames.t == 610_000].min() == 2.5
    assert [(note.text, note.t) for note in left.notes] == [("contact", 500_000), ("foot_off", 1_000_000)]
    assert right.notes == ()
    for each, other in ((left, "right "), (right, "left ")):
        [line] = each.lost
        assert f"{each.side} cop Y" in line
        assert other not in line
        assert "pressure 1" not in line


def test_moticon_steps_of_published_walks() -> None:
    counts = []
    for name in ("230927_102114.txt", "230927_102137.txt"):
        for foot in feet(shared("insole_moticon") / name):
            counts += [len([note for note in foot.notes if note.text == event]) for event in ("contact", "foot_off")]
    assert counts == [7, 7, 7, 7, 9, 9, 9, 9]


@pytest.mark.parametrize(
    ("name", "shape", "unit", "pitch", "taxels", "t"),
    [
        ("fscan.asf", (3, 60, 21), "kPa", 5.08, 955, [928_000, 960_000, 992_000]),
        ("iscan.csv", (3, 28, 28), "counts", 1.27, 484, [5_550_000, 5_660_000, 5_760_000]),
    ],
)
def test_an_excerpt_of_tekscan_is_read_as_by_hand(
    name: str, shape: tuple[int, ...], unit: str, pitch: float, taxels: int, t: list[int]
) -> None:
    lines = (EXCERPTS / name).read_text().splitlines()
    rows = [line for line in lines if line[:1] in "B0123456789" and "," in line]
    cells = np.array([[float(cell.replace("B", "-1")) for cell in row.split(",")] for row in rows]).reshape(shape)
    frames = only(EXCERPTS / name)
    assert np.array_equal(frames.values, np.maximum(cells, 0))
    assert np.array_equal(frames.array.exists, cells[0] >= 0)
    assert (frames.unit, frames.array.pitch_mm, frames.array.taxels) == (unit, pytest.approx(pitch), taxels)
    assert frames.t.tolist() == t


@pytest.mark.parametrize(
    ("unit", "stated", "end"), [("KPa", "1514.73 KPa", 1514.0), ("raw", "1514.73 KPa", None), ("KPa", "much KPa", None)]
)
def test_the_end_of_the_range_is_that_of_the_header_in_the_unit_of_the_cells(
    tmp_path: Path, unit: str, stated: str, end: float | None
) -> None:
    file = write_tekscan(tmp_path, lambda rows: [*rows[:5], f"SATURATION_PRESSURE {stated} ", *rows[5:]], unit=unit)
    assert taxel.open(file).range_end == end


def test_a_missing_frame_unequal_spacings_and_a_filled_up_row(tmp_path: Path) -> None:
    frames = only(write_tekscan(tmp_path, unit="KPa", name="press.asf"))
    assert frames.t.tolist() == [0, 32_000, 64_000, 128_000, 160_000]
    # 2 mm x 5 mm: a loaded cell is 10 mm2, whatever its aspect.
    assert frames.area() == pytest.approx(10.0 * np.count_nonzero(frames.values, axis=(1, 2)))
    assert frames.array.exists is not None
    assert not frames.array.exists[0, 0]
    plain = only(write_tekscan(tmp_path))
    assert only(write_tekscan(tmp_path, lambda rows: [row + "," * (8 - row.count(",")) for row in rows])) == plain


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("tekscan", swap("ROWS 4\n", "")),
        ("tekscan", swap("ROWS 4", "ROWS 4.5")),
        ("tekscan", swap("0.2 centimeters", "0.2 furlongs")),
        ("tekscan", swap("UNITS raw\n", "")),
        ("tekscan", swap("ASCII_DATA @@", "ASCII")),
        ("tekscan", swap(", 0.032,", ", 0,")),
        ("tekscan", swap("\n10,12", "\n10,B")),
        ("tekscan", swap("\n10,12", "\n10,x")),
        ("tekscan", swap("\n10,12", "\n10")),
        ("emed", swap("5\t20.00", "5\t20,00")),
        ("emed", swap("5\t20.00", "5\tB")),
        ("emed", swap("5\t20.00", "5\t1\t2\t20.00")),
        ("emed", swap("\t2\t3\t4", "\t2\t3\t19")),
        ("emed", swap("4\tForce", "4")),
        ("emed", swap("Force\t", "Power\t")),
        ("emed", swap("Matrix: 8x10", "Matrix: 8")),
        ("emed", swap("Pict-No.: 2", "Pict-No.: 1")),
        ("emed", lambda rows: rows[:-5]),
        ("emed", lambda rows: [row for row in rows if "Pict-No" not in row]),
        ("pedar", swap("time[secs]", "seconds")),
        ("pedar", lambda rows: rows[:5]),
        ("moticon", swap("# time", "# frames")),
    ],
)
def test_a_spoilt_file_is_refused(name: str, change: Callable[[list[str]], list[str]], tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path, change)
    with pytest.raises(FormatError, match=re.escape(path.name)):
        taxel.open(path)


def test_an_excerpt_of_emed_makes_the_forces_that_it_states_in_every_row_and_column() -> None:
    frames = only(EXCERPTS / "emed.lst")
    assert (frames.values.shape, frames.unit, frames.array.pitch_mm) == ((3, 95, 64), "kPa", pytest.approx(5.0))
    assert frames.t.tolist() == [0, 400_000, 410_000]
    # Read once more, by what stands in the margins alone; 0.25 cm2 of 1 kPa are 0.025 N.
    pages = (EXCERPTS / "emed.lst").read_text("latin-1").split("Pict-No.")[1:]
    for values, page in zip(frames.values * 0.025, pages, strict=True):
        rows = {int(m[1]) - 1: float(m[2]) for m in re.finditer(r"^(\d+)\t.*\t([\d.]+)$", page, re.M)}
        found = re.search(r"^Force\t(.*)$", page, re.M)
        assert found is not None
        columns = [float(n) for n in found[1].split()]
        for row in range(95):
            assert values[row].sum() == pytest.approx(rows.get(row, 0.0), abs=0.0051)
        for k, force in enumerate(columns[:-1]):
            assert values[:, 25 + k].sum() == pytest.approx(force, abs=0.0051)
        assert values.sum() == pytest.approx(columns[-1], abs=0.0051)


def test_margins_are_no_sensors_summaries_no_frames_and_newtons_are_known_by_the_forces(tmp_path: Path) -> None:
    summary = ["\t\t\t\tPage 4", "\tMVP, maximum over all", "\t2\t3\t4\tForce", "3\t9\t9\t9\t1", "Force\t1\t1\t1\t1"]
    frames = only(write_emed(tmp_path, lambda rows: [*rows, *summary]))
    assert frames.values.shape == (3, 10, 8)
    assert frames.values[1, 2:6, 1:4].tolist() == [[0, 10, 0], [20, 30, 10], [40, 60, 20], [10, 20, 0]]
    assert (frames.total().tolist(), frames.t.tolist()) == ([110.0, 220.0, 330.0], [0, 10_000, 20_000])

    def tenth(rows: list[str]) -> list[str]:
        every = [row.split("\t") for row in rows]
        for cells in every:
            if re.fullmatch(r"\d", cells[0]):
                cells[1:4] = [f"{float(cell) / 10:.2f}" for cell in cells[1:4]]
        return ["\t".join(cells) for cells in every]

    frames = only(write_emed(tmp_path, tenth))
    assert frames.unit == "N/cm2"
    assert frames.total() == pytest.approx([11.0, 22.0, 33.0])


def test_whole_recordings_are_as_their_readme_says() -> None:
    [path] = shared("insole_fscan").glob("*.asf")
    force = only(path).total() * 5.08**2 * 1e-3
    assert (len(force), round(force.max())) == (205, 924)
    assert (np.flatnonzero((force[1:] > 50) & (force[:-1] <= 50)) + 1).tolist() == [29, 65, 100, 136, 171]
    by_kind = {kind_of(file): file for file in shared("pressure_formats").iterdir()}
    assert len(only(by_kind["tekscan"])) == 309
    assert len(only(by_kind["emed"])) == 106
    assert [each.frames().values.shape[1:] for each in feet(by_kind["pedar"])] == [(1, 99), (1, 99)]
