"""Runs a command; what is wrong with its input ends it with one line on stderr and an exit code."""

from __future__ import annotations

import errno
import os
import sys
import warnings
from pathlib import Path
from typing import Any, NoReturn

import cyclopts

from taxel._core import DeviceError, Error
from taxel.cli._say import say
from taxel.cli.app import OUTSIDE, STOPPED, WRONG_INPUT, page, said, typed


def run(app: cyclopts.App, words: list[str], path: str) -> NoReturn:
    """Run a command, or one of a group, whose `path` is what is typed for it."""
    asked = [word for word in words if word not in ("--help", "-h")]
    own, apps, left = app.parse_commands(asked)
    chosen, path = apps[-1], " ".join([path, *own])
    wants_help = len(asked) < len(words)
    if wants_help or (chosen.default_command is None and not left):
        say(*page(chosen, path), err=not wants_help)
        sys.exit(0 if wants_help else WRONG_INPUT)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _say_warning
            code = app(words, exit_on_error=False, print_error=False, result_action="return_value")
    except cyclopts.CycloptsError as error:
        _end(said(error, path), WRONG_INPUT)
    except KeyboardInterrupt:
        sys.exit(STOPPED)
    except Error as error:
        if error.argument is not None:
            error.argument = typed(chosen, error.argument, with_value=error.hint is not None)
        # It escapes the line breaks of names; those that are left are its own.
        line, *below = str(error).split("\n")
        _end(line, OUTSIDE if isinstance(error, DeviceError) else WRONG_INPUT, *below)
    except FileExistsError as error:
        may_replace = any("--overwrite" in one.names for one in chosen.assemble_argument_collection())
        remedy = "give --overwrite, or another name" if may_replace else "give another name"
        _end(_system_error(FileExistsError(errno.EEXIST, f"exists already; {remedy}", error.filename)), WRONG_INPUT)
    except (FileNotFoundError, IsADirectoryError, NotADirectoryError) as error:
        _end(_system_error(error), WRONG_INPUT)
    except BrokenPipeError:
        raise
    except OSError as error:
        _end(_system_error(error), OUTSIDE)
    except ImportError as error:
        if "pip install 'taxel[" not in str(error):
            raise
        _end(str(error), WRONG_INPUT)
    except MemoryError as error:
        _end(f"this needs more memory than is available ({error})", OUTSIDE)
    sys.exit(code if isinstance(code, int) else 0)


def _say_warning(message: Warning | str, *_where: Any, **_line: Any) -> None:
    """Print a warning that the command does not gather, as a line without the place in the code."""
    say(f"taxel: warning: {message}", err=True)


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
        taken = "; end the program that listens there, or name another port" * (error.errno == errno.EADDRINUSE)
        return f"{error.filename}: {error.strerror.lower()}{taken}"
    return str(error)
