"""Every study is in the registry and says what it is; `test_studies.py` runs all of them."""

from __future__ import annotations

import json
import pkgutil
from importlib import import_module
from pathlib import Path

import pytest

import taxel_studies as studies
from taxel.cli import main

HERE = Path(__file__).parent


def module(name: str) -> str:
    """Return where a study lies."""
    return name.replace(".", "_")


def test_every_file_with_a_study_is_in_the_registry() -> None:
    files = [m.name for m in pkgutil.iter_modules(studies.__path__)]
    there = {name for name in files if hasattr(import_module(f"taxel_studies.{name}"), "WHERE")}
    missing = sorted(there - {module(name) for name in studies.STUDIES})
    assert not missing, f"taxel_studies/__init__.py: STUDIES lacks {', '.join(missing)}"


@pytest.mark.parametrize("name", studies.STUDIES)
def test_a_study_says_what_it_is(name: str) -> None:
    study = studies.load(name)
    assert (study.name, study.title) == (name, studies.STUDIES[name])
    assert "toy" in study.sizes
    assert min(len(study.where), len(study.protocol)) > 10


def test_every_kept_figure_lies_beside_its_numbers() -> None:
    """The page of figures shows them; `python docs/figures.py` draws them."""
    folder = HERE.parents[1] / "benchmarks" / "results" / "figures"
    pictures = {file.stem: json.loads(file.read_text())["pictures"] for file in folder.glob("*.json")}
    assert pictures.keys() <= studies.STUDIES.keys()
    wanted = sorted(name for names in pictures.values() for name in names)
    assert sorted(file.name for file in folder.glob("*.svg")) == wanted, "run docs/figures.py"


def test_every_figure_and_table_of_the_thesis_has_its_study_or_its_drawing() -> None:
    """Those of its results, chapters 3 to 7; a study says in `where` which it holds."""
    last = {3: 6, 4: 10, 5: 14, 6: 15}
    figures = {f"fig{chapter}.{n}" for chapter, most in last.items() for n in range(1, most + 1)}
    # Figures 3.1, 3.2 and 3.4 are of other people's work.
    figures -= {"fig3.1", "fig3.2", "fig3.4"}
    tables = {f"table{n}" for n in ("3.1", "4.1", "5.1", "5.2", "5.3", "6.1", "6.2", "7.1")}
    held = {name for name in studies.STUDIES if name.startswith("fig")} | studies.FIGURES.keys()
    assert held | studies.DRAWN.keys() == figures | tables
    assert not held & studies.DRAWN.keys()


def test_a_figure_runs_the_study_that_holds_it_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["study", "table6.1", "--size", "toy", "--report", str(tmp_path), "--json"])
    assert not ended.value.code
    output = capsys.readouterr()
    assert output.err == "table6.1 is a figure of the study fig6.1\n"
    assert json.loads(output.out)["name"] == "fig6.1"
