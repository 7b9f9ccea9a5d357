"""Calls of NumPy and SciPy that take seconds, so that Ctrl-C need not wait for their end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

__all__ = ["interruptible"]

T = TypeVar("T")


def interruptible(work: Callable[[], T]) -> T:
    """Return what `work` returns, which runs in a thread of its own; raise what it raises.

    A signal is handled while the caller waits: after Ctrl-C the thread computes to its end, and its result is dropped.
    The process waits for it before it exits, since SciPy's SuperLU frees memory in use by a thread that Python ends.
    """
    result: list[T] = []
    raised: list[BaseException] = []
    done = threading.Event()

    def run() -> None:
        try:
            result.append(work())
        except BaseException as error:  # raised again where the caller waits
            raised.append(error)
        finally:
            done.set()

    threading.Thread(target=run, name="taxel-fem").start()
    done.wait()
    if raised:
        raise raised[0]
    return result[0]
