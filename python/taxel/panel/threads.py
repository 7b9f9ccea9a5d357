"""Work of the panel's server that takes long, in threads for which no end of a process waits."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")

_running: set[threading.Thread] = set()


async def in_thread(work: Callable[_P, _T], *arguments: _P.args, **keywords: _P.kwargs) -> _T:
    """Do work in a thread of its own, and return what it returns; other work goes on meanwhile."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[_T] = loop.create_future()

    def tell(set_outcome: Callable[[Any], None], outcome: Any) -> None:
        if not done.done():
            set_outcome(outcome)

    def run() -> None:
        try:
            told: tuple[Callable[[Any], None], Any] = (done.set_result, work(*arguments, **keywords))
        except BaseException as error:
            told = (done.set_exception, error)
        finally:
            _running.discard(threading.current_thread())
        # The server may have ended meanwhile.
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(tell, *told)

    thread = threading.Thread(target=run, name="taxel-request", daemon=True)
    _running.add(thread)
    thread.start()
    return await done


def wait_for_threads(seconds: float) -> None:
    """Wait until all such work is done, but not for longer than this."""
    until = time.monotonic() + seconds
    for thread in list(_running):
        thread.join(max(0.0, until - time.monotonic()))
