"""The command line: one file a command.

Exit codes, for scripts: 0 done, 2 the user's input is wrong, 3 board, socket or disk, 130 stopped by Ctrl-C, SIGTERM or
SIGHUP.
"""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any, NoReturn

import typer

from taxel._base.child_process import make_safe
from taxel._core import DeviceError, Error
from taxel.cli._app import OUTSIDE, STOPPED, WRONG_INPUT, App
from taxel.cli._commands import Commands
from taxel.cli._recordings import SET_HELP, assignments
from taxel.cli._say import say
from taxel.cli._stopping import leave, stop_on_signals

__all__ = ["SET_HELP", "App", "app", "assignments", "main", "program", "say"]

app = App(
    name="taxel",
    cls=Commands,
    help="Touch as events: from the bytes of a tactile array to detections with exact times.",
    no_args_is_help=True,
    epilog="Begin with: taxel demo. Pages by what you have are in docs/ of the repository, from docs/start.md on.",
)

#: typer's error for a command line that cannot be parsed; the class belongs to its own copy of click.
_UsageError: Any = typer.BadParameter.__base__


@app.callback(invoke_without_command=True)
def _root(version: bool = typer.Option(False, "--version", help="Print the version and end.")) -> None:
    if version:
        from taxel import __version__  # noqa: PLC0415  the package imports its compiled part

        say(f"taxel {__version__}")
        raise typer.Exit


def program() -> NoReturn:
    """Run the command line as the only work of this process: its environment and its signals are the command's."""
    make_safe(os.environ)
    try:
        stop_on_signals()
        main()
    except KeyboardInterrupt:
        leave(STOPPED)
    except SystemExit as end:
        leave(end.code)


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line; a wrong input ends it with one line on stderr and an exit code."""
    try:
        code = app(arguments, prog_name="taxel", standalone_mode=False)
    except _UsageError as error:
        if not str(error.format_message()).startswith("Usage:"):
            _end(f"{_plain(error)}; see {_typed(error.ctx)} --help", WRONG_INPUT)
        # Without a command, the help is printed.
        say(*error.format_message().split("\n"), err=True)
        sys.exit(WRONG_INPUT)
    except KeyboardInterrupt:
        sys.exit(STOPPED)
    except Error as error:
        # It escapes the line breaks of names; those that are left are its own.
        line, *below = str(error).split("\n")
        _end(line, OUTSIDE if isinstance(error, DeviceError) else WRONG_INPUT, *below)
    except (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError) as error:
        _end(_system_error(error), WRONG_INPUT)
    except OSError as error:
        _end(_system_error(error), OUTSIDE)
    except ImportError as error:
        if "pip install 'taxel[" not in str(error):
            raise
        _end(str(error), WRONG_INPUT)
    except MemoryError as error:
        _end(f"this needs more memory than there is ({error})", OUTSIDE)
    sys.exit(code if isinstance(code, int) else 0)


def _plain(error: Any) -> str:
    """Return a message of the parser in the form of our own messages, with the value that was typed."""
    message = re.sub(
        r"^Invalid value for '?(.+?)'?: ", lambda m: f"{m[1]}{_given(error)}: ", str(error.format_message())
    )
    message = re.sub(
        r"^Missing (?:argument|option|parameter) '(.+?)'.*", lambda m: f"{_upper(m[1])} is missing", message
    )
    message = re.sub(r"^Option '(.+?)' requires an argument", r"\1: needs a value", message)
    message = message.replace("Input should be", "must be").rstrip(".")
    return re.sub(r"must be a valid (\w+)(, .*)?$", lambda m: f"must be {_NUMBERS.get(m[1], m[1])}", message)


def _given(error: Any) -> str:
    """Return the value that was typed, after a blank, where the parser's message leaves it out."""
    checked = getattr(error.__cause__, "errors", None)
    if checked is None:
        return ""
    value = str(checked()[0]["input"])
    shown = value if value.isprintable() and value.split() == [value] else repr(value)
    return "" if f"'{value}'" in error.message else f" {shown[:60]}{' ...' * (len(shown) > 60)}"


#: The parser's names of number types, and how our own messages name them.
_NUMBERS = {"number": "a number", "integer": "a whole number"}


def _upper(word: str) -> str:
    return word if word.startswith("-") else word.upper()


def _typed(context: Any) -> str:
    """Return the command that was being parsed, as it is typed."""
    return "taxel" if context is None else str(context.command_path)


def _end(line: str, code: int, *below: str) -> NoReturn:
    say(f"taxel: {line}", *below, err=True)
    sys.exit(code)


def _system_error(error: OSError) -> str:
    """Return an error of the operating system as one line that names the place."""
    if isinstance(error, FileNotFoundError) and error.filename is not None:
        folder = Path(os.fsdecode(error.filename)).parent
        if not folder.is_dir():
            return f"{folder}: no such folder"
    if error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}"
    return str(error)
