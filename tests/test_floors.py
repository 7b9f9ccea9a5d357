"""The house stands: what `lint-imports` cannot see of the floors that pyproject.toml lists.

It takes imports of a package for imports of all that lies in it, so it is told to overlook those of `taxel` itself; and
it does not know in which function an import stands.
"""

from __future__ import annotations

import ast
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYTHON = ROOT / "python"
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
#: Who may import `taxel` itself: those above all that it re-exports.
TOP = ("taxel.cli", "taxel.demo", "taxel.studies")
#: Where a noun may import plots.
DRAWING = {"plot", "_repr_html_"}


def name_of(file: Path) -> str:
    """Return a module's name."""
    return ".".join(file.relative_to(PYTHON).with_suffix("").parts).removesuffix(".__init__")


MODULES = {name_of(file): ast.parse(file.read_text()) for file in sorted(PYTHON.glob("taxel/**/*.py"))}
PARENTS = {
    child: parent for tree in MODULES.values() for parent in ast.walk(tree) for child in ast.iter_child_nodes(parent)
}


def imports(module: str) -> list[tuple[str, ast.stmt]]:
    """List the modules of taxel that one imports, wherever it does so: a package, where it takes a name of its own."""
    found: list[tuple[str, ast.stmt]] = []
    for node in ast.walk(MODULES[module]):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "taxel":
            assert not node.level, f"{module}, line {node.lineno}: imports by full names"
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                found.append((inside if inside in MODULES or inside == "taxel._core" else node.module, node))
        elif isinstance(node, ast.Import):
            found += [(alias.name, node) for alias in node.names if alias.name.split(".")[0] == "taxel"]
    return [(name, node) for name, node in found if not name.startswith("taxel._core")]


def functions(node: ast.AST) -> set[str]:
    """Return the names of the functions that a statement stands in."""
    found = set()
    while node in PARENTS:
        node = PARENTS[node]
        if isinstance(node, ast.FunctionDef):
            found.add(node.name)
    return found


def excepted() -> set[tuple[str, str]]:
    """Return the imports that the linter is told to overlook."""
    lists = [{tuple(said.split(" -> ")) for said in contract["ignore_imports"]} for contract in CONTRACTS]
    assert lists[0] == lists[1], "both contracts have the same exceptions"
    return {(importer, imported) for importer, imported in lists[0] if importer != "taxel.**"}


def test_the_exceptions_are_nouns_that_draw_themselves() -> None:
    for importer, imported in excepted():
        assert imported == "taxel.plot"
        assert importer.count(".") == 1 or importer.startswith("taxel.recording.")


@pytest.mark.parametrize("module", MODULES)
def test_a_noun_imports_plots_only_where_it_is_asked_for_one(module: str) -> None:
    for name, node in imports(module):
        if (module, name) in excepted():
            assert functions(node) & DRAWING, f"{module}, line {node.lineno}: outside of plot() and _repr_html_()"


@pytest.mark.parametrize("module", MODULES)
def test_only_what_stands_on_top_imports_the_package_itself(module: str) -> None:
    for name, node in imports(module):
        assert name != "taxel" or module.startswith(TOP), f"{module}, line {node.lineno}: imports taxel itself"


def test_no_module_comes_back_to_itself_by_way_of_a_package() -> None:
    """A package that takes from its modules must not be taken from by them, not for types either."""
    above = {
        module: {name for name, _ in imports(module) if name != module and (module, name) not in excepted()}
        for module in MODULES
    }
    while above:
        done = [module for module, names in above.items() if not names & above.keys()]
        assert done, f"a circle of imports within {', '.join(sorted(above))}"
        for module in done:
            del above[module]


#: Who reckons with thousands that are no us and ms, and why.
THOUSANDS = {
    "taxel.spikes.units": "the home of us and ms",
    "taxel.spikes.exchange": "NWB counts in seconds",
    "taxel.recording": "ns of the host's clock",
    "taxel.cli.emulate": "seconds; ns of the host's clock",
    "taxel.clock": "ns of the host, us of the board",
    "taxel.detect.exchange": "NIR counts in seconds and volts",
    "taxel.demo": "seconds, kbit/s, seeds",
    "taxel.information.answers": "bits a thousand events",
    "taxel.information.codes": "Hz",
    "taxel.information.wire_rate": "kbit/s",
    "taxel.report.listening": "seconds",
    "taxel.simulate.fem": "N/m, kPa",
    "taxel.live._to_foxglove": "ns",
    "taxel.studies": "seconds, Hz, seeds, frames of whole ms",
}


def thousands(module: str) -> list[int]:
    """Return the lines of a module that multiply or divide by a thousand."""
    found = []
    for node in ast.walk(MODULES[module]):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div | ast.FloorDiv):
            values = [side.value for side in (node.left, node.right) if isinstance(side, ast.Constant)]
            found += [node.lineno for value in values if value in (1000, 1e-3)]
    return found


@pytest.mark.parametrize("module", MODULES)
def test_us_and_ms_are_turned_into_each_other_in_one_place(module: str) -> None:
    """`taxel.spikes.to_ms` and `to_us`: whoever reckons with other thousands says so above."""
    known = any(f"{module}.".startswith(f"{name}.") for name in THOUSANDS)
    assert known or not thousands(module), f"{module}, lines {thousands(module)}: take to_ms or to_us of taxel.spikes"


def test_who_is_listed_for_thousands_has_some() -> None:
    for name in THOUSANDS:
        assert any(thousands(module) for module in MODULES if f"{module}.".startswith(f"{name}."))
