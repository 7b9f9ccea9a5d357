"""The hook by which a data class calls its plot, so that only `taxel` itself imports `taxel.plot`."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

_load: Callable[[], ModuleType] | None = None


def draw_by(load: Callable[[], ModuleType]) -> None:
    """Set the function that imports the module of plots; it is called at the first plot, as matplotlib loads slowly."""
    global _load  # noqa: PLW0603  the hook, which `taxel` itself sets once
    _load = load


def draw(name: str, *arguments: Any) -> Any:
    """Call a function of the module of plots and return its result.

    Parameters
    ----------
    name : str
        The function.
    *arguments
        Its arguments.

    Raises
    ------
    ImportError : matplotlib is not installed, or the hook was not set
    """
    if _load is None:
        raise ImportError("plots: import taxel first")
    return getattr(_load(), name)(*arguments)
