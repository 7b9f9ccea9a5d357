"""How a command or a task is stopped: by Ctrl-C, SIGTERM (a service that ends) and SIGHUP (a terminal that closes).

Windows has Ctrl-C, Ctrl-Break and a console that closes.
"""

from __future__ import annotations

import _thread
import atexit
import contextlib
import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import NoReturn

#: A terminal that closes sends SIGHUP twice, and a service that ends SIGTERM and SIGHUP: signals that follow another
#: within this time are not taken for a second request, s.
_ONE_REQUEST_S = 1.0

#: Those of all systems.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")

_Handler = Callable[[int, FrameType | None], None]


class _Requests:
    """Tells a new request to stop from one that repeats the last."""

    def __init__(self) -> None:
        self._last = float("-inf")

    def is_new(self, number: int) -> bool:
        """Return whether a signal is a new request; Ctrl-C always is, because a person types it."""
        before, self._last = self._last, time.monotonic()
        return number == signal.SIGINT or self._last - before > _ONE_REQUEST_S


_requests = _Requests()


def _stop(number: int, _frame: FrameType | None) -> None:
    if _requests.is_new(number):
        raise KeyboardInterrupt


def _handle(handler: _Handler) -> dict[int, object]:
    """Install a handler of the signals that stop a command; return those before.

    A signal that was ignored when the program began, as by nohup, stays ignored.
    """
    numbers = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    handled = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
    return {number: signal.signal(number, handler) for number in handled}


def stop_on_signals() -> None:
    """Raise KeyboardInterrupt on SIGTERM and SIGHUP as on Ctrl-C, so that recordings are closed and files removed."""
    _handle(_stop)
    if sys.platform == "win32":
        # After the handler of the C library, so that Windows calls it before that one, which returns at once.
        ctypes.windll.kernel32.SetConsoleCtrlHandler(_on_console_event, True)


if sys.platform == "win32":
    #: CTRL_C_EVENT and CTRL_BREAK_EVENT; the others are a console that closes, a user who leaves, and a shutdown.
    _CTRL_C, _CTRL_BREAK = 0, 1
    #: Longer than the 5 s that Windows gives to a program whose console closes, s.
    _FOREVER_S = 60.0

    def _stop_main_thread(event: int) -> int:
        """Stop the main thread; where the console closes Windows ends the process as soon as this returns."""
        if event == _CTRL_C:
            return False
        _thread.interrupt_main(signal.SIGBREAK)
        if event != _CTRL_BREAK:
            time.sleep(_FOREVER_S)
        return True

    _on_console_event = ctypes.WINFUNCTYPE(ctypes.c_int, ctypes.c_uint)(_stop_main_thread)


@contextlib.contextmanager
def asked_to_end() -> Iterator[threading.Event]:
    """Turn the first request into a flag, so that no detection is lost before it is printed; the next raises."""
    end_request = threading.Event()

    def note(number: int, frame: FrameType | None) -> None:
        if end_request.is_set():
            _stop(number, frame)
        elif _requests.is_new(number):
            end_request.set()

    before = _handle(note)
    try:
        yield end_request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]  # what signal.signal returned


def leave(code: int | str | None) -> NoReturn:
    """End the process with an exit code.

    Where a thread runs Python code yet for which no end of the interpreter waits, it must not end as usual: it would
    end the thread inside compiled code, which aborts the process. A request of the panel's page may be such a thread.
    """
    known = {thread.ident for thread in threading.enumerate() if not thread.daemon}
    if not isinstance(code, int) or set(sys._current_frames()) <= known:
        sys.exit(code)
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)
