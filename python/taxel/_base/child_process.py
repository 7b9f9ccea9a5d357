"""Starts every child process of taxel without code of the current folder, and ends it when its parent has ended.

The parent holds one end of a pipe, which the system closes however the parent ends. The child is this file, run by its
path: before it runs its program, it starts a thread that waits for the end of the pipe. The thread removes the files
that are unfinished and sends SIGTERM to its process group: the process and what it has started. A program that has to
clean up handles SIGTERM, as the command line does. A process that still runs after `GRACE_S` is killed. So a program
needs no code for this. It may be a file that does not import taxel, such as ``h5_child.py``, because this module
imports the standard library alone::

    child = ChildProcess(Path("h5_child.py"), ["/dev/fd/5"], pass_fds=[5], stdin=PIPE, stdout=PIPE)

A child has a separate session: Ctrl-C in the terminal reaches the parent alone, which then ends its children.

On Windows a child has a separate console and belongs to a job (`taxel._base.windows_job`), by which the system kills
it and its descendants as soon as the parent has ended; unfinished files are left.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import runpy
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import Any

if sys.platform == "win32":
    from taxel._base.h5_child import JOB_MEMORY
    from taxel._base.windows_job import Job

#: Exit code of a child that was ended, on Windows: that of what Ctrl-C stopped.
_ENDED = 130
#: How long a child may take to end by itself after its parent has ended, s.
GRACE_S = 3.0
#: How long its parent waits for that, s.
_EXIT_TIMEOUT_S = GRACE_S + 1.0

_running: weakref.WeakSet[ChildProcess] = weakref.WeakSet()


class ChildProcess(subprocess.Popen[Any]):
    """A Python process that ends within `GRACE_S` when this process ends or calls `end`.

    Parameters
    ----------
    program : str or Path
        The name of a module, which is run as by ``python -m``, or the path of a file.
    arguments : iterable of str, path or number
    unfinished : sequence of path
        Files that the child writes and that are removed if its parent ends before it.
    at_once : bool
        Whether the system kills the child when this process ends, also while a library keeps the interpreter from its
        threads: for a child that has nothing to clean up. It may take no more memory than `JOB_MEMORY` on Windows;
        elsewhere it limits itself.
    env : mapping, optional
        Variables beside those of this process.
    pass_fds : sequence of int
    options : of `subprocess.Popen`

    Raises
    ------
    OSError : the program cannot be started
    """

    def __init__(
        self,
        program: str | Path,
        arguments: Iterable[object] = (),
        *,
        unfinished: Iterable[str | os.PathLike[str]] = (),
        at_once: bool = False,
        env: Mapping[str, str] | None = None,
        pass_fds: Sequence[int] = (),
        **options: Any,
    ) -> None:
        variables = {**os.environ, **(env or {})}
        make_safe(variables)
        if sys.platform == "win32":
            self._job = Job(JOB_MEMORY if at_once else 0)
            words = [program] if isinstance(program, Path) else ["-m", program]
            super().__init__(
                [sys.executable, "-P", *map(str, (*words, *arguments))],
                env=variables,
                creationflags=subprocess.CREATE_NO_WINDOW,
                **options,
            )
            try:
                self._job.add(int(self._handle))  # type: ignore[attr-defined]  # not in the stubs
            except OSError:
                # A process that has ended is added to no job.
                if self.poll() is None:
                    self.kill()
                    raise
            return
        read_end, write_end = os.pipe()
        self._write_ends = [write_end]
        order = {
            "watched": read_end,
            "unfinished": [os.path.abspath(path) for path in unfinished],
            "is_file": isinstance(program, Path),
            "at_once": at_once,
        }
        try:
            super().__init__(
                [sys.executable, "-P", __file__, json.dumps(order), str(program), *map(str, arguments)],
                env=variables,
                pass_fds=[*pass_fds, read_end],
                start_new_session=True,
                **options,
            )
        except BaseException:
            self._let_go()
            raise
        finally:
            os.close(read_end)
        _running.add(self)

    def _let_go(self) -> None:
        """Close this end of the pipe, or end the job; several threads may do so at a time."""
        if sys.platform == "win32":
            self._job.end(_ENDED)
            return
        with contextlib.suppress(IndexError):
            os.close(self._write_ends.pop())

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end of the child and return its exit code, as `subprocess.Popen` does."""
        code = super().wait(timeout)
        self._let_go()
        return code

    def end(self) -> int:
        """End the child as if this process had ended, wait for it, and return its exit code."""
        self._let_go()
        try:
            return self.wait(_EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return self.wait()

    def __exit__(self, *raised: Any) -> None:
        self.end()
        super().__exit__(*raised)


@contextlib.contextmanager
def pipe_may_be_closed() -> Iterator[None]:
    """Let a pipe be written whose reader may have ended: Windows has another error for it."""
    try:
        yield
    except OSError as error:
        if error.errno not in ((errno.EPIPE, errno.EINVAL) if sys.platform == "win32" else (errno.EPIPE,)):
            raise


def make_safe(variables: MutableMapping[str, str]) -> None:
    """Change environment variables so that Python adds neither the current folder nor a script's to its path.

    An empty entry of PYTHONPATH, which Python takes for the current folder, is left out.
    """
    variables["PYTHONSAFEPATH"] = "1"
    named = [entry for entry in variables.pop("PYTHONPATH", "").split(os.pathsep) if entry]
    if named:
        variables["PYTHONPATH"] = os.pathsep.join(named)


def search_path() -> list[str]:
    """Return this process' `sys.path` for a child: without "", the current folder of an interactive Python."""
    return [entry for entry in sys.path if entry]


if sys.platform != "win32":
    import fcntl

    def _let_go_of_all() -> None:
        """Close the pipes in a fork of this process, which would keep the children running after their parent."""
        for child in list(_running):
            child._let_go()

    os.register_at_fork(after_in_child=_let_go_of_all)

    def _watch(watched: int, unfinished: Sequence[str]) -> None:
        """Wait for the end of the parent, then end this process and those that it has started."""
        # Nothing is ever written: to read returns when the parent's end is closed.
        os.read(watched, 1)
        _remove(unfinished)
        os.killpg(0, signal.SIGTERM)
        time.sleep(GRACE_S)
        _remove(unfinished)
        os.killpg(0, signal.SIGKILL)

    def _remove(files: Sequence[str]) -> None:
        for file in files:
            with contextlib.suppress(OSError):
                os.unlink(file)

    def _main() -> None:
        """Run a program in the child."""
        order = json.loads(sys.argv[1])
        os.set_inheritable(order["watched"], False)
        if order["at_once"]:
            # SIGIO, which ends a process by default, is sent when the other end of the pipe is closed.
            fcntl.fcntl(order["watched"], fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(order["watched"], fcntl.F_SETFL, os.O_ASYNC)
        threading.Thread(
            target=_watch, args=(order["watched"], order["unfinished"]), name="taxel-parent", daemon=True
        ).start()
        sys.argv = sys.argv[2:]
        if order["is_file"]:
            runpy.run_path(sys.argv[0], run_name="__main__")
        else:
            runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)

    if __name__ == "__main__":
        _main()
