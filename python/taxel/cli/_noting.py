"""Notes while recording: a key on a terminal, a line on any other standard input."""

from __future__ import annotations

import contextlib
import os
import select
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
        keys = os.isatty(source)
        # Reading a terminal from the background would stop the whole program.
        if keys and os.tcgetpgrp(source) != os.getpgrp():
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
            yield "a key writes a note" if keys else "a line on standard input writes a note"
        finally:
            over.set()
            thread.join()


def _read(
    source: int, keys: bool, over: threading.Event, write: Callable[[str], None], report: Callable[[str], None]
) -> None:
    pending = b""
    while not over.is_set():
        if not select.select([source], [], [], _POLL_S)[0]:
            continue
        try:
            typed = os.read(source, 4096)
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
                report(f"not noted: {error}")
        if not typed:
            return


def _keys(typed: str) -> list[str]:
    """Return a label for each key: its letter, "mark" for space and return; none for arrow keys and the like."""
    if typed.startswith("\x1b"):
        return []
    return [
        key if key.isprintable() and not key.isspace() else "mark"
        for key in typed
        if key in " \n\r" or key.isprintable()
    ]


@contextlib.contextmanager
def _by_key(source: int) -> Iterator[None]:
    """Let a terminal pass each key at once, without showing it; Ctrl-C works as before."""
    import termios  # noqa: PLC0415  Unix only
    import tty  # noqa: PLC0415

    before = termios.tcgetattr(source)
    tty.setcbreak(source)
    try:
        yield
    finally:
        termios.tcsetattr(source, termios.TCSADRAIN, before)
