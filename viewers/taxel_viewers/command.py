"""``taxel show``: a recording, or a running sensor, in Rerun."""

from __future__ import annotations

import contextlib
import re
import time
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli import App, SecondsOption, say

__all__ = ["app", "show"]

app = App()

#: Interval of the frames of a running sensor, s.
_EVERY_S = 0.1

#: What a source that is received begins with, as taxel live --source names it; one letter is a drive of Windows.
_SOURCE = re.compile(r"([^=:]+=)?[a-z+]{2,}:")


@app.command()
def show(
    shows: Annotated[
        str,
        typer.Argument(metavar="FILE|SOURCE", help="A recording; or a source, as taxel live --source names it."),
    ],
    viewer: Annotated[
        str, typer.Argument(metavar="VIEWER", help="rerun or rerun:HOST:PORT: a viewer that you have started.")
    ],
    tare: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Show values above this rest, a file that Tare.save wrote.")
    ] = None,
    seconds: SecondsOption = None,
) -> None:
    """Show a recording, or what a running sensor holds ten times a second, in Rerun.

    Example: taxel show walk.mcap rerun
    Example: taxel show board:127.0.0.1:5208 rerun
    """
    import taxel  # noqa: PLC0415  the command line starts quickly
    from taxel.live import Live  # noqa: PLC0415
    from taxel_viewers.rerun import Viewer  # noqa: PLC0415

    rest = None if tare is None else taxel.Tare.load(tare)
    if not _SOURCE.match(shows) or Path(shows).exists():
        recording = taxel.open(shows)
        Viewer(viewer, recording.title).recording(recording, rest)
        return
    shown = Viewer(viewer, shows)
    with Live(sources=shows) as live:
        say(f"listening on {live.place}; Ctrl-C ends", err=True)
        until = None if seconds is None else time.monotonic() + seconds
        with contextlib.suppress(KeyboardInterrupt):
            while not live.is_over and (until is None or time.monotonic() < until):
                # It raises what ended the reception.
                live.next(_EVERY_S)
                t_us = live.counters["board_us"]
                if t_us is not None:
                    frames = taxel.Frames(live.frame[None], [t_us], unit=live.unit, array=live.array)
                    shown.frames(frames if rest is None else rest.off(frames))
