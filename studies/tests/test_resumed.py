"""A study that is run again uses the results of the same commit, and no others."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from taxel_studies import load
from taxel_studies.commit import code_version

#: A package that no test imports.
NAME = "taxel_toy_study"


def test_a_resumed_study_uses_the_results_of_the_same_commit_without_local_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / f"{NAME}.py"

    def git(*arguments: str) -> None:
        command = ["git", "-C", str(tmp_path), "-c", "user.name=n", "-c", "user.email=e@localhost", *arguments]
        subprocess.run(command, check=True, capture_output=True)

    def commit() -> None:
        git("add", str(file))
        git("commit", "-q", "-m", "one")

    def saved() -> int:
        load("fig6.11").run(tmp_path / "report", size="toy", changes={"realisations": 1}, quiet=True)
        return len(list((tmp_path / "report" / "cache").rglob("output.pkl")))

    git("init", "-q")
    file.write_text("first = 1\n")
    commit()
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("taxel_studies.study.code_version", lambda *packages: code_version(NAME))
    each = saved()
    assert saved() == each
    file.write_text("second = 2\n")
    assert [saved(), saved()] == [2 * each, 3 * each]
    commit()
    assert [saved(), saved()] == [4 * each, 4 * each]
    git("checkout", "-q", "HEAD~1")
    assert saved() == 4 * each
