"""Which code runs: a commit where it is that of the files, else a version, else a text that no other call returns."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from taxel_studies.commit import code_version

#: A package that no test imports.
NAME = "taxel_toy_code"


class Repository:
    """A small repository, with a package in a folder of it."""

    def __init__(self, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.root, self.file = root, root / "python" / NAME / "__init__.py"
        self.write("python", NAME, "__init__.py")
        self.git("init", "-q")
        self.commit()
        monkeypatch.syspath_prepend(str(root / "python"))

    def write(self, *parts: str, text: str = "first\n") -> None:
        path = self.root.joinpath(*parts)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"# {text}")

    def git(self, *arguments: str) -> str:
        command = ["git", "-C", str(self.root), "-c", "user.name=n", "-c", "user.email=e@localhost", *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    def commit(self) -> str:
        self.git("add", "-A")
        self.git("commit", "-q", "--allow-empty", "-m", "one")
        return self.git("rev-parse", "--short", "HEAD")

    def version(self) -> str:
        return code_version(NAME)


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Repository]:
    return Repository(tmp_path, monkeypatch)


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the package into a folder, as version 1.2."""
    (folder / NAME).mkdir(parents=True)
    (folder / NAME / "__init__.py").write_text("")
    (folder / f"{NAME}-1.2.dist-info").mkdir()
    (folder / f"{NAME}-1.2.dist-info" / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {NAME}\nVersion: 1.2\n")
    monkeypatch.syspath_prepend(str(folder))


def never_again(repository: Repository) -> bool:
    """Whether each call returns another text."""
    return len({repository.version() for _ in range(3)}) == 3


def test_a_clean_checkout_is_its_commit(repository: Repository) -> None:
    first = repository.git("rev-parse", "--short", "HEAD")
    assert [repository.version(), repository.version()] == [first, first]
    repository.write("python", NAME, "__init__.py", text="second\n")
    second = repository.commit()
    assert repository.version() == second != first
    repository.git("checkout", "-q", first)
    assert repository.version() == first


@pytest.mark.parametrize("staged", [False, True])
@pytest.mark.parametrize("change", ["edit", "remove", "add"])
def test_with_local_changes_no_two_calls_are_the_same(repository: Repository, change: str, staged: bool) -> None:
    repository.write("crates", "more.rs")
    first = repository.commit()
    if change == "remove":
        (repository.root / "crates" / "more.rs").unlink()
    else:
        repository.write("crates", "more.rs" if change == "edit" else "other.rs", text="second\n")
    if staged:
        repository.git("add", "-A")
    elif change == "add":
        repository.git("add", "--intent-to-add", "crates")
    assert never_again(repository)
    assert repository.version().startswith(f"{first} with local changes, ")


def test_results_and_files_that_git_does_not_track_are_no_changes(repository: Repository) -> None:
    repository.write("benchmarks", "results", "figures", "one.json")
    first = repository.commit()
    repository.write("benchmarks", "results", "figures", "one.json", text="second\n")
    repository.write("notes.txt")
    assert repository.version() == first
    repository.write("python", NAME, "benchmarks", "results", "one.py")
    repository.git("add", "-A")
    assert never_again(repository)


def test_an_installed_package_is_its_version_also_within_a_strangers_repository(
    repository: Repository, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(repository.root / ".venv" / "site-packages", monkeypatch)
    assert repository.version() == f"{NAME} 1.2"
    repository.write("python", NAME, "__init__.py", text="second\n")
    assert repository.version() == f"{NAME} 1.2"
    installed(tmp_path_factory.mktemp("alone"), monkeypatch)
    assert repository.version() == f"{NAME} 1.2"
