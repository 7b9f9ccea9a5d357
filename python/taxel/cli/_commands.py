"""Commands that are loaded when they are used: ours, and those of other distributions.

Each of another distribution is an entry point of the group ``taxel.commands``.
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

import typer
from typer.core import TyperGroup

from taxel._base.messages import installing
from taxel._core import ProblemError

__all__ = ["WithAdded"]

#: Our commands, each a module of this name, and what they do, in the order of the work.
OWN = {
    "demo": "Play scenes on an emulated board, and report what was found.",
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
    "information": "Estimate how many bits labelled touches hold.",
    "bridge": "Publish a board to other computers.",
    "bench": "Compare the speed of taxel with other libraries.",
}
#: Each command of another distribution, what it does, and how it is installed.
ADDED = {"study": ("Run a study: a protocol, its parameters, a report.", installing("studies"))}


class WithAdded(TyperGroup):
    """A group of commands that loads each only when it is used, because each imports what it needs."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Name all commands, those not loaded yet among them, ours in the order of the work."""
        return [*OWN, *ADDED, *sorted({*super().list_commands(ctx)} - {*OWN, *ADDED})]

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002  click's arguments
        """Write a line a command, without loading it."""
        about = {**OWN, **{name: line for name, (line, _) in ADDED.items()}}
        more = {name: command for name, command in self.commands.items() if name not in about}
        with formatter.section("Commands"):
            formatter.write_dl([*about.items(), *((name, one.get_short_help_str(60)) for name, one in more.items())])

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; for an added one that is not installed, a command that prints how to install it."""
        if cmd_name in (*OWN, *ADDED) and cmd_name not in self.commands:
            self.add_command(_own(cmd_name) if cmd_name in OWN else _loaded(cmd_name), cmd_name)
        if cmd_name not in self.commands:
            # The error for an unknown name suggests the closest of those that are loaded.
            for name in OWN:
                self.get_command(ctx, name)
        return super().get_command(ctx, cmd_name)


def _own(name: str) -> Any:
    """Import the module of a command, which registers it with the app; a second group of the app has it at once."""
    import_module(f"taxel.cli.{name}")
    app = import_module("taxel.cli._app").app
    groups = [one.typer_instance for one in app.registered_groups if one.name == name]
    alone = groups[0] if groups else type(app)()
    if not groups:
        alone.registered_commands = [one for one in app.registered_commands if one.callback.__name__ == name]
    command = typer.main.get_command(alone)
    command.name = name
    return command


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
