"""The one way from a noun to its plot: a hook, so that nothing below the plots imports them."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

__all__ = ["draw", "draw_by"]

_load: Callable[[], ModuleType] | None = None


def draw_by(load: Callable[[], ModuleType]) -> None:
    """Set the function that gives the module of plots; it is called with the first plot, as matplotlib loads slowly."""
    global _load  # noqa: PLW0603  the hook, which `taxel` itself fills once
    _load = load


def draw(name: str, *arguments: Any) -> Any:
    """Return what a function of the module of plots draws.

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
