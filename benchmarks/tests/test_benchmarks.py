"""Benchmarks load where no peer is installed, and leave it out."""

import ast
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BENCHMARKS = sorted((ROOT / "benchmarks" / "taxel_benchmarks").glob("[!_]*.py"))


def peers() -> list[str]:
    """Return the modules of the extras that only tests and benchmarks want."""
    files = [ROOT / "pyproject.toml", ROOT / "benchmarks" / "pyproject.toml"]
    extras = [tomllib.loads(file.read_text())["project"]["optional-dependencies"] for file in files]
    wanted = [*extras[0]["test"], *extras[1]["bench"], *extras[1]["peers"]]
    names = {re.split(r"[<>=!~]", one)[0] for one in wanted}
    return sorted(names - {"numpy", "pytest", "pytest-timeout", "hypothesis"} | {"neo", "quantities", "sklearn"})


#: No finder finds these; to set them to None in sys.modules would be no absence for those who look there.
WITHOUT = f"""
from importlib.machinery import PathFinder
found = PathFinder.find_spec
PathFinder.find_spec = lambda name, *rest: None if name.split(".")[0] in {peers()!r} else found(name, *rest)
"""


def without_peers(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the command line where no peer can be imported."""
    with tempfile.TemporaryDirectory() as folder:
        # A benchmark runs in a process of its own, which imports this too.
        (Path(folder) / "sitecustomize.py").write_text(WITHOUT)
        paths = [folder, *filter(None, [os.environ.get("PYTHONPATH")])]
        return subprocess.run(
            [sys.executable, "-m", "taxel", *arguments],
            capture_output=True,
            text=True,
            check=False,
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)},
        )


def test_benchmarks_load_where_no_peer_is_installed() -> None:
    script = "\n".join([WITHOUT, *(f"import taxel_benchmarks.{path.stem}" for path in BENCHMARKS)])
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_a_benchmark_states_its_peer_unit_and_goal(path: Path) -> None:
    stated = ast.get_docstring(ast.parse(path.read_text())) or ""
    assert re.search(r"^Peer: .+\. Unit: .+\. Goal: .+\.$", stated, re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("path", BENCHMARKS, ids=lambda path: path.stem)
def test_a_benchmark_runs_without_peers_and_names_those_that_it_leaves_out(path: Path) -> None:
    done = without_peers("bench", "encode_peak" if path.stem == "encode" else path.stem, "--quick")
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert re.match(rf"{path.stem}\w*: ratios", done.stdout)
    wanted = re.search(r"^PEERS\b[^{]*\{(.*?)\}", path.read_text(), re.MULTILINE | re.DOTALL)
    named = re.findall(r'"([^"]+)":', wanted[1]) if wanted else []
    assert [name for name in named if f"left out: {name}" not in done.stdout] == []
