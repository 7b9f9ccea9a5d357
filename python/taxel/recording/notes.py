"""Parts of a recording other than events and notes: zeroed taxels, changes of the board, datagrams, samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["BoardChange", "Datagrams", "Samples", "Zeroing"]


@dataclass(frozen=True)
class Zeroing:
    """Hold that a person zeroed a taxel: its held value becomes its rest.

    Parameters
    ----------
    t : int, us
        Time of the zeroing: after all events up to it, before later ones.
    x, y : int, taxels
        The taxel's column and row.
    rest : float, ticks
        The rest from then on.
    before : float, ticks, optional
        The rest before, if it was known.
    """

    t: int
    x: int
    y: int
    rest: float
    before: float | None


@dataclass(frozen=True)
class BoardChange:
    """Hold a change of the board while recording.

    Attributes
    ----------
    t : int, us, or None
        The board's time, which continues over the change; None if it was unknown.
    at_ns : int, ns since 1970
        Time at which the change was detected.
    change : str
        "reset": the board was reset, so the values of its taxels are unknown until their next event. "wire": it
        switched to another version of the wire.
    version : int, 1 or more, or None
        The version of the wire from then on.
    asked : bool
        Whether the host requested the change; otherwise it was detected in the board's datagrams.

    Examples
    --------
    >>> BoardChange(5000, 1_700_000_000_000_000_000, "reset").asked
    False
    """

    t: int | None
    at_ns: int
    change: str
    version: int | None = None
    asked: bool = False

    def _described(self) -> dict[str, Any]:
        """Return the change as files hold it, without the host's time."""
        record: dict[str, Any] = {"t_us": self.t, "change": self.change}
        if self.version is not None:
            record |= {"version": self.version, "asked": self.asked}
        return record


@dataclass(frozen=True, eq=False)
class Datagrams:
    """Hold raw datagrams as received.

    Parameters
    ----------
    arrived_ns : int64, shape (n,), ns since 1970
    number : uint64, shape (n,), from 0 on
        Our arrival number; a missing number is a datagram that was received but is not stored.
    offsets : int64, shape (n + 1,), bytes
        Index of the first byte of each in `payload`; the last entry is the number of bytes.
    payload : uint8, shape (bytes,), bytes as received

    Examples
    --------
    >>> empty = np.zeros(0, np.int64)
    >>> len(Datagrams(empty, empty.astype(np.uint64), np.zeros(1, np.int64), np.zeros(0, np.uint8)))
    0
    """

    arrived_ns: NDArray[np.int64]
    number: NDArray[np.uint64]
    offsets: NDArray[np.int64]
    payload: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.arrived_ns)

    def __getitem__(self, k: int) -> bytes:
        """Return the bytes of one datagram."""
        n = range(len(self))[k]
        return self.payload[self.offsets[n] : self.offsets[n + 1]].tobytes()

    def __repr__(self) -> str:
        return f"Datagrams({len(self)}, {self.payload.size} bytes)"


@dataclass(frozen=True, eq=False)
class Samples:
    """Hold the lines of a stream of numbers as received.

    Parameters
    ----------
    about : mapping
        The description of the stream in the file: its name, columns, and which of them is its own time.
    arrived_ns : int64, shape (n,), ns since 1970
    number : uint64, shape (n,)
        Our arrival number.
    t : int64, shape (n,), us
        The stream's own time, unwrapped; the host's if it has none.
    values : float64, shape (n, columns)
        All columns of each line, with its own time unwrapped.
    """

    about: Mapping[str, Any]
    arrived_ns: NDArray[np.int64]
    number: NDArray[np.uint64]
    t: NDArray[np.int64]
    values: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.t)

    def between(self, start: float, stop: float) -> Samples:
        """Return the lines of ``start <= t < stop`` (us)."""
        inside = (self.t >= start) & (self.t < stop)
        return Samples(self.about, self.arrived_ns[inside], self.number[inside], self.t[inside], self.values[inside])
