"""Commands of other distributions, each an entry point of the group ``taxel.commands``."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

import typer
from typer.core import TyperGroup

from taxel._core import ProblemError

__all__ = ["WithAdded"]

#: Each such command, what it does, and how it is installed.
ADDED = {"study": ("Run a study: a protocol, its parameters, a report.", 'pip install "taxel[studies]"')}


class WithAdded(TyperGroup):
    """A group of commands that loads an added one only when it is used, because reading entry points takes a while."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Name all commands, the added ones among them."""
        return sorted({*super().list_commands(ctx), *ADDED})

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; for an added one that is not installed, a command that prints how to install it."""
        if cmd_name in ADDED and cmd_name not in self.commands:
            self.add_command(_loaded(cmd_name), cmd_name)
        return super().get_command(ctx, cmd_name)


def _loaded(name: str) -> Any:
    for point in entry_points(group="taxel.commands", name=name):
        return typer.main.get_command(point.load())
    about, install = ADDED[name]
    missing = typer.Typer(rich_markup_mode=None)

    @missing.command(help=f"{about} It is not installed: {install}", context_settings={"ignore_unknown_options": True})
    def _(arguments: list[str] | None = typer.Argument(None, hidden=True)) -> None:  # noqa: B008  typer's way
        del arguments
        raise ProblemError(f"taxel {name} is not installed: {install}")

    return typer.main.get_command(missing)
