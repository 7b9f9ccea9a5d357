"""The command line: one file a command.

Exit codes, for scripts: 0 done, 2 the user's input is wrong, 3 board, socket or disk, 130 stopped by Ctrl-C, SIGTERM or
SIGHUP.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import typer

from taxel._base.arguments import finite, integer, shown
from taxel._base.number_text import float_of
from taxel._base.stopping import leave, stop_on_signals
from taxel._core import DeviceError, Error, ProblemError
from taxel.cli._app import OUTSIDE, STOPPED, WRONG_INPUT, App, SecondsOption
from taxel.cli._commands import Commands
from taxel.cli._recordings import SET_HELP, assignments
from taxel.cli._say import say

__all__ = ["SET_HELP", "App", "SecondsOption", "app", "assignments", "main", "program", "say"]

app = App(
    name="taxel",
    cls=Commands,
    help="Touch as events: from the bytes of a tactile array to detections with exact times.",
    no_args_is_help=True,
    epilog="Begin with: taxel demo. docs/start.md in the repository shows which page to read for your data.",
)

#: What checks numbers that the parser refuses.
_CHECKS: dict[Any, Callable[..., object]] = {int: integer, float: finite}

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
        leave(STOPPED)
    except SystemExit as end:
        leave(end.code)


def main(arguments: list[str] | None = None, *, loaded: Callable[[], None] | None = None) -> NoReturn:
    """Run the command line; a wrong input ends it with one line on stderr and an exit code.

    `loaded` is called when the command has been imported, before it runs.
    """
    try:
        code = app(arguments, prog_name="taxel", standalone_mode=False, obj=loaded)
    except _UsageError as error:
        if not str(error.format_message()).startswith("Usage:"):
            _end(_plain(error), WRONG_INPUT)
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
        _end(f"this needs more memory than is available ({error})", OUTSIDE)
    sys.exit(code if isinstance(code, int) else 0)


def _plain(error: Any) -> str:
    """Return what is wrong with a command line: in the words of our own checks where a value is."""
    parameter = getattr(error, "param", None)
    if parameter is not None:
        name = max(parameter.opts, key=len) if parameter.param_type_name == "option" else parameter.name.upper()
        faults = getattr(error.__cause__, "errors", None)
        if faults is not None:
            return _value(name, parameter, faults()[0])
        line = f"{name} is missing" if hasattr(error, "param_type") else f"{name}: {error.message}"
    elif hasattr(error, "option_name") and not hasattr(error, "possibilities"):
        line = f"{error.option_name}: needs a value"
    else:
        line = error.format_message()
    return f"{line.rstrip('.')}; see {_command_path(error.ctx)} --help"


def _value(name: str, parameter: Any, fault: dict[str, Any]) -> str:
    """Return why the parser refuses a value: the checks of all arguments say it of numbers."""
    value, check = fault["input"], _CHECKS.get(parameter.type_descriptor.annotation)
    if check is not None:
        with contextlib.suppress(ValueError, TypeError):
            value = float_of(value)
        limits = {key: end for key, end in (("least", parameter.min), ("most", parameter.max)) if end is not None}
        try:
            check(name, value, **limits)
        except ProblemError as error:
            return str(error)
    return f"{name} is {shown(value)}: {fault['msg'].replace('Input should be', 'must be')}"


def _command_path(context: Any) -> str:
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
