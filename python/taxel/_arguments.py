"""A caller's arguments, on their way to the compiled part."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel._core import ProblemError

__all__ = ["floats", "number", "parameters"]


def number(name: str, value: object) -> float:
    """Return a float; refuse what is none, by name."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise ProblemError(f"{name} is {value!r}: must be a number")
    return float(value)


def floats(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return a contiguous float64 array of one dimension; refuse what is none, by name."""
    try:
        array = np.ascontiguousarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{name}: {error}") from None
    if np.ndim(values) != 1:
        raise ProblemError(f"{name} has {np.ndim(values)} dimensions: must have one")
    return array


def parameters(values: Mapping[str, object]) -> str:
    """Return parameters as JSON for the compiled part, which checks them; JSON has no NaN, so those end here."""

    def plain(name: str, value: object) -> object:
        if isinstance(value, Mapping):
            return {key: plain(str(key), entry) for key, entry in value.items()}
        if isinstance(value, list | tuple | np.ndarray):
            return [plain(f"{name}[{k}]", entry) for k, entry in enumerate(value)]
        if value is None or isinstance(value, str | bool | np.bool_):
            return bool(value) if isinstance(value, np.bool_) else value
        if isinstance(value, int | np.integer):
            return int(value)
        real = number(name, value)
        if not math.isfinite(real):
            raise ProblemError(f"{name} is {real}: must be finite")
        return real

    return json.dumps({name: plain(name, value) for name, value in values.items()})
