"""The command line: one file a command.

Exit codes, for scripts: 0 done, 2 the user's input is wrong, 3 board, socket or disk, 130 stopped by Ctrl-C, SIGTERM or
SIGHUP.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Callable
from typing import NoReturn

from taxel._base.stopping import leave, stop_on_signals
from taxel._core import Error
from taxel.cli._commands import ABOUT, command, listing, nearest
from taxel.cli._say import say

__all__ = ["main", "program"]

#: Exit codes, as of `taxel.cli.app`.
_WRONG_INPUT, _STOPPED = 2, 130


def program() -> NoReturn:
    """Run the command line as the only work of this process: its environment and its signals are the command's."""
    # Workers that libraries start import nothing from the current folder either.
    os.environ["PYTHONSAFEPATH"] = "1"
    # Commands draw into files alone: matplotlib needs no windows, for which a Python may lack a library.
    os.environ.setdefault("MPLBACKEND", "Agg")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # Characters that a console's encoding lacks are shown escaped, like control characters.
            stream.reconfigure(errors="backslashreplace")
    try:
        # An interrupt within an import can come out of a library as another error: until then it ends the process.
        main(loaded=stop_on_signals)
    except KeyboardInterrupt:
        leave(_STOPPED)
    except BrokenPipeError:
        # The reader of the output has ended: nothing more can be flushed there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        leave(1)
    except SystemExit as end:
        leave(end.code)


def main(arguments: list[str] | None = None, *, loaded: Callable[[], None] | None = None) -> NoReturn:
    """Run the command line; a wrong input ends it with one line on stderr and an exit code.

    `loaded` is called when the command has been imported, before it runs.
    """
    words = sys.argv[1:] if arguments is None else arguments
    name = words[0] if words else ""
    if name in ("--help", "-h", ""):
        say(*ABOUT, *listing(), err=not name)
        sys.exit(0 if name else _WRONG_INPUT)
    if name == "--version":
        from taxel import __version__  # noqa: PLC0415  the package imports its compiled part

        say(f"taxel {__version__}")
        sys.exit(0)
    try:
        app = command(name)
    except Error as error:
        say(f"taxel: {error}", err=True)
        sys.exit(_WRONG_INPUT)
    if app is None:
        say(f"taxel: No such command {name!r}{nearest(name)}; see taxel --help", err=True)
        sys.exit(_WRONG_INPUT)
    from taxel.cli._running import run  # noqa: PLC0415  the list of commands is there at once

    if loaded is not None:
        loaded()
    run(app, words[1:], f"taxel {name}")
