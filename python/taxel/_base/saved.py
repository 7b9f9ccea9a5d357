"""Base of what is saved as a file of JSON: a tare, a calibration, a readout and a plain rule."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar, Self, TypeVar

from taxel._base.arguments import checked_path
from taxel._base.documents import of_json, read_text
from taxel._base.errors import placed, unreadable
from taxel._base.files import write_whole
from taxel._core import Error, FormatError

_S = TypeVar("_S")


class Saved(ABC):
    """Has a text of JSON, by which two are equal and which a file holds."""

    #: What it is, in errors.
    _WHAT: ClassVar[str]

    @abstractmethod
    def to_json(self) -> str:
        """Return the text of its file."""

    @classmethod
    @abstractmethod
    def from_json(cls, text: str) -> Self:
        """Return the one that `to_json` wrote."""

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Path:
        """Write it to a JSON file, whole or not at all, and return its path.

        Parameters
        ----------
        path : path
        overwrite : bool
            Whether an existing file may be replaced.

        Returns
        -------
        Path

        Raises
        ------
        FileExistsError : the file is there already and `overwrite` is false
        """
        text = self.to_json().removesuffix("\n") + "\n"
        return write_whole(path, lambda file: file.write(text.encode()), overwrite=overwrite)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read the file that `save` wrote: the same to the last bit.

        Parameters
        ----------
        path : path

        Raises
        ------
        FormatError : another kind of file, or invalid parts (names the file)
        FileNotFoundError : no such file
        """
        return read(path, cls._WHAT, cls.from_json)

    def __eq__(self, other: object) -> bool:
        return self.to_json() == other.to_json() if isinstance(other, type(self)) else NotImplemented

    __hash__ = None  # type: ignore[assignment]


def read(path: str | os.PathLike[str], noun: str, of_text: Callable[[str], _S]) -> _S:
    """Return what the text of a file stands for; errors name the file."""
    file = Path(checked_path("path", path))
    try:
        text = read_text(file)
        of_json(str(file), text)
    except FormatError as error:
        error.args = (f"{error.args[0]}; must be a {noun} as taxel writes it",)
        raise
    try:
        return of_text(text)
    except FormatError as error:
        raise placed(error, file) from None
    except Error as error:
        raise unreadable(str(error), file) from None
