"""The command that all others register themselves with."""

from __future__ import annotations

import typer

__all__ = ["OUTSIDE", "WRONG_INPUT", "app"]

#: Exit codes: the user's input is wrong; board, socket or disk.
WRONG_INPUT, OUTSIDE = 2, 3

app = typer.Typer(
    name="taxel",
    help="Touch as events: from the bytes of a tactile array to decisions that say when.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
