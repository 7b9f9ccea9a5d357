"""The distributions beside taxel stand on its public names alone, and nothing of taxel on them."""

from __future__ import annotations

import ast
import pkgutil
import re
import tomllib
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType

import pytest

import taxel
import taxel_studies

ROOT = Path(taxel_studies.__file__).parents[2]
#: The folders of distributions beside taxel, which hold a package of this name each.
BESIDE = ("studies", "benchmarks", "viewers", "bridge", "rules")
FILES = sorted(file for folder in BESIDE for file in (ROOT / folder / f"taxel_{folder}").rglob("*.py"))


#: Private modules that the rules, which are of one version with taxel, need too: those that make learners of one kind.
OF_LEARNERS = {
    "taxel._base.arguments",
    "taxel._base.errors",
    "taxel._base.parameters",
    "taxel.learn._examples",
    "taxel.learn._learner",
}


def is_module(name: str) -> bool:
    first, _, inner = name.rpartition(".")
    package = import_module(first) if inner and first.split(".")[0] == "taxel" else None
    return package is not None and name.rpartition(".")[2] in {
        module.name for module in pkgutil.iter_modules(getattr(package, "__path__", []))
    }


def wrong(source: str, taken: str) -> str | None:
    """Return why a name must not be imported from a module of taxel; None where it is public."""
    if any(part.startswith("_") and not part.startswith("__") for part in (*source.split("."), taken)):
        return f"{source}.{taken} is private"
    module: ModuleType = import_module(source)
    public = set(getattr(module, "__all__", [])) | {"__version__"}
    return None if taken in public or is_module(f"{source}.{taken}") else f"{source} does not name {taken} in __all__"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_a_distribution_takes_public_names_of_taxel_alone(file: Path) -> None:
    found = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "taxel":
            if file.parent.name == "taxel_rules" and node.module in OF_LEARNERS:
                continue
            found += [wrong(node.module, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            found += [
                f"{alias.name} is private"
                for alias in node.names
                if alias.name.startswith("taxel.") and "._" in alias.name
            ]
        elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
            own = ast.unparse(node.value) in ("self", "cls", "other", "super()")
            # A named tuple's own methods have such names, and how a process ends at once.
            named = node.attr in ("_replace", "_asdict", "_fields", "_make") or ast.unparse(node) == "os._exit"
            named |= file.parent.name == "taxel_rules" and node.attr == "_parts"
            found += [] if own or named else [f"line {node.lineno}: {ast.unparse(node)}"]
    assert [why for why in found if why] == []


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
