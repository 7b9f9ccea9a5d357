"""``taxel bridge``: publish a board to other computers."""

from __future__ import annotations

import contextlib
import ipaddress
import json
from dataclasses import asdict
from typing import Annotated, Any

import typer
from rich.console import Group
from rich.live import Live as Display
from rich.text import Text

from taxel import ProblemError
from taxel.cli import App, SecondsOption, say
from taxel.cli.board import REDRAW_S, counters_table, exit_code, for_live, with_live_options
from taxel.cli.console import Console
from taxel.live import Live
from taxel_bridge.bridge import PLACE, Bridge

__all__ = ["app", "bridge"]

app = App()


@app.command()
@with_live_options("live", "port", "host", "array", "registers", "differences", "readout", "tare", "record")
def bridge(
    options: dict[str, Any],
    name: Annotated[str, typer.Option(help="The board's name: letters, digits, - _ or .")] = "board",
    listen: Annotated[
        list[str], typer.Option(help="HOST:PORT (TCP) of this computer to listen on; may be repeated.")
    ] = [PLACE],  # noqa: B006  typer reads it and never writes
    connect: Annotated[
        list[str] | None, typer.Option(help="HOST:PORT of a Zenoh router to connect to; may be repeated.")
    ] = None,
    seconds: SecondsOption = None,
    clock_ahead: Annotated[
        float, typer.Option(help="For tests: publish times that are ahead of this computer's clock by this, s.")
    ] = 0.0,
    clock_drift: Annotated[
        float, typer.Option(help="For tests: publish times of a clock that runs faster by this, parts per million.")
    ] = 0.0,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the counts at the end as JSON, and nothing else.")
    ] = False,
) -> None:
    """Publish a board to other computers: its datagrams, ten frames a second, and detections.

    On the other computer, taxel live and taxel record receive the board with --remote zenoh:HOST:PORT/NAME. The bridge
    listens on loopback unless --listen names another address; what it publishes is neither encrypted nor protected by a
    password. It needs the wheel taxel_zenoh (make bridge). Exit code 3: nothing was received, or something was lost
    here after it had arrived.

    Example: taxel bridge --port 5208 --name left --listen 192.168.1.5:7447
    """
    if options["readout"] is None and options["tare"] is not None:
        raise ProblemError("--tare needs a readout: give --readout FILE")
    console = Console(stderr=True, quiet=as_json)
    with (
        Live(**for_live(options)) as live,
        Bridge(
            live,
            name=name,
            listen=listen,
            connect=connect or (),
            clock_ahead_s=clock_ahead,
            clock_drift_ppm=clock_drift,
        ) as published,
    ):
        for place in listen:
            _announce(place, name, console)
        console.print(f"listening on {live.place}; Ctrl-C ends")
        with contextlib.suppress(KeyboardInterrupt):
            _watch(live, published, seconds, console)
        # Everything that was received is published before the end is announced.
        summary = live.stop()
        counts = published.counts
    if as_json:
        path = None if summary.path is None else str(summary.path)
        say(
            json.dumps(
                asdict(summary) | {"path": path, "published": counts, "verdict_details": summary.verdict.to_dict()}
            )
        )
    else:
        sent = counts["block"]["sent"] + counts["drop"]["sent"]
        say(f"datagrams received: {summary.counters['capture']['datagrams']}, parcels published: {sent}")
        say(summary.verdict)
    raise typer.Exit(exit_code(summary, live.array))


def _announce(place: str, name: str, console: Console) -> None:
    """Print the address for receivers, and warn if other computers can reach it."""
    host = place.rpartition(":")[0].strip("[]")
    try:
        loopback = ipaddress.ip_address(host).is_loopback
    except ValueError:
        loopback = host == "localhost"
    if not loopback:
        console.print(
            f"warning: every computer that reaches {place} can receive the board, and the connection is not encrypted: "
            "use it on a network that you trust, or through a tunnel",
        )
    if host in ("0.0.0.0", "::"):
        # These stand for all addresses of this computer; other computers need one of them.
        place = f"HOST:{place.rpartition(':')[2]}"
        name += ", HOST being this computer's name or address"
    console.print(f"receive it with --remote zenoh:{place}/{name}", highlight=False)


def _watch(live: Live, published: Bridge, seconds: float | None, console: Console) -> None:
    """Show what is received and which receivers are connected, until the time is over."""
    with Display(console=console, refresh_per_second=1 / REDRAW_S, transient=True) as display:
        before = live.counters
        while seconds is None or before["seconds"] < seconds:
            detection = live.next(REDRAW_S)
            while detection is not None:
                detection = live.next(0.0)
            now = live.counters
            if now["seconds"] - before["seconds"] >= REDRAW_S:
                display.update(Group(counters_table(before, now), Text(_receivers(published.counts))))
                before = now


def _receivers(counts: dict[str, dict[str, Any]]) -> str:
    connected = []
    for what, row in (("recorders", counts["block"]), ("viewers", counts["drop"])):
        if row["subscribed"]:
            connected.append(f"{what} connected; parcels: {row['sent']:,} sent, {row['dropped']:,} dropped")
    return "; ".join(connected) or "no receiver is connected"
