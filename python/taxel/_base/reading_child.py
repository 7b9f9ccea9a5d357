"""Starts a child process that reads a file: with a damaged file a library can hang, crash and ignore signals."""

from __future__ import annotations

import contextlib
import json
import os
import selectors
import subprocess
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._base.child_process import ChildProcess, search_path
from taxel._base.files import open_file
from taxel._core import FormatError

#: The longest time for the start of a child, which loads libraries, s.
BEGIN_S = 120.0


class ReadingChild:
    """Open a file as a context manager; a child process reads it and ends with the context.

    The parent writes a line of JSON for each request, the first with its `sys.path`. The child writes lines of JSON,
    the first that it runs; bytes may follow a line that states how many.

    Parameters
    ----------
    program : Path
        What the child runs; its argument is the descriptor of the open file.
    path : path
    kind : str
        What a file must be, for errors: "a whole HDF5 file".
    patience_s : float, s
        The longest time between two lines of the child.

    Raises
    ------
    FormatError : the library hangs or crashes at the file
    OSError : the file is not there, or cannot be read
    """

    def __init__(self, program: Path, path: str | os.PathLike[str], kind: str, patience_s: float) -> None:
        self.path, self._kind, self._patience_s = Path(path), kind, patience_s
        # Opening the file here raises Python's own errors.
        with open_file(self.path) as file:
            self._child = ChildProcess(
                program,
                [file.fileno()],
                at_once=True,
                pass_fds=[file.fileno()],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        self._answers, self._rest = selectors.DefaultSelector(), bytearray()
        assert self._child.stdin is not None and self._child.stdout is not None  # noqa: PT018  pipes
        self._stdin, self._stdout = self._child.stdin, self._child.stdout
        self._answers.register(self._stdout, selectors.EVENT_READ)
        try:
            self._order(search_path())
            self._answer(BEGIN_S)
        except BaseException:
            self.close()
            raise

    def _order(self, order: Any) -> None:
        try:
            self._stdin.write(json.dumps(order).encode() + b"\n")
            self._stdin.flush()
        except BrokenPipeError:
            # The last answer of the child has the reason.
            return

    def _answer(self, patience_s: float | None = None) -> dict[str, Any]:
        """Return the next line that the child writes."""
        while (end := self._rest.find(b"\n")) < 0:
            self._rest += self._more(1 << 16, patience_s or self._patience_s)
        line = bytes(self._rest[:end])
        del self._rest[: end + 1]
        answer: dict[str, Any] = json.loads(line)
        if "refused" in answer:
            location = f"{self.path}, {shown(answer['entry'])}" if answer["entry"] else str(self.path)
            raise FormatError(f"{location}: {answer['refused']}")
        if "error" in answer:
            raise FormatError(f"{self.path}: not {self._kind} ({answer['error']})")
        return answer

    def _bytes(self, size: int) -> NDArray[np.uint8]:
        """Return the bytes that follow a line."""
        data = np.empty(size, np.uint8)
        ready = min(size, len(self._rest))
        data[:ready] = np.frombuffer(self._rest, np.uint8, ready)
        del self._rest[:ready]
        while ready < size:
            more = self._more(size - ready, self._patience_s)
            data[ready : ready + len(more)] = np.frombuffer(more, np.uint8)
            ready += len(more)
        return data

    def _more(self, most: int, patience_s: float) -> bytes:
        """Return what the child has written since, as soon as there is something."""
        if not self._answers.select(patience_s):
            raise FormatError(f"{self.path}: not {self._kind} (the library has read nothing for {patience_s:g} s)")
        more = os.read(self._stdout.fileno(), most)
        if not more:
            raise FormatError(
                f"{self.path}: not {self._kind} (reading it ended the library, status {self._child.wait()})"
            )
        return more

    def close(self) -> None:
        """End the child."""
        self._child.kill()
        for pipe in (self._stdin, self._stdout):
            with contextlib.suppress(BrokenPipeError):
                pipe.close()
        self._child.wait()
        self._answers.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
