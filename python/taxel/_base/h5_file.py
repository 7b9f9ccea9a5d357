"""Reads a .h5 by a child process: with a damaged file the HDF5 library can hang, crash and ignore signals."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from taxel._base.arguments import refuse_changed, shown
from taxel._base.limits import DESCRIPTION, unpacked
from taxel._base.messages import first_line
from taxel._base.reading_child import ReadingChild
from taxel._core import FormatError, ProblemError

_CHILD = Path(__file__).with_name("h5_child.py")
#: The longest time between two lines of the child, s.
PATIENCE_S = 10.0
#: Bytes that a text takes in memory beside its characters.
_TEXT_BYTES = 64


@dataclass(frozen=True, slots=True)
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


class H5File(ReadingChild):
    """Open a .h5 as a context manager; a child process reads it and ends with the context.

    Parameters
    ----------
    path : path

    Attributes
    ----------
    entries : dict from str to Entry
        Data sets and groups by their path, those within groups as "run1/pressure". A group that several paths lead to
        is listed by one of them.
    left_out : dict from str to str
        Soft links that lead nowhere, and why.

    Raises
    ------
    FormatError : a damaged HDF5 file; one at which the library hangs or crashes; one of which a link or a data set
        leads to another file (names it)
    OSError : the file is not there, or cannot be read
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(_CHILD, path, "HDF5 file", PATIENCE_S)
        self._claimed = 0
        self.entries: dict[str, Entry] = {}
        self.left_out: dict[str, str] = {}
        try:
            while "listed" not in (answer := self._answer()):
                if "entry" in answer:
                    self.entries[answer["entry"]] = Entry(answer["dtype"], tuple(answer["shape"]))
                elif "left_out" in answer:
                    why = f"a soft link to {shown(answer['target'])}, which does not exist ({answer['why']})"
                    self.left_out[answer["left_out"]] = why
        except BaseException:
            self.close()
            raise

    def attribute(self, name: str, entry: str = "/") -> int | float | str | None:
        """Return an attribute of an entry or the root: a number, a short text, "" if it is another value, or None.

        Raises
        ------
        FormatError : the attribute is damaged
        """
        self._order({"attribute": name, "entry": entry})
        value: int | float | str | None = self._answer()["done"]
        return value

    def attributes(self, entry: str = "/") -> list[str]:
        """Return the names of the attributes of an entry or the root.

        Raises
        ------
        FormatError : damage
        """
        self._order({"attributes": entry})
        names: list[str] = self._answer()["done"]
        return names

    def text(self, name: str, most: int = DESCRIPTION) -> str:
        """Return a data set that is one text of at most so many bytes.

        Raises
        ------
        FormatError : the data set is not a text, or is damaged
        """
        if self.entries[name] != Entry("text", ()):
            raise FormatError(f"{self._location(name)}: must be a text")
        return str(self.texts(name, most)[()])

    def texts(self, name: str, most: int = DESCRIPTION) -> NDArray[np.object_]:
        """Return a data set of texts, which take at most so many bytes.

        Raises
        ------
        FormatError : not texts, more of them than a file may hold, or damage
        """
        entry = self.entries[name]
        if entry.dtype != "text":
            raise FormatError(f"{self._location(name)}: must contain texts")
        size = _TEXT_BYTES * (math.prod(entry.shape) - 1)
        unpacked(self._location(name), size, most)
        read: list[str] = []
        self._order({"name": name, "text": True})
        while "done" not in (answer := self._answer()):
            size += sum(answer["lengths"])
            unpacked(self._location(name), size, most)
            read += [bytes(self._bytes(length)).decode() for length in answer["lengths"]]
        texts = np.empty(len(read), object)
        texts[:] = read
        return texts.reshape(entry.shape)

    def check_size(self, names: Iterable[str], dtypes: Mapping[str, DTypeLike] | None = None) -> None:
        """Refuse data sets of numbers that have more bytes together than a file may hold, before one is read.

        `dtypes` are those that data sets will be converted to, by name.

        Raises
        ------
        FormatError : more bytes than a file may hold
        """
        there = {name: entry for name in names if (entry := self.entries[name]).is_numbers}
        sizes = (
            math.prod(entry.shape) * np.dtype((dtypes or {}).get(name, entry.dtype)).itemsize
            for name, entry in there.items()
        )
        unpacked(str(self.path), sum(sizes))

    def numbers(self, name: str, dtype: DTypeLike | None = None) -> NDArray[Any]:
        """Return a data set of numbers.

        Parameters
        ----------
        name : str
        dtype : dtype, optional
            What the values are converted to, piece by piece as they are read. Values too large for a float become
            infinite.

        Raises
        ------
        FormatError : not numbers, more bytes than a file may hold, one that another dtype than a float does not hold,
            or damage
        MemoryError : within the limits, but not within the memory that there is
        """
        entry = self.entries[name]
        if not entry.is_numbers:
            problem = f"contains {entry.dtype}; must contain numbers" if entry.dtype else "a group; must be a column"
            raise FormatError(f"{self._location(name)}: {problem}")
        stored, kept = np.dtype(entry.dtype), np.dtype(dtype or entry.dtype)
        size = math.prod(entry.shape) * kept.itemsize
        unpacked(self._location(name), size)
        self._claimed += size
        unpacked(str(self.path), self._claimed)
        try:
            array = np.empty(entry.shape, kept)
        except ValueError as error:
            raise FormatError(f"{self._location(name)}: shape {entry.shape}: {first_line(error)}") from None
        self._order({"name": name, "text": False})
        while "done" not in (answer := self._answer()):
            block = tuple(slice(*edges) for edges in answer["block"])
            piece = self._bytes(answer["size"]).view(stored).reshape(array[block].shape)
            with np.errstate(over="ignore", invalid="ignore"):
                array[block] = piece
            if kept.kind != "f":
                try:
                    begin = block[0].start if block else 0
                    refuse_changed(f"{self.path}: {name}", piece, array[block], begin=begin)
                except ProblemError as error:
                    raise FormatError(str(error)) from None
        return array

    def _location(self, name: str) -> str:
        return f"{self.path}, data set {name}"
