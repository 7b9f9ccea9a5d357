"""Starts child processes of taxel, which run no code of the current folder and end when their parent has ended.

The parent holds one end of the child's standard input, which the system closes however the parent ends. The child is
this file, run by its path: it gives the first line of its input to its program and waits for the end of the input in a
thread, which then interrupts the program as Ctrl-C does, and ends the process if it still runs after `GRACE_S`.

A child has a session (on Windows a console) of its own: Ctrl-C in the terminal reaches the parent alone, which then
ends its children.
"""

from __future__ import annotations

import _thread
import contextlib
import io
import os
import runpy
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from typing import Any, TextIO

#: Exit code of a child that was ended: that of what Ctrl-C stopped.
_ENDED = 130
#: How long a child may take to end by itself after its parent has ended, s.
GRACE_S = 3.0
#: How long its parent waits for that, s.
_EXIT_TIMEOUT_S = GRACE_S + 1.0


if sys.platform == "win32":
    _FLAGS = subprocess.CREATE_NO_WINDOW
else:
    _FLAGS = 0


class ChildProcess(subprocess.Popen[str]):
    """A Python process that ends within `GRACE_S` when this process ends or calls `end`.

    Parameters
    ----------
    module : str
        What is run as by ``python -P -m``.
    arguments : iterable of str, path or number
    line : str
        A line that the module reads as its standard input.
    options : of `subprocess.Popen`

    Raises
    ------
    OSError : the program cannot be started
    """

    def __init__(self, module: str, arguments: Iterable[object] = (), *, line: str = "", **options: Any) -> None:
        super().__init__(
            [sys.executable, "-P", __file__, module, *map(str, arguments)],
            stdin=subprocess.PIPE,
            text=True,
            start_new_session=True,
            creationflags=_FLAGS,
            **options,
        )
        assert self.stdin is not None  # a pipe
        # A child that has ended reads nothing.
        with contextlib.suppress(OSError):
            self.stdin.write(line + "\n")
            self.stdin.flush()

    def end(self) -> int:
        """End the child as if this process had ended, wait for it, and return its exit code."""
        assert self.stdin is not None  # a pipe
        with contextlib.suppress(OSError):
            self.stdin.close()
        try:
            return self.wait(_EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return self.wait()

    def __exit__(self, *raised: Any) -> None:
        self.end()
        super().__exit__(*raised)


def _end_with(parent: TextIO) -> None:
    """Wait for the end of the parent, then end this process."""
    parent.read()
    _thread.interrupt_main()
    time.sleep(GRACE_S)
    os._exit(_ENDED)


def _main() -> None:
    """Run a module in the child."""
    parent, sys.argv = sys.stdin, sys.argv[1:]
    sys.stdin = io.StringIO(parent.readline())
    threading.Thread(target=_end_with, args=(parent,), name="taxel-parent", daemon=True).start()
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _main()
