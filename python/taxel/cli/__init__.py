"""The command line: one file a command."""

from __future__ import annotations

import sys
from typing import NoReturn

import click
import typer

from taxel._core import DeviceError, Error

__all__ = ["app", "main"]

app = typer.Typer(
    name="taxel",
    help="Touch as events: from the bytes of a tactile array to decisions that say when.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

#: Exit codes, for scripts: 0 done, 2 the user's input is wrong, 3 board, socket or disk, 130 stopped by Ctrl-C.
WRONG_INPUT, OUTSIDE, STOPPED = 2, 3, 130


@app.callback(invoke_without_command=True)
def _root(version: bool = typer.Option(False, "--version", help="Print the version and end.")) -> None:
    if version:
        from taxel import __version__  # noqa: PLC0415

        typer.echo(f"taxel {__version__}")
        raise typer.Exit


def main(arguments: list[str] | None = None) -> NoReturn:
    """Run the command line; what the user got wrong ends in one line on stderr and an exit code."""
    try:
        code = app(arguments, standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help() if error.ctx else "")
        code = WRONG_INPUT
    except click.ClickException as error:
        error.show()
        code = WRONG_INPUT
    except (KeyboardInterrupt, click.Abort):
        click.echo("taxel: stopped", err=True)
        code = STOPPED
    except DeviceError as error:
        click.echo(f"taxel: {error}", err=True)
        code = OUTSIDE
    except Error as error:
        click.echo(f"taxel: {error}", err=True)
        code = WRONG_INPUT
    except (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError) as error:
        click.echo(f"taxel: {_said(error)}", err=True)
        code = WRONG_INPUT
    except OSError as error:
        click.echo(f"taxel: {_said(error)}", err=True)
        code = OUTSIDE
    sys.exit(code or 0)


def _said(error: OSError) -> str:
    if error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}"
    return str(error)
