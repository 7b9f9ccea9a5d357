"""How many threads NumPy and SciPy use: on small matrices several are slower than one."""

from __future__ import annotations

from importlib import import_module

from threadpoolctl import threadpool_limits

__all__ = ["threads"]


def threads(*, several: bool) -> threadpool_limits:
    """Limit NumPy and SciPy to one thread until the context ends, unless several are worth their cost."""
    # SciPy has a separate pool of threads, which can be limited only after it is loaded.
    import_module("scipy.linalg")
    return threadpool_limits(None if several else 1)
