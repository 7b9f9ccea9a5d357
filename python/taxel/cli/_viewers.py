"""Options and output of the commands that show something in Rerun or Foxglove."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Annotated

import typer

from taxel._core import ProblemError
from taxel.cli._recordings import SET_HELP, encoder_of
from taxel.cli._say import say
from taxel.encode import Encoder
from taxel.live import Live, Panel, Viewer

__all__ = ["SpikesOption", "SpikesSetOption", "ToOption", "report_viewers", "spikes_of", "state_of", "viewers"]

ToOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="VIEWER",
        help="Show the data in another program: rerun or rerun:HOST:PORT, a viewer that you have started; foxglove or "
        "foxglove:PORT, a server on 127.0.0.1 that Foxglove connects to. May be repeated.",
    ),
]
SpikesOption = Annotated[str | None, typer.Option("--encoder", help="With --to: show the spikes of this encoder too.")]
SpikesSetOption = Annotated[list[str] | None, typer.Option("--set", help=f"Set a parameter of --encoder. {SET_HELP}")]

#: Nouns for the keys of the counts that are not their own noun.
_NAMES = {"curves": "times of the curves"}


def spikes_of(to: Sequence[str] | None, encoder: str | None, values: Sequence[str] | None) -> Encoder | None:
    """Return the encoder whose spikes are shown."""
    if not to and (encoder or values):
        raise ProblemError("--encoder and --set belong to a viewer: give --to VIEWER")
    if values and not encoder:
        raise ProblemError("--set without --encoder: give --encoder NAME")
    return encoder_of(encoder, list(values or ())) if encoder else None


def viewers(
    shown: contextlib.ExitStack,
    shows: Live | Panel,
    to: Sequence[str],
    encoder: Encoder | None,
    speed: float = 1.0,
) -> list[Viewer]:
    """Start the viewers; they end with the stack `shown`."""
    if not to:
        return []
    # All viewers share one server.
    panel = shows if isinstance(shows, Panel) else shown.enter_context(Panel(shows))
    return [shown.enter_context(Viewer(panel, where, encoder=encoder, speed=speed)) for where in to]


def state_of(viewer: Viewer) -> str:
    """Return the state of a viewer in one line."""
    state = viewer.state
    counts = ", ".join(f"{n:,} {_NAMES.get(what, what)}" for what, n in state.sent.items()) or "nothing yet"
    lost = f"; {state.lost['pictures']:,} pictures dropped" if state.lost.get("pictures") else ""
    return f"{viewer.place}: {counts}{lost}{f'; {state.trouble}' if state.trouble else ''}"


def report_viewers(shown: Sequence[Viewer], *, quiet: bool) -> None:
    """Print what each viewer has received, and what was dropped."""
    for viewer in shown:
        state = viewer.stop()
        if not quiet:
            say(state_of(viewer))
        if state.lost:
            parts = (f"{n} of {n + state.sent.get(w, 0)} {_NAMES.get(w, w)}" for w, n in state.lost.items())
            why = state.trouble or "it was not connected, or too slow"
            say(f"taxel: {', '.join(parts)} were not shown in {viewer.place}: {why}", err=True)
