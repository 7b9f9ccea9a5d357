"""The layers of imports that pyproject.toml lists, as far as `lint-imports` cannot check them.

It takes imports of a package for imports of all that lies in it, so it is told to overlook those of `taxel` itself.
"""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYTHON = ROOT / "python"
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
#: Modules that may import `taxel` itself: those above all modules that it re-exports.
TOP = ("taxel.cli", "taxel.demo")


def name_of(file: Path) -> str:
    """Return a module's name."""
    return ".".join(file.relative_to(PYTHON).with_suffix("").parts).removesuffix(".__init__")


MODULES = {name_of(file): ast.parse(file.read_text()) for file in sorted(PYTHON.glob("taxel/**/*.py"))}


def named(call: ast.Call) -> set[str]:
    """Return the modules that `import_module` may import by its text; a part that is computed stands for any word."""
    if not ast.unparse(call.func).endswith("import_module") or not call.args:
        return set()
    text = call.args[0]
    parts = text.values if isinstance(text, ast.JoinedStr) else [text]
    if not any(isinstance(part, ast.Constant) for part in parts):
        return set()
    pattern = "".join(re.escape(str(part.value)) if isinstance(part, ast.Constant) else r"\w+" for part in parts)
    return {name for name in MODULES if re.fullmatch(pattern, name)}


def imports(module: str) -> list[tuple[str, ast.expr | ast.stmt]]:
    """List the modules of taxel that one imports, wherever it does so: a package, where it takes a name of its own."""
    found: list[tuple[str, ast.expr | ast.stmt]] = []
    for node in ast.walk(MODULES[module]):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "taxel":
            assert not node.level, f"{module}, line {node.lineno}: imports by full names"
            for alias in node.names:
                inside = f"{node.module}.{alias.name}"
                found.append((inside if inside in MODULES or inside == "taxel._core" else node.module, node))
        elif isinstance(node, ast.Import):
            found += [(alias.name, node) for alias in node.names if alias.name.split(".")[0] == "taxel"]
        elif isinstance(node, ast.Call) and module != "taxel":  # which installs `plot()`, and loads what is asked for
            found += [(name, node) for name in named(node)]
    return [(name, node) for name, node in found if not name.startswith("taxel._core")]


@pytest.mark.parametrize("contract", CONTRACTS, ids=lambda contract: contract["name"])
def test_the_linter_overlooks_nothing_but_the_package_itself(contract: dict[str, Any]) -> None:
    assert contract["ignore_imports"] == ["taxel.** -> taxel"]


@pytest.mark.parametrize("module", MODULES)
def test_only_what_stands_on_top_imports_the_package_itself(module: str) -> None:
    for name, node in imports(module):
        assert name != "taxel" or module.startswith(TOP), f"{module}, line {node.lineno}: imports taxel itself"


def test_no_module_imports_itself_by_way_of_a_package() -> None:
    """The modules that a package imports from must not import from that package, not for types either."""
    above = {module: {name for name, _ in imports(module) if name != module} for module in MODULES}
    while above:
        done = [module for module, names in above.items() if not names & above.keys()]
        assert done, f"a circle of imports within {', '.join(sorted(above))}"
        for module in done:
            del above[module]


#: Modules that multiply or divide by 1000 for another reason than us and ms, and the reason.
THOUSANDS = {
    "taxel.spikes.units": "the home of us and ms",
    "taxel.spikes.exchange": "NWB counts in seconds",
    "taxel.formats.ros": "ns of stamps and bags",
    "taxel.recording": "ns of the host's clock",
    "taxel.cli.emulate": "seconds; ns of the host's clock",
    "taxel.cli.information": "seconds",
    "taxel.clock": "ns of the host, us of the board",
    "taxel.detect.exchange": "NIR counts in seconds and volts",
    "taxel.demo": "seconds, kbit/s, seeds",
    "taxel.information.answers": "bits a thousand events",
    "taxel.information.wire_rate": "kbit/s",
    "taxel.report.detections": "seconds",
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
def test_us_and_ms_are_converted_in_one_place(module: str) -> None:
    """By `taxel.spikes.to_ms` and `to_us`; modules with other factors of 1000 are listed above."""
    known = any(f"{module}.".startswith(f"{name}.") for name in THOUSANDS)
    assert known or not thousands(module), f"{module}, lines {thousands(module)}: take to_ms or to_us of taxel.spikes"


def test_a_module_that_is_listed_has_a_factor_of_1000() -> None:
    for name in THOUSANDS:
        assert any(thousands(module) for module in MODULES if f"{module}.".startswith(f"{name}."))
