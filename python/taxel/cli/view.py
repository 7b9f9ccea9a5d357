"""``taxel view``: a recording in the panel."""

from __future__ import annotations

import contextlib
import json
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.cli._app import app
from taxel.cli._paneling import OpenOption, PanelHostOption, PanelPortOption, announce
from taxel.live import Panel

__all__ = ["view"]

#: How often the end is looked for, s.
_LOOK_EVERY = 0.1


@app.command()
def view(
    recording: Annotated[
        Path, typer.Argument(help="A recording: .mcap or .lsa. Others of its folder can be opened too.")
    ],
    panel_host: PanelHostOption = "127.0.0.1",
    panel_port: PanelPortOption = 0,
    opens: OpenOption = True,
    seconds: Annotated[float | None, typer.Option(min=0.0, help="End after so long; else with Ctrl-C.")] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the panel's address as JSON, and nothing else.")
    ] = False,
) -> None:
    """Show a recording in a browser: play, scrub, label, cut.

    Labels are kept beside it, in NAME.notes.csv; the recording itself is never changed.

    Example: taxel view walk.mcap
    """
    console = Console(stderr=True, quiet=as_json)
    with Panel(recording, host=panel_host, port=panel_port) as panel:
        if as_json:
            typer.echo(json.dumps({"url": panel.url, "token": panel.token}))
        announce(panel, opens, console)
        console.print("Ctrl-C ends")
        until = None if seconds is None else time.monotonic() + seconds
        with contextlib.suppress(KeyboardInterrupt):
            while until is None or time.monotonic() < until:
                time.sleep(_LOOK_EVERY)
