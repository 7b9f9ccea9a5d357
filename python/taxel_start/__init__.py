"""The program `taxel` while the package `taxel` loads: that takes a while, in which Ctrl-C is to be quiet too."""

import os
import sys


def _leave_out_current_folder() -> None:
    """Leave out the current folder, where no more than an empty entry of PYTHONPATH put it on the path.

    A folder of recordings may hold Python files of strangers. A checkout that contains taxel itself stays.
    """
    named = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    try:
        here = os.getcwd()
    except FileNotFoundError:
        return
    if "" in named and here not in map(os.path.abspath, filter(None, named)):
        own = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
        sys.path[:] = [entry for entry in sys.path if entry not in ("", here) or here == own]


# Before anything is imported that a file of the current folder could stand for.
_leave_out_current_folder()

import signal  # noqa: E402
from typing import NoReturn  # noqa: E402

__all__ = ["main"]

#: Exit code of what Ctrl-C stopped, as `taxel.cli` has it.
_STOPPED = 130
#: Exit code of wrong input, as `taxel.cli` has it.
_WRONG_INPUT = 2


def main() -> NoReturn:
    """Load the command line, then run it."""
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # those of all systems
    for number in [getattr(signal, name) for name in names if hasattr(signal, name)]:
        # What was ignored when the program began, as by nohup, stays ignored.
        if signal.getsignal(number) is not signal.SIG_IGN:
            # Nothing is open yet that would have to be closed.
            signal.signal(number, lambda *_: os._exit(_STOPPED))
    try:
        from taxel.cli import program  # noqa: PLC0415  this is what takes a while
    except Exception as error:
        # The compiled part refuses to load where TAXEL_INSTRUCTIONS names no vector instructions of this machine.
        if type(error).__module__ != "taxel":
            raise
        print(f"taxel: {error}", file=sys.stderr)
        sys.exit(_WRONG_INPUT)
    from taxel.wire import decode  # noqa: PLC0415

    # With its first array the compiled part asks NumPy for its interface: an interrupt there would be a panic.
    decode(b"")
    program()
