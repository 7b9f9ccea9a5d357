"""The gait study at toy size, on people made here: the whole way from files to the report."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from tests.formats.making import interpolated

from taxel import FormatError, ProblemError
from taxel_studies import load
from taxel_studies.study import Section

GAIT = load("gait")


def study(data: Path | None, report: Path, **changes) -> Section:
    """Run the study at toy size; its part of the page."""
    return GAIT.run(report, size="toy", data=data, changes=changes, quiet=True)


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
    assert contact["printed"]["figures"]["found_percent"] >= 95
    footfall = rows(section, "plate", "contact")
    assert {"recipe", "chosen", "printed", "count"} == set(footfall)
    assert footfall["recipe"]["figures"]["events"] == 15
    assert footfall["recipe"]["figures"]["missed"] <= 1


def test_the_search_counts_each_setting_over_all_folds_as_the_row_of_its_table_does(data, tmp_path):
    asked = {"sources": ["plate"], "protocols": ["own footfalls"], "rows": ["printed", "searched"]}
    grid = {"tau": [70.0, 190.0], "kappa": [1.2, 1.25], "lambda_2": [1.2, 4.0]}
    said = study(data, tmp_path, **asked, grid=grid, events=0)["said"]
    searched = {(one["event"], one["tau"], one["kappa"], one["lambda_2"]): one for one in said["searched"]}
    assert len(searched) == 16
    for event, tau, kappa in (("contact", 70.0, 1.2), ("foot_off", 190.0, 1.25)):
        printed = rows({"said": said}, "plate", event)["printed"]["figures"]
        assert {name: printed[name] for name in ("events", "missed", "false", "false_near")} == {
            name: searched[event, tau, kappa, 1.2][name] for name in ("events", "missed", "false", "false_near")
        }


def test_every_figure_adds_up(ran):
    _, section = ran
    for source in section["said"]["sources"]:
        for row in source["protocols"][0]["rows"]:
            f = row["figures"]
            assert f["found"] + f["missed"] == f["events"]
            assert sum(p["events"] for p in row["by_person"].values()) == f["events"]
            assert sum(p["false"] for p in row["by_person"].values()) == f["false"]


@pytest.mark.parametrize("changes", [{"sources": ["mat"]}, {"protocols": ["nobody left out"]}])
def test_a_source_or_protocol_that_is_none_is_refused(data, tmp_path, changes):
    with pytest.raises(ProblemError, match="must be one of"):
        study(data, tmp_path, **changes)


@pytest.mark.parametrize("name", ["gait", "fig6.15"])
def test_a_file_that_cannot_be_read_ends_the_study_before_anything_is_reckoned(data, tmp_path, name):
    folder, report = tmp_path / "damaged", tmp_path / "report"
    (folder / "insole_gaitpdb").mkdir(parents=True)
    whole = (data / "insole_gaitpdb" / "GaCo90_01.txt").read_text()
    (folder / "insole_gaitpdb" / "GaPt99_01.txt").write_text(whole[:5000])
    with pytest.raises(FormatError, match=r"^GaPt99_01\.txt, line"):
        load(name).run(report, size="toy", data=folder, quiet=True)
    assert not list(report.rglob("*.pkl"))
