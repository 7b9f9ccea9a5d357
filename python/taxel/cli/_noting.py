"""Notes while recording: each line on standard input is one."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator

from taxel._core import Error


@contextlib.contextmanager
def noting(write: Callable[[str], None], report: Callable[[str], None]) -> Iterator[str]:
    """Pass each line on standard input to `write` until the block ends.

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
        # A terminal that is read from the background stops the whole program.
        is_readable = sys.platform == "win32" or not os.isatty(source) or os.tcgetpgrp(source) == os.getpgrp()
    except (OSError, ValueError, AttributeError):
        is_readable = False
    if not is_readable:
        yield ""
        return
    over = threading.Event()

    def read() -> None:
        with contextlib.suppress(OSError), open(source, "rb", buffering=0, closefd=False) as lines:
            for line in lines:
                label = line.decode("utf-8", "replace").strip()
                if over.is_set():
                    return
                if not label:
                    continue
                try:
                    write(label)
                    report(f"noted: {label}")
                except (Error, OSError) as error:
                    report(f"note not saved: {error}")

    threading.Thread(target=read, daemon=True).start()
    try:
        yield "each line on standard input is saved as a note"
    finally:
        over.set()
