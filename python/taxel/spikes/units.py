"""Conversion between ms, the unit of spikes and neurons, and us, the unit of the wire and of events."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import NDArray


@overload
def to_ms(us: float | np.integer[Any]) -> float: ...
@overload
def to_ms(us: NDArray[Any]) -> NDArray[np.float64]: ...
def to_ms(us: Any) -> Any:
    """Convert times of the wire, us, to the unit of neurons, ms."""
    return us / 1000.0


@overload
def to_us(ms: float) -> float: ...
@overload
def to_us(ms: NDArray[Any]) -> NDArray[np.float64]: ...
def to_us(ms: Any) -> Any:
    """Convert times of neurons, ms, to the unit of the wire, us, without rounding."""
    return ms * 1000.0
