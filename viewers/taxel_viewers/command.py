"""``taxel show``: a board or a recording in Rerun or Foxglove."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from taxel.cli import SET_HELP, App, SecondsOption, assignments, say

__all__ = ["app", "show"]

app = App()

#: How often the viewer's state is read, s.
_CHECK_EVERY_S = 0.1

#: Nouns for the keys of the counts that are not their own noun.
_NAMES = {"curves": "times of the curves"}


@app.command()
def show(
    shows: Annotated[
        str,
        typer.Argument(
            metavar="ADDRESS|FILE",
            help="The panel's address, in quotes, as taxel live --panel and taxel view print it. Or a recording, which "
            "is played once.",
        ),
    ],
    viewer: Annotated[
        str,
        typer.Argument(
            metavar="VIEWER",
            help="rerun or rerun:HOST:PORT: a viewer that you have started. foxglove or foxglove:PORT: a server on "
            "127.0.0.1, to which Foxglove connects.",
        ),
    ],
    encoder: Annotated[str | None, typer.Option(help="Show the spikes of this encoder too.")] = None,
    values: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help=f"With --encoder: {SET_HELP}")
    ] = None,
    tare: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="With --encoder: the rest of the taxels, a file that Tare.save wrote."),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0.001, max=100.0, help="Playback speed of a recording; 0.1 is ten times slower.")
    ] = 1.0,
    seconds: SecondsOption = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the viewer's place and, at the end, its counts as JSON.")
    ] = False,
) -> None:
    """Show a board or a recording in Rerun or Foxglove, beside the panel or without it.

    A viewer that is missing, slow or stuck loses frames, which are counted; it never delays what is received.

    Example: taxel show 'http://127.0.0.1:8080/#token=...' rerun --encoder fa1
    Example: taxel show walk.mcap foxglove --speed 0.1
    """
    from taxel import ProblemError, Tare  # noqa: PLC0415  the command line starts quickly
    from taxel.encode import Encoder  # noqa: PLC0415
    from taxel_viewers.viewer import Viewer, Viewing  # noqa: PLC0415

    if encoder is None and (values or tare is not None):
        raise ProblemError("--set and --tare need an encoder: give --encoder NAME")
    # The libraries' own messages are not for the user.
    os.environ.setdefault("RUST_LOG", "off")
    spikes: Encoder | None = None
    if encoder is not None:
        spikes = Encoder.from_json(json.dumps({**assignments(values or []), "name": encoder}, default=str))
        spikes = spikes if tare is None else spikes.with_tare(Tare.load(tare))
    with Viewer(shows, viewer, encoder=spikes, speed=speed) as shown:
        say(json.dumps({"place": shown.place}) if as_json else f"{shown.place}; Ctrl-C ends")
        until, before = None if seconds is None else time.monotonic() + seconds, Viewing()
        with contextlib.suppress(KeyboardInterrupt):
            while until is None or time.monotonic() < until:
                time.sleep(_CHECK_EVERY_S)
                state = shown.state
                if state.trouble and state.trouble != before.trouble:
                    say(f"taxel: {shown.place}: {state.trouble}", err=True)
                if state.there and not before.there:
                    say(f"taxel: {shown.place}: connected", err=True)
                if state.over and not before.over:
                    say(f"taxel: shown to its end in {shown.place}", err=True)
                before = state
        last = shown.stop()
    if as_json:
        say(json.dumps(asdict(last)))
    else:
        say(f"{shown.place}: " + (", ".join(f"{n:,} {_NAMES.get(w, w)}" for w, n in last.sent.items()) or "nothing"))
    if last.lost:
        parts = (f"{n} of {n + last.sent.get(w, 0)} {_NAMES.get(w, w)}" for w, n in last.lost.items())
        why = last.trouble or "the viewer was not connected, or too slow"
        say(f"taxel: {', '.join(parts)} were not shown in {shown.place}: {why}", err=True)
    if not shown.reads:
        # The clean-up of its library would wait for the viewer without end.
        sys.stdout.flush()
        os._exit(0)
