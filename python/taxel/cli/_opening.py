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
            help="Rows, columns and pitch (mm) of the sensor, as 24x20x5, for files without them (.csv, .lsa, ROS "
            "bags), and for frames of a row of as many channels. Default: 64x64x2.67, or a larger array if events "
            "lie outside it; of a bag as its messages say. "
            "Without mm the pitch is 2.67 for events of the board, else unknown.",
        ),
    ] = None
    layout: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="What a file lacks: sensor, unit, rate, how to read a table. Default: NAME.layout.toml or layout.toml "
            "beside it.",
        ),
    ] = None
    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Open this topic of a ROS bag as frames; taxel info lists them. Repeated, with --field and --array "
            "once or as often: each is a source.",
        ),
    ] = None
    field: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="The topic's field, as left.taxels. Default: the only one with numbers."),
    ] = None
    types: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="A folder of .msg or .idl files, for a ROS bag that lacks definitions."),
    ] = None
    ros: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="The release of ROS, as humble, whose messages a bag holds undefined."),
    ] = None
    region: Annotated[
        str | None,
        typer.Option(
            metavar="A:B,C:D",
            help="Read columns A to B - 1 and rows C to D - 1 of an event camera's file, as 100:420,60:300.",
        ),
    ] = None
    bin: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65_535,
            metavar="PIXELS",
            help="So many pixels of an event camera along a side become one taxel.",
        ),
    ] = None
    count_ms: Annotated[
        float | None,
        typer.Option(
            min=0.001,
            max=3.6e6,
            metavar="MS",
            help="Read an event camera's file as frames of counts, one each so many ms (window_ms of taxel.open and of "
            "layout files; --window-ms is the tolerance of a score).",
        ),
    ] = None
    polarity: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Which events of an event camera are read: both (default), on or off."),
    ] = None
    rate_hz: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Frames a second, for recordings without times, whose frames are numbered."),
    ] = None
    limit: Annotated[
        int | None,
        typer.Option(
            metavar="BYTES",
            help="How much of a recording may be read into memory. Default: 3/4 of what is available, and at most the "
            "sizes that taxel's docs state (files.md).",
        ),
    ] = None

    @property
    def opener(self) -> TextOptions:
        """What opens files by these options."""
        from taxel.recording.text_options import TYPED, TextOptions  # noqa: PLC0415  the command line starts quickly

        names = {typed: name for name, typed in TYPED.items()}
        return TextOptions(**{names.get(typed, typed): value for typed, value in vars(self).items()})
