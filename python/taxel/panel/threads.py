"""Work of the panel's server that takes long, in threads for which no end of a process waits."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import ParamSpec, TypeVar

_P = ParamSpec("_P")
_T = TypeVar("_T")

_running: set[threading.Thread] = set()


async def in_thread(work: Callable[_P, _T], *arguments: _P.args, **keywords: _P.kwargs) -> _T:
    """Do work in a thread of its own, and return what it returns; other work goes on meanwhile."""
    done: Future[_T] = Future()
    # Who waits for it may be cancelled; the work is not.
    done.set_running_or_notify_cancel()

    def run() -> None:
        try:
            done.set_result(work(*arguments, **keywords))
        except BaseException as error:
            done.set_exception(error)
        finally:
            _running.discard(threading.current_thread())

    thread = threading.Thread(target=run, name="taxel-request", daemon=True)
    _running.add(thread)
    thread.start()
    return await asyncio.wrap_future(done)


def wait_for_threads(seconds: float) -> None:
    """Wait until all such work is done, but not for longer than this."""
    until = time.monotonic() + seconds
    for thread in list(_running):
        thread.join(max(0.0, until - time.monotonic()))
