"""The program `taxel` while the package `taxel` loads: that takes a while, in which Ctrl-C is to be quiet too."""

import os
import signal
import sys
from typing import NoReturn

__all__ = ["main"]

#: Exit code of what Ctrl-C stopped, as `taxel.cli` has it.
_STOPPED = 130
#: Exit code of wrong input, as `taxel.cli` has it.
_WRONG_INPUT = 2


def main() -> NoReturn:
    """Load the command line, then run it."""
    # Nothing is open yet that would have to be closed.
    signal.signal(signal.SIGINT, lambda *_: os._exit(_STOPPED))
    try:
        from taxel.cli import main as run  # noqa: PLC0415  this is what takes a while
    except Exception as error:
        # The compiled part refuses to load where TAXEL_INSTRUCTIONS names no vector instructions of this machine.
        if type(error).__module__ != "taxel":
            raise
        print(f"taxel: {error}", file=sys.stderr)
        sys.exit(_WRONG_INPUT)
    from taxel.wire import decode  # noqa: PLC0415

    # With its first array the compiled part asks NumPy for its interface: an interrupt there would be a panic.
    decode(b"")
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:
        sys.exit(_STOPPED)
