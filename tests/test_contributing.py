"""The example of CONTRIBUTING works: added to a copy it gives a format."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FORMAT = ROOT / "tests" / "contributing" / "format"
TESTS = ["tests/formats/test_registry.py", "tests/formats/test_channel.py"]


def add(root: Path, path: str, after: str, text: str) -> None:
    """Add a fenced piece of CONTRIBUTING to the file and at the place that its first line names."""
    there = (root / path).read_text().splitlines(keepends=True)
    anchor = after.removeprefix("after ").strip('"')
    at = len(there) if after == "at the end" else 1 + next(k for k, line in enumerate(there) if anchor in line)
    gap = "\n\n" if after == "at the end" else ""
    (root / path).write_text("".join([*there[:at], gap, text, *there[at:]]))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package, its tests of formats and their settings."""
    unneeded = shutil.ignore_patterns("__pycache__", "*.so", ".hypothesis")
    shutil.copytree(ROOT / "python", tmp_path / "python", ignore=unneeded)
    for compiled in (ROOT / "python" / "taxel").glob("*.so"):
        (tmp_path / "python" / "taxel" / compiled.name).symlink_to(compiled)
    for room in ("formats", "recording"):
        shutil.copytree(ROOT / "tests" / room, tmp_path / "tests" / room, ignore=unneeded)
    for shared in (ROOT / "tests").glob("*.py"):
        shutil.copy(shared, tmp_path / "tests")
    for settings in ("pyproject.toml", "conftest.py"):
        shutil.copy(ROOT / settings, tmp_path)
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("_build", "pictures"))
    return tmp_path


def test_what_contributing_says_is_enough(copy: Path) -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text()
    pieces = re.findall(r"^```python\n# (\S+?), (at the end|after [^\n]+?)\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(pieces) == 2
    shutil.copytree(FORMAT, copy, dirs_exist_ok=True)
    for piece in pieces:
        add(copy, *piece)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS, "-k", "test_channel or registry"]
    environment = os.environ | {"PYTHONPATH": str(copy / "python")}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " passed" in done.stdout
