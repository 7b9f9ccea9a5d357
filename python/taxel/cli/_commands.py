"""The commands: ours and those of other distributions, each imported only when it is used.

A command of another distribution is an entry point of the group ``taxel.commands`` that names an `App`; its line in the
list of commands is the distribution's description, for which nothing is imported.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING

from taxel._base.messages import escaped, first_line
from taxel._core import ProblemError
from taxel.cli._say import table

if TYPE_CHECKING:
    import cyclopts

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

#: What the page of help of `taxel` begins with.
ABOUT = [
    "Usage: taxel COMMAND [OPTIONS]",
    "",
    "Touch as events: from the bytes of a tactile array to detections with exact times.",
]


def plugins() -> dict[str, EntryPoint]:
    """Return the commands of other distributions by name; none has the name of ours."""
    return {point.name: point for point in sorted(entry_points(group="taxel.commands")) if point.name not in OWN}


def listing() -> list[str]:
    """Return a line a command, without importing it: ours first, in the order of the work."""
    options = [("--version", "Print the version and end."), ("--help, -h", "Show this page and end.")]
    commands = [*OWN.items(), *((name, _description(point)) for name, point in plugins().items())]
    begin = "Begin with: taxel demo. docs/start.md in the repository shows which page to read for your data."
    return [*table("Options", options), *table("Commands", commands), "", begin]


def nearest(name: str) -> str:
    """Return the question for the commands of about this name, if there are any."""
    near = ", ".join(map(repr, get_close_matches(name, [*OWN, *plugins()])))
    return f". Did you mean {near}?" * bool(near)


def command(name: str) -> cyclopts.App | None:
    """Import a command; None where there is none of this name.

    Raises
    ------
    ProblemError : a command of another distribution that cannot be imported
    """
    if name in OWN:
        own: cyclopts.App = import_module(f"taxel.cli.{name}").app
        return own
    point = plugins().get(name)
    return None if point is None else _import(point)


def _description(point: EntryPoint) -> str:
    return escaped((point.dist and point.dist.metadata["Summary"]) or "")


def _import(point: EntryPoint) -> cyclopts.App:
    import cyclopts  # noqa: PLC0415  the list of commands is there at once

    try:
        app = point.load()
        if not isinstance(app, cyclopts.App):
            raise TypeError(f"must be a cyclopts.App, not a {type(app).__name__}")
        return app
    except Exception as error:  # another distribution's code may raise any error
        source = f" of {point.dist.name} {point.dist.version}" if point.dist else ""
        raise ProblemError(
            f"taxel {point.name}: the command {point.value}{source} could not be loaded: {type(error).__name__}: "
            f"{first_line(error)}"
        ) from error
