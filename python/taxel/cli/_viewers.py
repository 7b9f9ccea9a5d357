"""What the commands that show something in viewers of others have in common."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Annotated

import typer

from taxel._core import ProblemError
from taxel.cli._recordings import SET_HELP, encoder_of
from taxel.encode import Encoder
from taxel.live import Live, Panel, Viewer

__all__ = ["SpikesOption", "SpikesSetOption", "ToOption", "how_it_goes", "say_shown", "spikes_of", "viewers"]

ToOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="VIEWER",
        help="Show it in a viewer of others: rerun or rerun:HOST:PORT, one that you have started; foxglove or "
        "foxglove:PORT, a server on 127.0.0.1 that Foxglove opens. May be repeated.",
    ),
]
SpikesOption = Annotated[str | None, typer.Option("--encoder", help="With --to: an encoder whose spikes go too.")]
SpikesSetOption = Annotated[list[str] | None, typer.Option("--set", help=f"Of --encoder. {SET_HELP}")]

#: What is counted, in words.
_WORDS = {"curves": "times of the curves"}


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
    """Begin them; they end with the stack."""
    if not to:
        return []
    # They share one server.
    panel = shows if isinstance(shows, Panel) else shown.enter_context(Panel(shows))
    return [shown.enter_context(Viewer(panel, where, encoder=encoder, speed=speed)) for where in to]


def how_it_goes(viewer: Viewer) -> str:
    """Return one line."""
    state = viewer.state
    counts = ", ".join(f"{n:,} {_WORDS.get(what, what)}" for what, n in state.sent.items()) or "nothing yet"
    lost = f"; {state.lost['pictures']:,} pictures dropped" if state.lost.get("pictures") else ""
    return f"{viewer.place}: {counts}{lost}{f'; {state.trouble}' if state.trouble else ''}"


def say_shown(shown: Sequence[Viewer], *, quiet: bool) -> None:
    """Say what each viewer was shown, and what it was not."""
    for viewer in shown:
        state = viewer.stop()
        if not quiet:
            typer.echo(how_it_goes(viewer))
        if state.lost:
            parts = (f"{n} of {n + state.sent.get(w, 0)} {_WORDS.get(w, w)}" for w, n in state.lost.items())
            why = state.trouble or "it was not there, or too slow"
            typer.echo(f"taxel: {', '.join(parts)} did not go to {viewer.place}: {why}", err=True)
