"""``taxel footprint`` as a user calls it."""

import csv
import json
import re

import numpy as np
import pytest
from drawn import drawn
from walking import published, two_feet, write

import taxel
from taxel.cli import main
from taxel_gait.footprints import INSOLES

TABLES = ("footprints.csv", "regions.csv", "summary.csv", "symmetry.csv", "curves.csv", "report.html")


def run(*words):
    """Return the exit code of a command."""
    try:
        main(["footprint", *map(str, words)])
    except SystemExit as ended:
        return ended.code
    return 0


def table(path):
    lines = path.read_text().splitlines()
    about = [line for line in lines if line.startswith("#")]
    return about, list(csv.DictReader(lines[len(about) :]))


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Two people, each with both feet, twice."""
    folder = tmp_path_factory.mktemp("plate")
    for k, person in enumerate(("anna", "bo")):
        (folder / person).mkdir()
        for j, left in enumerate((False, True, False, True)):
            frames, _ = drawn(angle=10 * k + 5 * j, left=left, noise=0.01, seed=j)
            taxel.convert(frames, folder / person / f"{j}.npz")
    (folder / "people.csv").write_text("person,weight_kg\nanna,60\nbo,80\n")
    return folder


def test_a_folder_of_prints_gives_tables_masks_and_a_page(plate, tmp_path):
    assert run(plate, "-o", tmp_path / "out") == 0
    masks = {f"{person}-{side}.nine.regions.json" for person in ("anna", "bo") for side in ("left", "right")}
    assert {file.name for file in (tmp_path / "out").iterdir()} == {*TABLES, *masks}
    _, prints = table(tmp_path / "out" / "footprints.csv")
    assert [row["used"] for row in prints] == ["yes"] * 8
    assert [row["foot"] for row in prints] == ["right", "left"] * 4
    _, regions = table(tmp_path / "out" / "regions.csv")
    assert len(regions) == 8 * 9
    own = [row for row in regions if row["recording"] == "anna/0"]
    assert sum(float(row["impulse_share_pct"]) for row in own) == pytest.approx(100)
    _, summed = table(tmp_path / "out" / "summary.csv")
    heel = next(
        row
        for row in summed
        if (row["person"], row["foot"], row["region"], row["measure"]) == ("bo", "left", "heel", "max_force_N")
    )
    assert int(heel["n"]) == 2
    page = (tmp_path / "out" / "report.html").read_text()
    assert "left: 2 in means" in page
    assert "right: 2 in means" in page


def test_both_feet_of_a_walk_are_measured_with_the_feet_that_are_stated(tmp_path):
    for name, left in (("l", True), ("r", False)):
        taxel.convert(drawn(10.0, left=left)[0], tmp_path / f"{name}.npz")
    table_of = "recording,person,foot,walk,condition\nl,anna,left,w,slow\nr,anna,right,w,slow\n"
    (tmp_path / "recordings.csv").write_text(table_of)
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, prints = table(tmp_path / "out" / "footprints.csv")
    assert [(row["recording"], row["foot"], row["condition"]) for row in prints] == [
        ("w", "left", "slow"),
        ("w", "right", "slow"),
    ]


def test_conditions_and_units_are_kept_apart_in_curves_and_on_the_page(tmp_path):
    frames, _ = drawn(10.0)
    for name, times in (("slow", 1), ("fast", 3)):
        own = taxel.Frames(frames.values * times, frames.t, unit="kPa", array=frames.array)
        taxel.convert(own, tmp_path / f"{name}.npz")
    taxel.convert(taxel.Frames(frames.values, frames.t, unit="counts", array=frames.array), tmp_path / "raw.npz")
    table_of = "recording,person,condition\nslow,anna,slow\nfast,anna,fast\nraw,bo,\n"
    (tmp_path / "recordings.csv").write_text(table_of)
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, points = table(tmp_path / "out" / "curves.csv")
    most = {}
    for row in points:
        if row["region"] == "whole":
            key = row["person"], row["condition"], row["load"]
            most[key] = max(most.get(key, 0.0), float(row["mean"]))
    slow, fast = most["anna", "slow", "force_N"], most["anna", "fast", "force_N"]
    assert fast == pytest.approx(3 * slow)
    # 100 mm2 a cell.
    assert most["bo", "", "sum_counts"] == pytest.approx(slow / 100 * 1000)
    page = (tmp_path / "out" / "report.html").read_text()
    for words in ("<h2>anna slow</h2>", "<h2>anna fast</h2>", "<h2>bo</h2>", "force (N)", "sum (counts)"):
        assert words in page
    peaks = [float(cell) for cell in re.findall(r"<td>right</td><td>heel</td><td>([\d.]+)</td>", page)]
    assert peaks[0] * 3 == pytest.approx(peaks[1], rel=1e-3)


def test_wide_has_a_row_a_print(plate, tmp_path):
    run(plate, "-o", tmp_path / "out", "--wide", "--mask", "thirds")
    _, rows = table(tmp_path / "out" / "regions.csv")
    assert len(rows) == 8
    assert all(float(row["rearfoot max_force_N"]) > 0 for row in rows)


def test_a_mask_that_a_person_changed_is_used_in_the_next_run(plate, tmp_path):
    out = tmp_path / "out"
    run(plate, "-o", out, "--mask", "thirds")
    file = out / "anna-left.thirds.regions.json"
    stated = json.loads(file.read_text())
    stated["regions"] = [one for one in stated["regions"] if one["name"] == "rearfoot"]
    stated["regions"][0]["polygon"] = [[-80, -80], [80, -80], [80, 40], [-80, 40]]
    file.write_text(json.dumps(stated))
    run(plate, "-o", out, "--mask", "thirds", "--overwrite")
    about, rows = table(out / "regions.csv")
    assert any(file.name in line for line in about)
    own = [row for row in rows if row["recording"].startswith("anna") and row["foot"] == "left"]
    assert [row["region"] for row in own] == ["rearfoot", "rearfoot"]


def test_prints_that_are_partial_are_named_and_have_no_regions(tmp_path, capsys):
    taxel.convert(drawn()[0], tmp_path / "whole.npz")
    taxel.convert(drawn(cut=(0.35, 2))[0], tmp_path / "part.npz")
    (tmp_path / "people.csv").write_text("person,recording\nanna,*\n")
    assert run(tmp_path, "-o", tmp_path / "out") == 0
    _, prints = table(tmp_path / "out" / "footprints.csv")
    used = {row["recording"]: row["used"] for row in prints}
    assert used["whole"] == "yes"
    assert used["part"].startswith("partial")
    _, regions = table(tmp_path / "out" / "regions.csv")
    assert {row["recording"] for row in regions} == {"whole"}
    assert "partial" in capsys.readouterr().out


def test_a_footprint_without_toes_has_empty_cells(tmp_path):
    frames, _ = drawn(cut=(-1, 0.82))
    taxel.convert(frames, tmp_path / "a.npz")
    run(tmp_path / "a.npz", "-o", tmp_path / "out")
    _, prints = table(tmp_path / "out" / "footprints.csv")
    assert len(prints) == 1


def test_boxes_of_many_people_are_alike_and_are_not_measured(plate, tmp_path, capsys):
    assert run(plate, "-o", tmp_path / "out", "--boxes") == 0
    boxes = sorted((tmp_path / "out" / "boxes").glob("*.npz"))
    assert len(boxes) == 8
    opened = [taxel.open(box) for box in boxes]
    assert {one.array.shape for one in opened} == {(15, 7)}
    # However the foot lay, and of whichever side: heel, hallux and lateral border are on the same cells.
    first, *others = (one.frames().maximum() for one in opened)
    assert all(np.corrcoef(first.ravel(), other.ravel())[0, 1] > 0.85 for other in others)
    # Sums are kept: those of the cells that belong to the print.
    frames, _ = drawn(noise=0.01)
    whole = taxel.open(tmp_path / "out" / "boxes" / "anna-0-1.npz").frames()
    assert whole.total().max() == pytest.approx(frames.total().max(), rel=0.02)
    labels = taxel.Labels(tmp_path / "out" / "boxes" / "labels.csv").times(opened[0])
    assert [len(labels[name]) for name in ("contact", "foot_off")] == [1, 1]
    capsys.readouterr()
    assert run(boxes[0], "-o", tmp_path / "no") == 2
    assert "turned and resized" in capsys.readouterr().err


def test_steps_of_an_insole_of_a_grid_are_prints(tmp_path):
    frames, _ = drawn(10.0)
    # Nine stances of 0.51 s, 0.49 s apart.
    still = np.zeros((49, *frames.values.shape[1:]), np.float32)
    values = np.concatenate([still, *[frames.values, still] * 9])
    times = np.arange(len(values)) * 10_000
    taxel.convert(taxel.Frames(values, times, unit="kPa", array=frames.array), tmp_path / "walk.npz")
    run(tmp_path / "walk.npz", "-o", tmp_path / "out")
    _, prints = table(tmp_path / "out" / "footprints.csv")
    assert len(prints) == 9
    assert [row["used"] for row in prints] == ["first", *["yes"] * 7, "last"]


@pytest.mark.parametrize(("name", "regions"), [("gaitpdb", 4), ("pedar", 9), ("moticon", 4)])
def test_each_sensor_of_an_insole_is_in_one_region(name, regions):
    file = INSOLES / f"{name}.regions.json"
    taxels = [taxel_ for region in taxel.read_regions(file) for taxel_ in region.taxels]
    assert len(taxel.read_regions(file)) == regions
    assert sorted(taxels) == [(k, 0) for k in range({"gaitpdb": 8, "pedar": 99, "moticon": 16}[name])]


def test_steps_of_an_insole_of_few_sensors_have_the_regions_of_a_file(tmp_path):
    write(tmp_path / "GaCo01_01.txt", *two_feet(20.0))
    assert run(tmp_path / "GaCo01_01.txt", "-o", tmp_path / "out") == 0
    about, rows = table(tmp_path / "out" / "regions.csv")
    assert any("gaitpdb.regions.json" in line for line in about)
    used = [row for row in rows if row["used"] == "yes"]
    # Sensors 1 to 3 carry 0.2, 0.1 and 0.1 of the load.
    heel = [float(row["impulse_share_pct"]) for row in used if row["region"] == "heel"]
    assert heel == pytest.approx([40] * len(heel), abs=0.1)
    assert {float(row["max_force_N"]) for row in used if row["region"] == "toes"} == {80.0}
    assert not any(name.startswith("contact_area") for name in rows[0])


def test_an_insole_whose_sensors_nobody_states_is_refused(tmp_path, capsys):
    values = np.abs(np.sin(np.arange(900) / 20))[:, None, None] * np.ones((1, 1, 5))
    taxel.convert(taxel.Frames(values, np.arange(900) * 10_000, unit="N"), tmp_path / "five.npz")
    assert run(tmp_path / "five.npz", "-o", tmp_path / "out") == 2
    assert "--sensors FILE" in capsys.readouterr().err


def test_places_of_moticon_give_the_centre_that_its_files_state():
    from pandas import read_csv

    stated = json.loads((INSOLES / "moticon.regions.json").read_text())
    for path in sorted(published("insole_moticon").glob("*.txt")):
        names = next(line for line in path.read_text("utf-8").splitlines()[::-1] if line.startswith("#"))
        columns = names.lstrip("# ").split("\t")
        rows = read_csv(path, sep="\t", comment="#", header=None, names=columns)
        for foot in ("left", "right"):
            pressures = rows[[name for name in columns if name.startswith(f"{foot} pressure")]].to_numpy()
            centre = rows[[name for name in columns if name.startswith(f"{foot} center")]].to_numpy()
            loaded = rows[f"{foot} total force[N]"].to_numpy() > 200
            found = pressures @ np.array(stated["places"]) / pressures.sum(axis=1, keepdims=True)
            assert np.nanstd((found - centre)[loaded], axis=0) == pytest.approx([0, 0], abs=0.02)


def test_where_no_print_is_whole_the_page_says_so(tmp_path):
    taxel.convert(drawn(cut=(0.35, 2))[0], tmp_path / "part.npz")
    assert run(tmp_path / "part.npz", "-o", tmp_path / "out") == 0
    assert "no footprint is in means" in (tmp_path / "out" / "report.html").read_text()


def test_a_file_that_holds_no_print_is_one_line(tmp_path, capsys):
    taxel.convert(taxel.Frames(np.ones((5, 4, 4)), np.arange(5) * 1000, unit="kPa"), tmp_path / "no_pitch.npz")
    assert run(tmp_path / "no_pitch.npz", "-o", tmp_path / "out") == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "pitch" in said[0]


@pytest.mark.parametrize("words", [["--mask", "ten"], ["--side", "both"], ["--definition", "x"], ["--above", "-1"]])
def test_what_cannot_be_is_one_line(tmp_path, capsys, words):
    taxel.convert(drawn(10.0)[0], tmp_path / "a.npz")
    assert run(tmp_path / "a.npz", *words, "-o", tmp_path / "out") == 2
    assert capsys.readouterr().err.count("\n") == 1
