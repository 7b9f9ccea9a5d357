"""Every study is in the registry, and has a test of its own beside the laws that run over all."""

from __future__ import annotations

import ast
import json
import pkgutil
from importlib import import_module
from pathlib import Path

import pytest

import taxel_studies as studies

HERE = Path(__file__).parent


def module(name: str) -> str:
    """Return where a study lies."""
    return name.replace(".", "_")


def named() -> set[str]:
    """Return the studies that a test of this folder imports or names, but for the laws over all."""
    found = set()
    for file in HERE.glob("test_*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                parts = [*node.module.split("."), *(alias.name for alias in node.names)]
                found |= set(parts[1:]) if parts[0] == "taxel_studies" else set()
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(module(node.value))
    return found


def test_every_file_with_a_study_is_in_the_registry() -> None:
    files = [m.name for m in pkgutil.iter_modules(studies.__path__)]
    there = {name for name in files if hasattr(import_module(f"taxel_studies.{name}"), "STUDY")}
    missing = sorted(there - {module(name) for name in studies.STUDIES})
    assert not missing, f"taxel_studies/__init__.py: STUDIES lacks {', '.join(missing)}"


@pytest.mark.parametrize("name", studies.STUDIES)
def test_a_study_has_a_test_of_its_own(name: str) -> None:
    assert module(name) in named(), (
        f"no test of studies/tests imports or names {name}: add studies/tests/test_{module(name)}.py"
    )


@pytest.mark.parametrize("name", studies.STUDIES)
def test_a_study_says_what_it_is(name: str) -> None:
    study = studies.load(name)
    assert study.name == name
    assert study.title == studies.STUDIES[name]
    assert "toy" in study.sizes
    assert min(len(study.where), len(study.protocol)) > 10


def test_every_kept_figure_lies_beside_its_numbers() -> None:
    """The page of figures shows them; `python docs/figures.py` draws them."""
    folder = HERE.parents[1] / "benchmarks" / "results" / "figures"
    pictures = {file.stem: json.loads(file.read_text())["pictures"] for file in folder.glob("*.json")}
    assert pictures.keys() <= studies.STUDIES.keys()
    wanted = sorted(name for names in pictures.values() for name in names)
    assert sorted(file.name for file in folder.glob("*.svg")) == wanted, "run docs/figures.py"
