"""The options that say how files are opened, one home for all commands that read files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from taxel.recording.text_options import TextOptions


@dataclass(frozen=True)
class FileOptions:
    """Hold the options that say of files what they do not hold themselves."""

    array: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROWSxCOLUMNS[xMM]",
            help="Rows, columns and pitch (mm) of the sensor, for example 24x20x5, for files that do not state them "
            "(.csv, .lsa, ROS bags), and for frames of one row that list these taxels row by row. Default: 64x64x2.67, "
            "or a larger array if events are outside it; for a bag, the size of its messages. If no pitch is given, it "
            "is 2.67 mm for events of the board, otherwise unknown.",
        ),
    ] = None
    layout: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Layout file with the facts that a recording lacks: sensor, unit, rate, columns of a table. Default: "
            "NAME.layout.toml or layout.toml beside the recording.",
        ),
    ] = None
    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Open this topic of a ROS bag as frames; taxel info lists the topics. May be repeated: each topic "
            "is a source; give --field and --array once for all topics, or once for each.",
        ),
    ] = None
    field: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="The topic's field, for example left.taxels. Default: the only field with numbers."
        ),
    ] = None
    ros: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The ROS release, for example humble, whose message definitions are used if the bag lacks them.",
        ),
    ] = None
    region: Annotated[
        str | None,
        typer.Option(
            metavar="A:B,C:D",
            help="Read columns A to B - 1 and rows C to D - 1 of an event camera's file, for example 100:420,60:300.",
        ),
    ] = None
    bin: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65_535,
            metavar="PIXELS",
            help="Side, in pixels of an event camera, of the square that becomes one taxel.",
        ),
    ] = None
    count_ms: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=3.6e6,
            metavar="MS",
            help="Read an event camera's file as frames of counts, each over this many ms. taxel.open and layout "
            "files call it window_ms; the option --window-ms of other commands has another meaning.",
        ),
    ] = None
    polarity: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which events of an event camera are read: both (default), on or off."),
    ] = None
    label_column: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Column of a table whose value becomes a label where it changes; it is no taxel."
        ),
    ] = None
    rate_hz: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Frames per second, for recordings whose frames have no times."),
    ] = None

    @property
    def opener(self) -> TextOptions:
        """Opener of files with these options."""
        from taxel.recording.text_options import TYPED, TextOptions  # noqa: PLC0415  the command line starts quickly

        names = {typed: name for name, typed in TYPED.items()}
        return TextOptions(**{names.get(typed, typed): value for typed, value in vars(self).items()})
