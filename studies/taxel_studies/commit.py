"""Which code this is: a result names it, and a stored one is used again only by the same."""

from __future__ import annotations

import os
import subprocess
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

#: The results that measurements leave in a checkout of taxel: they change no code.
_RESULTS = "benchmarks/results"
#: Variables that name another repository; git sets some of them while a hook runs.
_ELSEWHERE = {"GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_COMMON_DIR", "GIT_OBJECT_DIRECTORY"}


class Checkout(NamedTuple):
    """The state of a checkout.

    Attributes
    ----------
    commit : str
        The last one, short; "unknown" where git does not say it.
    changed : tuple of str
        Tracked files that differ from it, without results of benchmarks and studies; where git does not say them, why.
    """

    commit: str
    changed: tuple[str, ...]


def checkout_of(path: Path) -> Checkout | None:
    """Return the checkout that tracks a file, or files of a folder; None where none does.

    An installed package may lie within a checkout of something else, which does not track it.
    """
    path = path.resolve()
    if not any((folder / ".git").exists() for folder in (path, *path.parents)):
        return None
    try:
        tracked = _git(path, "ls-files", "--error-unmatch", "--", str(path))
        if tracked.returncode == 1:
            return None
        commit = _git(path, "rev-parse", "--short", "HEAD")
        status = _git(path, "status", "--porcelain", "--untracked-files=no", "--", ":/", f":(top,exclude){_RESULTS}")
    except OSError as error:  # no git
        return Checkout("unknown", (str(error),))
    failed = [ran.stderr.strip() for ran in (tracked, commit, status) if ran.returncode]
    return Checkout(
        "unknown" if commit.returncode else commit.stdout.strip(),
        (*failed, *(line[3:] for line in status.stdout.splitlines())),
    )


def _git(path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Ask git about the repository around a path."""
    folder = path if path.is_dir() else path.parent
    # A repository can name a program that git runs to watch files, and another that it runs when it writes its index.
    git = ["git", "-c", "core.fsmonitor=false", "--no-optional-locks", "-C", str(folder)]
    environment = {name: value for name, value in os.environ.items() if name not in _ELSEWHERE}
    return subprocess.run([*git, *arguments], capture_output=True, text=True, check=False, env=environment)


def code_version(*packages: str) -> str:
    """Return which code runs, as a text; results may be used again where it is the same.

    Parameters
    ----------
    *packages : str
        The packages in question; `taxel` if none is given.

    Returns
    -------
    str
        The commit, for a package in a checkout without local changes. With local changes, and where git or the
        installation does not say, the text has a random part: no other call returns it, so nothing is used again. For
        an installed package its name and version. Texts of packages that differ are joined by " + ".

    Examples
    --------
    >>> from taxel_studies.commit import code_version
    >>> code_version() == code_version("taxel") or "local changes" in code_version()
    True
    """
    return " + ".join(dict.fromkeys(_version_of(package) for package in packages or ("taxel",)))


def _version_of(package: str) -> str:
    spec = find_spec(package)
    checkout = None if spec is None or spec.origin is None else checkout_of(Path(spec.origin))
    if checkout is not None:
        return f"{checkout.commit} with local changes, {uuid4().hex}" if checkout.changed else checkout.commit
    try:
        return f"{package} {metadata.version(package)}"
    except metadata.PackageNotFoundError:
        return f"{package} of unknown version, {uuid4().hex}"
