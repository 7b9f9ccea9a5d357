"""Distributions beside taxel are of one version with it, and taxel imports none; lint looks at their names."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

import taxel
import taxel_studies

ROOT = Path(taxel_studies.__file__).parents[2]
#: The folders of distributions beside taxel, which hold a package of this name each.
BESIDE = ("studies", "benchmarks", "viewers", "bridge", "makers", "gait", "rules")


def test_taxel_imports_none() -> None:
    importing = re.compile(rf"^\s*(from|import) taxel_({'|'.join(BESIDE)})\b", re.MULTILINE)
    product = (ROOT / "python").rglob("*.py")
    assert [str(file.relative_to(ROOT)) for file in product if importing.search(file.read_text())] == []


def test_the_version_stands_in_one_place_and_all_distributions_have_it() -> None:
    version = tomllib.loads((ROOT / "Cargo.toml").read_text())["workspace"]["package"]["version"]
    projects = [tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"] for folder in ("", *BESIDE)]
    assert all(project["dynamic"] == ["version"] for project in projects)
    assert {metadata.version(project["name"]) for project in projects} == {taxel.__version__} == {version}
    assert all("taxel" in project["dependencies"] for project in projects[1:])
