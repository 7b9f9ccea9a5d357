"""The commands: ours and those of other distributions, each imported only when it is used.

A command of another distribution is an entry point of the group ``taxel.commands`` that names a `typer.Typer`; its line
in the list of commands is the distribution's description, for which nothing is imported.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer
from typer.core import TyperGroup

from taxel._base.messages import escaped, first_line
from taxel._core import ProblemError

#: Our commands, each a module of this name, and what they do, in the order of the work.
OWN = {
    "demo": "Play scenes on an emulated board, and report detections.",
    "emulate": "Emulate a board that sends its events by UDP.",
    "simulate": "Simulate a scene on the emulated board, without waiting.",
    "device": "Find a board on its serial line; set and read registers.",
    "record": "Record what a board sends, and report what was lost.",
    "live": "Print what a readout detects, live; show the board.",
    "view": "Show a recording in a browser: play, label, cut.",
    "info": "Summarise a recording: contents, losses, rates, faults.",
    "calibrate": "Calibrate readings to N or kPa by a known load.",
    "convert": "Convert recordings to another format.",
    "cut": "Cut a recording by time, by region or by label.",
    "merge": "Merge recordings: by time, side by side, or by label.",
    "encode": "Encode a recording as spike trains.",
    "train": "Train neurons to detect labelled events.",
    "detect": "Detect events in recordings by a readout; score them.",
    "export": "Write a readout for other simulators and for chips.",
    "information": "Estimate how many bits of information labelled touches give.",
}


def plugins() -> dict[str, EntryPoint]:
    """Return the commands of other distributions by name; none has the name of ours."""
    return {point.name: point for point in sorted(entry_points(group="taxel.commands")) if point.name not in OWN}


class Commands(TyperGroup):
    """All commands; each imports what it needs when it is used."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002  click's argument
        """Name all commands, ours first, in the order of the work."""
        return [*OWN, *plugins()]

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002  click's arguments
        """Write a line a command, without importing it."""
        with formatter.section("Commands"):
            formatter.write_dl([*OWN.items(), *((name, _description(point)) for name, point in plugins().items())])

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Import the command that was typed, and call what waits for that, which is the context's object.

        The error for an unknown name suggests close ones, without importing any.
        """
        typed = args[0]
        if typed not in OWN and typed not in (names := self.list_commands(ctx)):
            near = ", ".join(map(repr, get_close_matches(typed, names)))
            ctx.fail(f"No such command {typed!r}." + f" Did you mean {near}?" * bool(near))
        resolved = super().resolve_command(ctx, args)
        if ctx.obj is not None:
            ctx.obj()
        return resolved

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002  click's argument
        """Import a command.

        Raises
        ------
        ProblemError : a command of another distribution that cannot be imported
        """
        if cmd_name in OWN:
            command = typer.main.get_command(import_module(f"taxel.cli.{cmd_name}").app)
        elif point := plugins().get(cmd_name):
            command = _import(point)
        else:
            return None
        command.name = cmd_name
        return command


def _description(point: EntryPoint) -> str:
    return escaped((point.dist and point.dist.metadata["Summary"]) or "")


def _import(point: EntryPoint) -> Any:
    try:
        return typer.main.get_command(point.load())
    except Exception as error:  # another distribution's code may raise any error
        source = f" of {point.dist.name} {point.dist.version}" if point.dist else ""
        raise ProblemError(
            f"taxel {point.name}: the command {point.value}{source} could not be loaded: {type(error).__name__}: "
            f"{first_line(error)}"
        ) from error
