"""``taxel bridge``: carry a board's datagrams to other computers."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from taxel.cli.app import App, SecondsOption, say
from taxel.live import PORT
from taxel_bridge.carrying import PLACE, Bridge

__all__ = ["app", "publish", "receive"]

app = App(name="bridge", help="Carry a board's datagrams to other computers, over Zenoh.")

NameOption = Annotated[str, Parameter(help="The board's name, the same at both ends: letters, digits, - _ or .")]
ConnectOption = Annotated[
    list[str] | None, Parameter(metavar="tcp/HOST:PORT", help="An end, or a Zenoh router, to connect to.")
]
ListenOption = Annotated[
    list[str] | None, Parameter(metavar="tcp/HOST:PORT", help="An address of this computer to listen on.")
]


def _say(line: str) -> None:
    say(line, err=True)


@app.command
def publish(
    *,
    host: str = "0.0.0.0",
    port: int = PORT,
    name: NameOption = "board",
    listen: ListenOption = None,
    connect: ConnectOption = None,
    seconds: SecondsOption = None,
) -> None:
    """Publish what a board sends to this computer, until Ctrl-C.

    Without --listen and --connect only this computer can receive it. What is published is neither encrypted nor
    protected by a password.

    Example: taxel bridge publish --name left --listen tcp/192.168.1.5:7447

    Parameters
    ----------
    host
        The address of this machine to listen on for the board.
    port
        The UDP port that the board sends to.
    """
    places = listen or ([] if connect else [PLACE])
    bridge = Bridge(name, _say, listen=places, connect=connect or [])
    say(f"{bridge.publish(host, port, seconds):,} datagrams published")


@app.command
def receive(
    *,
    port: int = PORT,
    name: NameOption = "board",
    connect: ConnectOption = None,
    listen: ListenOption = None,
    seconds: SecondsOption = None,
) -> None:
    """Send what a board's computer publishes to a UDP port of this one, until Ctrl-C.

    taxel record and taxel live receive it there as from a board; times of arrival are those of this computer.

    Example: taxel bridge receive --name left --connect tcp/192.168.1.5:7447

    Parameters
    ----------
    port
        The UDP port of this computer to send to.
    """
    places = connect or ([] if listen else [PLACE])
    bridge = Bridge(name, _say, listen=listen or [], connect=places)
    say(f"{bridge.receive(port, seconds):,} datagrams received")
