"""Only what stands on top imports the package itself: `lint-imports`, which holds the layers, overlooks such imports.

It takes imports of a package for imports of all that lies in it, so it is told to overlook those of `taxel` itself.
"""

import ast
from pathlib import Path

import pytest

PYTHON = Path(__file__).resolve().parents[1] / "python"
#: What may import `taxel` itself: what stands above all modules that it re-exports.
TOP = ("cli", "demo")
MODULES = {"_core", *(file.stem for file in PYTHON.glob("taxel/*"))}


def package_imports(text: str) -> list[int]:
    """Return the lines that import `taxel` itself, and no module of it."""
    found = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and node.module == "taxel" and not node.level:
            found += [node.lineno] * any(alias.name not in MODULES for alias in node.names)
        elif isinstance(node, ast.Import):
            found += [node.lineno] * any(alias.name == "taxel" for alias in node.names)
    return found


@pytest.mark.parametrize("file", sorted(PYTHON.glob("taxel/[!_]*")), ids=lambda file: file.name)
def test_only_what_stands_on_top_imports_the_package_itself(file: Path) -> None:
    for module in file.rglob("*.py") if file.is_dir() else [file] * (file.suffix == ".py"):
        assert file.stem in TOP or not package_imports(module.read_text()), module


def test_an_import_of_the_package_is_seen() -> None:
    assert package_imports("import taxel\nfrom taxel import _core, formats\nfrom taxel import Events\n") == [1, 3]
