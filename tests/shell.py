"""The command line, in the process of the tests: a process of its own takes a second to load what it needs."""

from __future__ import annotations

import contextlib
import io
import subprocess
from collections.abc import Iterator

import cyclopts
import pytest

from taxel.cli import main
from taxel.cli._commands import OWN, command, plugins
from taxel.cli.app import own_commands


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a command in this process; return what a process would."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    return subprocess.CompletedProcess(arguments, int(ended.value.code or 0), out.getvalue(), err.getvalue())


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run a command in this process; return its exit code, output and errors."""
    with pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    said = capsys.readouterr()
    return int(ended.value.code or 0), said.out, said.err


def commands() -> dict[str, cyclopts.App]:
    """Return every command that does something, ours and those of other distributions, by what is typed for it."""
    return dict(found for name in [*OWN, *plugins()] for found in _each(name, command(name)))


def _each(path: str, app: cyclopts.App | None) -> Iterator[tuple[str, cyclopts.App]]:
    assert app is not None, path
    if app.default_command is not None:
        yield path, app
    for name, one in own_commands(app).items():
        yield from _each(f"{path} {name}", one)
