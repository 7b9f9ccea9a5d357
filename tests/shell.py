"""The command line, in the process of the tests: a process of its own takes a second to load what it needs."""

from __future__ import annotations

import contextlib
import io
import os
import re
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator

import cyclopts
import pytest
from loopback import until

from taxel.cli import main
from taxel.cli._commands import OWN, command, plugins
from taxel.cli.app import own_commands


def run(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a command in this process; return what a process would."""
    return _run(arguments, io.StringIO(), io.StringIO())


def _run(arguments: tuple[object, ...], out: io.StringIO, err: io.StringIO) -> subprocess.CompletedProcess[str]:
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as ended:
        main([str(a) for a in arguments])
    return subprocess.CompletedProcess(arguments, int(ended.value.code or 0), out.getvalue(), err.getvalue())


def run_beside(
    beside: Callable[[str], object],
    *arguments: object,
    says: str = "listening",
    ended: signal.Signals | None = signal.SIGINT,
) -> subprocess.CompletedProcess[str]:
    """Run a command and, once it `says` a pattern, a function of that in a thread; then a signal ends the command.

    Without a signal it ends by itself.
    """
    out, err, over, failed = io.StringIO(), io.StringIO(), threading.Event(), []

    def said() -> str:
        found = re.search(says, out.getvalue() + err.getvalue())
        return found[0] if found else ""

    def play() -> None:
        try:
            until(lambda: over.is_set() or said())
            if not over.is_set():
                beside(said())
        except BaseException as error:  # it is raised where the command has ended
            failed.append(error)
        if ended or failed:
            os.kill(os.getpid(), ended or signal.SIGINT)

    def stop(*_: object) -> None:
        if not over.is_set():
            raise KeyboardInterrupt

    thread, before = threading.Thread(target=play), signal.signal(ended or signal.SIGINT, stop)
    thread.start()
    try:
        done = _run(arguments, out, err)
    finally:
        over.set()
        thread.join()
        signal.signal(ended or signal.SIGINT, before)
    if failed:
        raise failed[0]
    return done


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
