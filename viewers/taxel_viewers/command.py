"""``taxel show``: a recording, or a running sensor, in Rerun."""

from __future__ import annotations

import contextlib
import re
import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from taxel.cli.app import App, SecondsOption, say

__all__ = ["app", "show"]

app = App(name="show")

#: Interval of the frames of a running sensor, s.
_EVERY_S = 0.1

#: What a source that is received begins with, as taxel live --source names it; one letter is a drive of Windows.
_SOURCE = re.compile(r"([^=:]+=)?[a-z+]{2,}:")


@app.default
def show(
    shows: str,
    viewer: str,
    /,
    *,
    tare: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    seconds: SecondsOption = None,
) -> None:
    """Show a recording, or what a running sensor holds ten times a second, in Rerun.

    Example: taxel show walk.mcap rerun
    Example: taxel show board:127.0.0.1:5208 rerun

    Parameters
    ----------
    shows
        A recording; or a source, as taxel live --source names it.
    viewer
        A viewer that you have started: rerun, on port 9876 of this computer, or rerun:HOST:PORT.
    tare
        Show values above this rest, a file that Tare.save wrote.
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
