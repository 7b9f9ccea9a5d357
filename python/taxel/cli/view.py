"""``taxel view``: a recording in the panel."""

from __future__ import annotations

import contextlib
import json
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel._core import ProblemError
from taxel.cli._app import SecondsOption, app
from taxel.cli._paneling import PanelHostOption, PanelPortOption, announce
from taxel.cli._viewers import SpikesOption, SpikesSetOption, ToOption, report_viewers, spikes_of, state_of, viewers
from taxel.live import Panel

__all__ = ["view"]

#: How often the viewers' states are read, s.
_CHECK_EVERY = 0.1


@app.command()
def view(
    recording: Annotated[
        Path,
        typer.Argument(
            help="A recording, a file of another maker, or a folder. The page can open others in its folder."
        ),
    ],
    panel_host: PanelHostOption = "127.0.0.1",
    panel_port: PanelPortOption = 0,
    opens: Annotated[
        bool | None, typer.Option("--open/--no-open", help="Open the panel in a browser. Default: open, with --to not.")
    ] = None,
    to: ToOption = None,
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.001, max=100.0, help="With --to: playback speed; 0.1 is ten times slower than real time. Default: 1."
        ),
    ] = None,
    encoder: SpikesOption = None,
    values: SpikesSetOption = None,
    seconds: SecondsOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the panel's address as JSON, and nothing else.")
    ] = False,
) -> None:
    """Show a recording in a browser: play, scrub, label, cut. With --to, play it once in Rerun or Foxglove.

    Labels are saved beside the recording, in NAME.notes.csv; the recording itself is never changed.

    Example: taxel view walk.mcap
    Example: taxel view walk.mcap --to rerun --speed 0.1 --encoder fa1
    """
    spikes = spikes_of(to, encoder, values)
    if speed is not None and not to:
        raise ProblemError("--speed belongs to a viewer: give --to VIEWER; the panel has its own")
    console = Console(stderr=True, quiet=as_json)
    with contextlib.ExitStack() as shown:
        panel = shown.enter_context(Panel(recording, host=panel_host, port=panel_port))
        external = viewers(shown, panel, to or (), spikes, 1.0 if speed is None else speed)
        if as_json:
            where = {"to": [viewer.place for viewer in external]} if external else {}
            typer.echo(json.dumps({"url": panel.url, "token": panel.token, **where}))
        announce(panel, not to if opens is None else opens, console)
        console.print("Ctrl-C ends")
        reported = dict.fromkeys(external, "")
        until = None if seconds is None else time.monotonic() + seconds
        with contextlib.suppress(KeyboardInterrupt):
            while until is None or time.monotonic() < until:
                time.sleep(_CHECK_EVERY)
                for viewer, trouble in list(reported.items()):
                    state = viewer.state
                    if state.trouble and state.trouble != trouble:
                        reported[viewer] = state.trouble
                        console.print(f"{viewer.place}: {state.trouble}", soft_wrap=True)
                    if state.over:
                        del reported[viewer]
                        console.print(f"shown to its end in {state_of(viewer)}", soft_wrap=True)
    report_viewers(external, quiet=as_json)
