"""Prints what a command says: whole lines, in which control characters are escaped."""

from __future__ import annotations

import typer

from taxel._base.messages import escaped


def say(*lines: object, err: bool = False) -> None:
    """Print each text as one line: names in strangers' files may hold line breaks and escapes of a terminal.

    Parameters
    ----------
    *lines : str
        Of a text of several lines each is given alone. JSON holds no control character, and stays as it is.
    err : bool
        Whether it is printed to standard error.
    """
    for line in lines:
        typer.echo(escaped(line), err=err)  # noqa: TID251  the place where it is allowed
