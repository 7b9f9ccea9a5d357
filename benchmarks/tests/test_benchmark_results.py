"""Results of benchmarks and studies name a clean commit that exists; each benchmark has one."""

import json
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from taxel_benchmarks._command import benchmarks

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "benchmarks" / "results"


def stated(value: Any) -> Iterator[str]:
    """Find every commit that a result states, at whatever depth."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key == "commit":
                yield str(inner)
            yield from stated(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from stated(inner)


def git(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


NAMED = sorted(
    (str(path.relative_to(RESULTS)), commit)
    for path in RESULTS.rglob("*.json")
    for commit in stated(json.loads(path.read_text()))
)


def test_there_are_results_that_name_commits() -> None:
    named = {file.removesuffix(".json") for file, _ in NAMED}
    assert benchmarks().keys() - named == set(), "no result with a commit: run taxel bench NAME"


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("*.json")), ids=lambda path: str(path.relative_to(RESULTS)))
def test_a_kept_result_names_its_commit_date_and_machine(path: Path) -> None:
    result = json.loads(path.read_text())
    assert result["commit"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", result["date"])
    # The first toy results did not save the machine.
    assert result.get("machine") or path.parent.name == "toy"


@pytest.mark.parametrize(("file", "commit"), NAMED)
def test_a_result_names_a_clean_commit_of_this_history(file: str, commit: str) -> None:
    assert re.fullmatch(r"[0-9a-f]{7,40}", commit), f"{file}: {commit}"
    shallow = git("rev-parse", "--is-shallow-repository")
    if shallow.stdout.strip() != "false":
        pytest.skip("the history is not whole here")
    assert git("merge-base", "--is-ancestor", commit, "HEAD").returncode == 0, f"{file}: {commit} is not in the history"
