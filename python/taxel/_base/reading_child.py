"""Starts a child process that reads a file: with a damaged file a library can hang, crash and ignore signals."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.child_process import ChildProcess, pipe_may_be_closed, search_path
from taxel._base.errors import damaged
from taxel._base.files import open_file
from taxel._core import FormatError

#: The longest time for the start of a child, which loads libraries, s.
BEGIN_S = 120.0
#: Interval at which the time that an answer takes is counted, s.
_STEP_S = 0.1


class ReadingChild:
    """Open a file as a context manager; a child process reads it and ends with the context.

    The parent writes a line of JSON for each request, the first with its `sys.path`. The child writes lines of JSON,
    the first that it runs; bytes may follow a line that states how many.

    Parameters
    ----------
    program : Path
        What the child runs; its argument is a path of the open file.
    path : path
    kind : str
        What a file is, for errors: "HDF5 file".
    patience_s : float, s
        The longest time between two lines of the child.

    Raises
    ------
    FormatError : the library hangs or crashes at the file
    OSError : the file is not there, or cannot be read
    """

    def __init__(self, program: Path, path: str | os.PathLike[str], kind: str, patience_s: float) -> None:
        self.path, self._kind, self._patience_s = Path(path), kind, patience_s
        # Opening the file here raises Python's own errors. The child opens the same file, whatever its name stands for
        # by then: Windows keeps the name while the file is open here.
        self._file = open_file(self.path)
        number = self._file.fileno()
        place, passed = (f"/dev/fd/{number}", [number]) if sys.platform != "win32" else (self.path.absolute(), [])
        #: How much longer the answer may take that is waited for, s; None where none is.
        self._wait: list[float] | None = None
        self._is_late, self._is_over = False, threading.Event()
        try:
            self._child = ChildProcess(
                program,
                [place],
                at_once=True,
                pass_fds=passed,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        except BaseException:
            self._file.close()
            raise
        requests, answers = self._child.stdin, self._child.stdout
        assert isinstance(requests, io.BufferedWriter) and isinstance(answers, io.BufferedReader)  # noqa: PT018  pipes
        self._stdin, self._stdout = requests, answers
        self._watching = threading.Thread(target=self._watch, name="taxel-patience", daemon=True)
        self._watching.start()
        try:
            self._order(search_path())
            self._answer(BEGIN_S)
        except BaseException:
            self.close()
            raise

    def _watch(self) -> None:
        """End the child where an answer takes too long; time in which this process is stopped does not count."""
        while not self._is_over.wait(_STEP_S):
            if (wait := self._wait) is not None:
                wait[0] -= _STEP_S
                if wait[0] <= 0 and self._wait is wait:
                    self._is_late = True
                    self._child.kill()
                    return

    def _order(self, order: Any) -> None:
        # The last answer of a child that has ended has the reason.
        with pipe_may_be_closed():
            self._stdin.write(json.dumps(order).encode() + b"\n")
            self._stdin.flush()

    def _answer(self, patience_s: float | None = None) -> dict[str, Any]:
        """Return the next line that the child writes."""
        patience_s = patience_s or self._patience_s
        self._wait = [patience_s]
        line = self._stdout.readline()
        self._wait = None
        if not line.endswith(b"\n"):
            raise self._end(patience_s)
        answer: dict[str, Any] = json.loads(line)
        if "refused" in answer:
            location = f"{self.path}, {shown(answer['entry'])}" if answer["entry"] else str(self.path)
            raise FormatError(f"{location}: {answer['refused']}")
        if "error" in answer:
            raise damaged(self.path, self._kind, answer["error"])
        return answer

    def _bytes(self, size: int) -> NDArray[np.uint8]:
        """Return the bytes that follow a line."""
        data = np.empty(size, np.uint8)
        self._wait = [self._patience_s]
        read = self._stdout.readinto(data.data)
        self._wait = None
        if read < size:
            raise self._end(self._patience_s)
        return data

    def _end(self, patience_s: float) -> FormatError:
        """Return why the child has ended."""
        why = f"the library crashed while reading it, status {self._child.wait()}"
        if self._is_late:
            why = f"the library has read nothing for {patience_s:g} s"
        return damaged(self.path, self._kind, why)

    def close(self) -> None:
        """End the child."""
        self._is_over.set()
        self._child.kill()
        for stream in (self._stdin, self._stdout, self._file):
            with pipe_may_be_closed():
                stream.close()
        self._child.wait()
        self._watching.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
