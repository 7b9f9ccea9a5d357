"""Bytes of any object with a contiguous buffer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import shown
from taxel._core import ProblemError

__all__ = ["buffer_bytes"]


def buffer_bytes(data: object) -> NDArray[np.uint8]:
    """Return the bytes of anything with a contiguous buffer, without a copy."""
    if isinstance(data, np.ndarray) and data.dtype != np.uint8:
        raise ProblemError(f"data is an array of {data.dtype}: must be bytes or uint8")
    try:
        view = memoryview(data)  # type: ignore[arg-type]
        return np.frombuffer(view.cast("B"), np.uint8) if view.nbytes else np.empty(0, np.uint8)
    except (TypeError, ValueError, BufferError):
        raise ProblemError(f"data is {shown(data)}: must be bytes, or anything with a contiguous buffer") from None
