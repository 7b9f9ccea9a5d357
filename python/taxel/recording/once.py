"""Values that are read at their first use."""

from __future__ import annotations

from collections.abc import Callable, Sized
from typing import Any, Generic, TypeVar

import numpy as np

from taxel import _core
from taxel.clock import Clock

#: The held value, in files, of a taxel without any event so far.
UNKNOWN = _core.UNKNOWN

T = TypeVar("T")
U = TypeVar("U")


class Once(Generic[T]):
    """A value that is read at the first call, and cached.

    Parameters
    ----------
    read : function without arguments
        Called once; after an error the next call tries again.
    holds : function without arguments, optional
        Whether the value holds anything, if that can be computed faster than the value itself.
    """

    def __init__(self, read: Callable[[], T], holds: Callable[[], bool] | None = None) -> None:
        self._read: Callable[[], T] | None = read
        self._holds = holds

    def __call__(self) -> T:
        """Return the value."""
        if self._read is not None:
            self._value = self._read()
            # Drop the function, so that what it refers to (another recording's contents) can be freed.
            self._read = self._holds = None
        return self._value

    @property
    def is_read(self) -> bool:
        """Whether the value is in memory."""
        return self._read is None

    def holds(self) -> bool:
        """Return whether the value holds anything."""
        return anything(self()) if self._holds is None else self._holds()

    def to(self, change: Callable[[T], U]) -> Once[U]:
        """Return a changed value, read at its first call, that holds something if this value does."""
        return Once(lambda: change(self()), self.holds)

    def __getstate__(self) -> dict[str, Any]:
        """Read and return the value, so that a pickle does not need the file."""
        return {"_read": None, "_holds": None, "_value": self()}


def known(value: T) -> Once[T]:
    """Return a value that needs no reading."""
    once = Once(lambda: value)
    once()
    return once


def anything(value: object) -> bool:
    """Return whether a value holds any information."""
    match value:
        case Clock():
            return len(value.board_us) > 0
        case np.ndarray():
            return bool((value != UNKNOWN).any())
        case dict():
            return any(map(anything, value.values()))
        case Sized():
            return len(value) > 0
        case float():
            # 0.0 too is a number that readings are subtracted from.
            return True
    return bool(value)
