"""Reads a .h5 by a child process: with a damaged file the HDF5 library can hang and ignore signals."""

from __future__ import annotations

import json
import math
import mmap
import os
import selectors
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import OwnMemory
from taxel._base.limits import DESCRIPTION, unpacked
from taxel._core import FormatError

__all__ = ["Entry", "H5File"]

_CHILD = Path(__file__).with_name("h5_child.py")
#: The longest time between two lines of the child, s; and the longest time for its start, which loads libraries.
PATIENCE_S, BEGIN_S = 10.0, 120.0


@dataclass(frozen=True)
class Entry:
    """Describe a data set or a group.

    Parameters
    ----------
    dtype : str
        NumPy's name of the dtype; "text", or "" for a group.
    shape : tuple of int
    """

    dtype: str
    shape: tuple[int, ...]

    @property
    def is_numbers(self) -> bool:
        """Whether it holds numbers."""
        return self.dtype[:1] in tuple("<>|=")


class H5File:
    """Open a .h5 as a context manager; a child process reads it and ends with the context.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    attributes : dict from str to int or None
        Attributes of the root; None for one that is not a whole number.
    entries : dict from str to Entry
        Data sets and groups by their path, those within groups as "run1/pressure".

    Raises
    ------
    FormatError : not a whole HDF5 file, or one at which the library hangs or crashes
    OSError : the file is not there, or cannot be read
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        # Opening the file here raises Python's own errors.
        with self.path.open("rb"):
            pass
        self._memory = os.memfd_create("h5") if hasattr(os, "memfd_create") else _unnamed()
        self._filled = 0
        try:
            self._child = subprocess.Popen(
                [sys.executable, "-P", str(_CHILD), str(self.path), str(self._memory)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                pass_fds=[self._memory],
                # Ctrl-C reaches this process only, which then ends the child.
                start_new_session=True,
            )
        except BaseException:
            os.close(self._memory)
            raise
        self._answers, self._rest = selectors.DefaultSelector(), b""
        assert self._child.stdout is not None  # a pipe
        self._answers.register(self._child.stdout, selectors.EVENT_READ)
        try:
            self._order(sys.path)
            self._answer(BEGIN_S)
            while "entries" not in (answer := self._answer(PATIENCE_S)):
                pass
            self.attributes: dict[str, int | None] = answer["attributes"]
            self.entries = {name: Entry(dtype, tuple(shape)) for name, (dtype, shape) in answer["entries"].items()}
        except BaseException:
            self.close()
            raise

    def text(self, name: str) -> str:
        """Return a data set that is one text.

        Raises
        ------
        FormatError : the data set is not a text, or is damaged
        """
        if self.entries[name] != Entry("text", ()):
            raise FormatError(f"{self._place(name)}: must be a text")
        self._order({"name": name, "text": True})
        text = str(self._done())
        unpacked(self._place(name), len(text), DESCRIPTION)
        return text

    def numbers(self, name: str) -> NDArray[Any]:
        """Return a data set of numbers.

        Raises
        ------
        FormatError : no numbers, more bytes than a file may hold, or damage
        MemoryError : within the limits, but not within the memory that there is
        """
        entry = self.entries[name]
        if not entry.is_numbers:
            what = f"holds {entry.dtype}; must hold numbers" if entry.dtype else "a group; must be a column"
            raise FormatError(f"{self._place(name)}: {what}")
        dtype = np.dtype(entry.dtype)
        size = math.prod(entry.shape) * dtype.itemsize
        unpacked(self._place(name), size)
        at = self._filled
        try:
            os.ftruncate(self._memory, at + max(1, size))
            shared = OwnMemory(self._memory, max(1, size), offset=at)
        except OSError as error:
            raise MemoryError(str(error)) from None
        # The next data set begins at the next place that can be mapped, so this one is the array's, without a copy.
        self._filled += -(-size // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        self._order({"name": name, "text": False, "at": at, "size": size})
        self._done()
        return np.frombuffer(shared, dtype, math.prod(entry.shape)).reshape(entry.shape)

    def _place(self, name: str) -> str:
        return f"{self.path}, data set {name}"

    def _order(self, what: Any) -> None:
        assert self._child.stdin is not None  # a pipe
        try:
            self._child.stdin.write(json.dumps(what).encode() + b"\n")
            self._child.stdin.flush()
        except BrokenPipeError:
            # The last answer of the child has the reason.
            return

    def _done(self) -> Any:
        """Wait for the end of a request and return its answer."""
        while "done" not in (answer := self._answer(PATIENCE_S)):
            pass
        return answer["done"]

    def _answer(self, patience_s: float) -> dict[str, Any]:
        """Return the next line that the child writes."""
        assert self._child.stdout is not None  # a pipe
        while b"\n" not in self._rest:
            if not self._answers.select(patience_s):
                raise FormatError(
                    f"{self.path}: not a whole HDF5 file (the library has read nothing for {patience_s:g} s)"
                )
            more = os.read(self._child.stdout.fileno(), 1 << 16)
            if not more:
                raise FormatError(
                    f"{self.path}: not a whole HDF5 file (reading it ended the library, status {self._child.wait()})"
                )
            self._rest += more
        line, _, self._rest = self._rest.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        if answer.get("kind") == "MemoryError":
            raise MemoryError(answer["error"])
        if "error" in answer:
            raise FormatError(f"{self.path}: not a whole HDF5 file ({answer['error']})")
        return answer

    def close(self) -> None:
        """End the child."""
        self._child.kill()
        for pipe in (self._child.stdin, self._child.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except BrokenPipeError:
                    continue
        self._child.wait()
        self._answers.close()
        os.close(self._memory)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _unnamed() -> int:
    """Return the descriptor of an unnamed temporary file, for systems without anonymous memory files."""
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())
