"""The gait study at toy size, on people made here: the whole way from files to the report."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.formats.making import interpolated, write_gaitndd

from taxel import FormatError, ProblemError
from taxel.cli import main
from taxel_studies import load
from taxel_studies.page import write_page
from taxel_studies.runner import Kept, Task
from taxel_studies.study import Section

GAIT = load("gait")


def study(data: Path | None, report: Path, *, strict: bool = False, **changes) -> Section:
    """Run the study at toy size; its part of the page."""
    return GAIT.run(report, size="toy", data=data, changes=changes, strict=strict, quiet=True)


def walker(folder: Path, name: str, seed: int) -> None:
    """Write 12 s of walking in the manner of gaitpdb: eight sensors that load from heel to toe."""
    rng = np.random.default_rng(seed)
    t = np.arange(1200) / 100
    columns = [t]
    for foot in (0.0, 0.55):
        phase = (t + foot + 0.2 * rng.random()) % 1.1 / 1.1
        for k in range(8):
            rise, fall = 0.02 + 0.04 * k, 0.35 + 0.035 * k
            load = 120 * np.clip((phase - rise) / 0.04, 0, 1) * np.clip((fall - phase) / 0.04, 0, 1)
            columns.append(np.round(load * (0.8 + 0.4 * rng.random()) + rng.normal(0, 0.5, len(t)).clip(0), 2))
    values = np.column_stack([*columns, sum(columns[1:9]), sum(columns[9:17])])
    lines = ["\t".join(f"{v:.4f}" for v in row) for row in values]
    (folder / f"{name}_01.txt").write_text("\n".join(lines) + "\n")


def stepper(folder: Path, name: str, seed: int, count: int = 5) -> None:
    """Write footfalls in the manner of the plate: a foot that rolls from heel to toes."""
    rng = np.random.default_rng(seed)
    with h5py.File(folder / f"{name}.h5", "w") as h5:
        for n in range(count):
            frames = int(rng.integers(150, 190))
            rows, columns, t = np.mgrid[0:34, 0:16, 0:frames].astype(float)
            outline = (np.abs(columns - 7.5 - 0.1 * rows) < 5) & (rows > 1)
            centre = 4 + 26 * np.clip((t - 0.2 * frames) / (0.7 * frames), 0, 1)
            width = 9 - 5 * t / frames
            load = 900 * outline * np.exp(-(((rows - centre) / width) ** 2)) * np.sin(np.pi * (t + 2) / (frames + 3))
            load = np.where(load > 25, load + rng.integers(0, 9, load.shape), 0).astype(np.int64)
            image = np.zeros((60, 18, 220), np.uint16)
            image[:, :16, :frames] = interpolated(load, 3 + n % 3, 60)
            h5[f"img{n:03d}"] = image


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    (folder / "insole_gaitpdb").mkdir()
    for k, name in enumerate(("GaCo90", "GaCo91", "GaPt90", "GaPt91")):
        walker(folder / "insole_gaitpdb", name, k)
    (folder / "plate").mkdir()
    for k in range(3):
        stepper(folder / "plate", f"subj90{k}", k)
    return folder


@pytest.fixture(scope="module")
def ran(data, tmp_path_factory) -> tuple[Path, Section]:
    folder = tmp_path_factory.mktemp("report")
    return folder, study(data, folder)


def results_of(data: Path, report: Path, **changes) -> list[tuple[Task, dict]]:
    """Return the realisations of a run with their results."""
    kept = Kept(report / "cache", "0123abc")
    listed = GAIT.tasks(GAIT.set("toy", **changes), data=data)
    return [(task, kept.row(GAIT.realise, {"data": data}, task).result) for task in listed]


def rows(section: Section, source: str, event: str) -> dict[str, dict]:
    found = next(s for s in section["said"]["sources"] if s["source"] == source)
    return {row["row"]: row for row in found["protocols"][0]["rows"] if row["event"] == event}


def test_a_toy_study_has_all_its_rows_and_finds_easy_steps(ran):
    _, section = ran
    assert section["said"]["skipped"] == ["insole_gaitndd"]
    contact = rows(section, "gaitpdb", "contact")
    assert {"recipe", "chosen", "printed", "count", "labels' own rule"} == set(contact)
    assert contact["recipe"]["figures"]["events"] >= 70
    assert contact["recipe"]["figures"]["found_percent"] >= 95
    assert contact["labels' own rule"]["figures"]["found_percent"] >= 95
    assert contact["chosen"]["figures"]["found_percent"] >= 95
    assert contact["printed"]["figures"]["false"] > 10 * contact["recipe"]["figures"]["false"]
    footfall = rows(section, "plate", "contact")
    assert {"recipe", "chosen", "printed", "count"} == set(footfall)
    assert footfall["recipe"]["figures"]["events"] == 15
    assert footfall["recipe"]["figures"]["missed"] <= 1


def test_every_figure_adds_up(ran):
    _, section = ran
    for source in section["said"]["sources"]:
        for row in source["protocols"][0]["rows"]:
            f = row["figures"]
            assert f["found"] + f["missed"] == f["events"]
            assert sum(p["events"] for p in row["by_person"].values()) == f["events"]
            assert sum(p["false"] for p in row["by_person"].values()) == f["false"]


def test_errors_take_off_the_delay_that_known_keeps(data, ran):
    for task, result in results_of(data, ran[0]):
        if task.params["kind"] == "neuron" and task.params["source"] == "gaitpdb":
            for units in result["tested"].values():
                for unit in units.values():
                    late = np.subtract(unit["delays"], unit["errors"])
                    assert np.allclose(late, result["point"]["learner"]["delay_ms"], atol=0.2)


def test_the_page_shows_every_row_and_the_folds_lie_with_the_numbers(ran):
    folder, section = ran
    assert json.loads((folder / "gait" / "summary.json").read_text())["said"] == json.loads(json.dumps(section["said"]))
    assert len(json.loads((folder / "gait" / "summary.json").read_text())["pictures"]) == 2
    page = write_page(folder).read_text()
    assert "Table 6.2 as printed" in page
    assert "sum of the inputs" in page
    assert page.count("count") >= 2, "a row a source"
    assert "gaitpdb, people left out: contact, chosen, by person" in page
    people = section["said"]["folds"]["gaitpdb/people left out"]
    assert sum(len(group) for group in people[0]["groups"]) == 8


def test_a_second_run_reckons_nothing_again(data, ran):
    folder, section = ran
    before = set((folder / "cache").rglob("output.pkl"))
    assert study(data, folder)["said"] == section["said"]
    assert set((folder / "cache").rglob("output.pkl")) == before


def test_what_the_thesis_says_is_judged_by_the_rows_that_stand_for_it(ran):
    says = [statement["says"] for statement in ran[1]["statements"]]
    assert "On walking recordings it finds more than 95 % of contact." in says
    assert {s["why"].split(";")[0] for s in ran[1]["statements"] if "walking" in s["says"]} == {
        "gaitpdb, people left out"
    }
    with pytest.raises(ProblemError, match="gait has no parameter 'tau'"):
        GAIT.set("toy", tau=3)


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(FileNotFoundError):
        study(tmp_path / "nothing", tmp_path)
    with pytest.raises(FormatError, match="gait: contains no recordings; give a folder"):
        study(None, tmp_path)


@pytest.fixture
def damaged(data, tmp_path) -> Path:
    """The walkers' folder with a file cut short, one that may not be read, and a folder with nothing readable."""
    folder = tmp_path / "damaged"
    (folder / "insole_gaitpdb").mkdir(parents=True)
    (folder / "insole_gaitndd").mkdir()
    for file in (data / "insole_gaitpdb").iterdir():
        (folder / "insole_gaitpdb" / file.name).symlink_to(file)
    whole = (data / "insole_gaitpdb" / "GaCo90_01.txt").read_text()
    (folder / "insole_gaitpdb" / "GaPt99_01.txt").write_text(whole[:5000])
    (folder / "insole_gaitndd" / "park1.hea").write_text("park1 2\n")
    (folder / "insole_gaitndd" / "park1.let").write_text("")
    return folder


def test_a_file_that_cannot_be_read_is_left_out_and_said(ran, damaged, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["study", "gait", "--data", str(damaged), "--size", "toy", "--report", str(tmp_path / "report")])
    assert not ended.value.code
    out, error = capsys.readouterr()
    assert error.startswith("gait: reading the recordings in ")
    assert "left out, because it could not be read: insole_gaitpdb/GaPt99_01.txt: line" in out
    assert "left out, because it could not be read: insole_gaitndd/park1.hea: " in out
    section = json.loads((tmp_path / "report" / "gait" / "summary.json").read_text())
    assert list(section["unread"]) == ["insole_gaitpdb/GaPt99_01.txt", "insole_gaitndd/park1.hea"]
    assert "park1.hea" in (tmp_path / "report" / "index.html").read_text()
    found, whole = (rows(s, "gaitpdb", "contact")["recipe"]["figures"] for s in (section, ran[1]))
    assert found == whole, "the people that can be read are judged as if the others were not there"


def test_strict_ends_at_a_file_that_cannot_be_read_before_anything_is_reckoned(damaged, tmp_path):
    report = tmp_path / "report"
    with pytest.raises(FormatError, match=r"^insole_gaitpdb/GaPt99_01\.txt: line .* \(1 more cannot be read\)$"):
        study(damaged, report, strict=True)
    with pytest.raises(FormatError, match=r"park1\.hea"):
        load("fig6.15").run(report, size="toy", data=damaged, strict=True, quiet=True)
    assert not report.exists()


def test_a_recording_shorter_than_the_running_range_is_left_out_and_said(tmp_path):
    folder = tmp_path / "insole_gaitndd"
    folder.mkdir()
    for name in ("control1", "control2", "park1", "park2"):
        write_gaitndd(folder, name, samples=3900)
    write_gaitndd(folder, "park3", samples=2700)
    section = study(tmp_path, tmp_path / "report")
    why = "lasts 8.99667 s, and levels in shares of the running range want 10 s"
    assert section["unread"] == {"insole_gaitndd/park3.hea": why}
    assert [one["source"] for one in section["said"]["sources"]] == ["gaitndd"]
    alone = tmp_path / "alone"
    (alone / "insole_gaitndd").mkdir(parents=True)
    write_gaitndd(alone / "insole_gaitndd", "park3", samples=2700)
    with pytest.raises(FormatError, match=f"^insole_gaitndd/park3.hea: {why}$"):
        study(alone, tmp_path / "other")
