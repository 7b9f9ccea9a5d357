"""Notes while recording: a key on a terminal, a line on any other standard input."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator

from taxel._core import Error

#: Interval at which the end of the recording is checked, s.
_POLL_S = 0.1


@contextlib.contextmanager
def noting(write: Callable[[str], None], report: Callable[[str], None]) -> Iterator[str]:
    """Pass what is typed to `write` until the block ends: on a terminal each key at once, else each complete line.

    Parameters
    ----------
    write : function
        Takes the label.
    report : function
        Takes one line for the user: the note, or why it was not written.

    Yields
    ------
    str
        How to write a note, for the user; "" without an input that can be typed on.
    """
    try:
        source = sys.stdin.fileno()
        keys = _is_terminal(source)
        if keys and not _is_in_front(source):
            source = -1
    except (OSError, ValueError, AttributeError):
        source, keys = -1, False
    if source < 0:
        yield ""
        return
    over = threading.Event()
    with _by_key(source) if keys else contextlib.nullcontext():
        thread = threading.Thread(target=_read, args=(source, keys, over, write, report), daemon=True)
        thread.start()
        try:
            yield "press a key to write a note" if keys else "each line on standard input is saved as a note"
        finally:
            over.set()
            thread.join()


def _read(
    source: int, keys: bool, over: threading.Event, write: Callable[[str], None], report: Callable[[str], None]
) -> None:
    pending = b""
    while not over.is_set():
        try:
            if not _is_typed(source, keys):
                continue
            typed = _typed(source, keys)
        except OSError:
            return
        pending += typed
        if keys:
            labels, pending = _keys(pending.decode("utf-8", "replace")), b""
        else:
            *lines, pending = pending.split(b"\n") if typed else (pending, b"")
            labels = [label for line in lines if (label := line.decode("utf-8", "replace").strip())]
        for label in labels:
            try:
                write(label)
                report(f"noted: {label}")
            except (Error, OSError) as error:
                report(f"note not saved: {error}")
        if not typed:
            return


def _keys(typed: str) -> list[str]:
    """Return a label for each key: its letter, "mark" for space and return; none for arrow keys and similar."""
    if typed.startswith("\x1b"):
        return []
    return [
        key if key.isprintable() and not key.isspace() else "mark"
        for key in typed
        if key in " \n\r" or key.isprintable()
    ]


if sys.platform == "win32":
    import _winapi
    import ctypes
    import msvcrt
    import time

    def _is_terminal(source: int) -> bool:
        """Return whether an input is a console: NUL, which Python takes for a terminal, is none."""
        return bool(ctypes.windll.kernel32.GetConsoleMode(_handle(source), ctypes.byref(ctypes.c_uint())))

    def _is_in_front(source: int) -> bool:  # noqa: ARG001  as elsewhere
        return True

    def _handle(source: int) -> ctypes.c_void_p:
        return ctypes.c_void_p(msvcrt.get_osfhandle(source))

    def _is_typed(source: int, keys: bool) -> bool:
        """Wait a moment for what can be read, the end included."""
        if keys:
            is_there = msvcrt.kbhit()
        else:
            handle = msvcrt.get_osfhandle(source)
            try:
                is_pipe = _winapi.GetFileType(handle) == _winapi.FILE_TYPE_PIPE
                is_there = not is_pipe or _winapi.PeekNamedPipe(handle)[-2] > 0
            except BrokenPipeError:
                is_there = True
        if not is_there:
            time.sleep(_POLL_S)
        return is_there

    def _typed(source: int, keys: bool) -> bytes:
        if not keys:
            return os.read(source, 4096)
        key = msvcrt.getwch()
        # An arrow key and the like are two characters.
        if key in "\0\xe0" and msvcrt.kbhit():
            msvcrt.getwch()
            return b"\x1b"
        return key.encode("utf-8", "replace")

    def _by_key(source: int) -> contextlib.nullcontext[None]:  # noqa: ARG001  as elsewhere
        """Leave a console as it is: keys are asked for one by one."""
        return contextlib.nullcontext()

else:
    import select
    import termios
    import tty

    _is_terminal = os.isatty

    def _is_in_front(source: int) -> bool:
        """Return whether a terminal can be read: from the background that would stop the whole program."""
        return os.tcgetpgrp(source) == os.getpgrp()

    def _is_typed(source: int, keys: bool) -> bool:  # noqa: ARG001  as on Windows
        """Wait a moment for what can be read, the end included."""
        return bool(select.select([source], [], [], _POLL_S)[0])

    def _typed(source: int, keys: bool) -> bytes:  # noqa: ARG001  as on Windows
        return os.read(source, 4096)

    @contextlib.contextmanager
    def _by_key(source: int) -> Iterator[None]:
        """Let a terminal pass each key at once, without showing it; Ctrl-C works as before."""
        before = termios.tcgetattr(source)
        tty.setcbreak(source)
        try:
            yield
        finally:
            termios.tcsetattr(source, termios.TCSADRAIN, before)
