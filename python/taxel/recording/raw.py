"""Data as they were received: the datagrams of a board, the lines of a stream of numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Datagrams:
    """Hold raw datagrams as received.

    Parameters
    ----------
    arrived_ns : int64, shape (n,), ns since 1970
    number : uint64, shape (n,), counted from 0
        Number of the arrival; a missing number is a datagram that was received but is not stored.
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
