"""``taxel bridge``: carry a board's datagrams to other computers."""

from __future__ import annotations

from typing import Annotated

import typer

from taxel.cli import App, SecondsOption, say
from taxel.live import PORT
from taxel_bridge.carrying import PLACE, Bridge

__all__ = ["app", "publish", "receive"]

app = App(no_args_is_help=True, help="Carry a board's datagrams to other computers, over Zenoh.")

NameOption = Annotated[str, typer.Option(help="The board's name, the same at both ends: letters, digits, - _ or .")]
ConnectOption = Annotated[
    list[str] | None, typer.Option(metavar="tcp/HOST:PORT", help="An end, or a Zenoh router, to connect to.")
]
ListenOption = Annotated[
    list[str] | None, typer.Option(metavar="tcp/HOST:PORT", help="An address of this computer to listen on.")
]


@app.callback()
def _bridge() -> None:
    """Carry a board's datagrams to other computers, over Zenoh."""


def _say(line: str) -> None:
    say(line, err=True)


@app.command(short_help="Publish a board that sends to this computer.")
def publish(
    host: Annotated[str, typer.Option(help="The address of this machine to listen on for the board.")] = "0.0.0.0",
    port: Annotated[int, typer.Option(min=0, max=65_535, help="The UDP port that the board sends to.")] = PORT,
    name: NameOption = "board",
    listen: ListenOption = None,
    connect: ConnectOption = None,
    seconds: SecondsOption = None,
) -> None:
    """Publish what a board sends to this computer, until Ctrl-C.

    Without --listen and --connect only this computer can receive it. What is published is neither encrypted nor
    protected by a password.

    Example: taxel bridge publish --name left --listen tcp/192.168.1.5:7447
    """
    places = listen or ([] if connect else [PLACE])
    bridge = Bridge(name, _say, listen=places, connect=connect or [])
    say(f"{bridge.publish(host, port, seconds):,} datagrams published")


@app.command(short_help="Receive a board of another computer.")
def receive(
    port: Annotated[int, typer.Option(min=1, max=65_535, help="The UDP port of this computer to send to.")] = PORT,
    name: NameOption = "board",
    connect: ConnectOption = None,
    listen: ListenOption = None,
    seconds: SecondsOption = None,
) -> None:
    """Send what a board's computer publishes to a UDP port of this one, until Ctrl-C.

    taxel record and taxel live receive it there as from a board; times of arrival are those of this computer.

    Example: taxel bridge receive --name left --connect tcp/192.168.1.5:7447
    """
    places = connect or ([] if listen else [PLACE])
    bridge = Bridge(name, _say, listen=listen or [], connect=places)
    say(f"{bridge.receive(port, seconds):,} datagrams received")
