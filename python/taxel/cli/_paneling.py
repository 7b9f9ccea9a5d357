"""What the commands that show the panel have in common."""

from __future__ import annotations

import ipaddress
import webbrowser
from typing import Annotated

import typer
from rich.console import Console

from taxel.live import Panel

__all__ = ["OpenOption", "PanelHostOption", "PanelPortOption", "announce"]

PanelHostOption = Annotated[
    str,
    typer.Option(help="The address of this machine on which the panel listens; others than loopback are warned of."),
]
PanelPortOption = Annotated[int, typer.Option(min=0, max=65_535, help="The panel's TCP port; 0 finds a free one.")]
OpenOption = Annotated[bool, typer.Option("--open/--no-open", help="Open the panel in a browser.")]


def announce(panel: Panel, opens: bool, console: Console) -> None:
    """Say where the panel is, warn where others can reach it, and open it."""
    host = panel.address[0]
    if not ipaddress.ip_address(host).is_loopback:
        console.print(
            f"warning: the panel listens on {host}: whoever learns its address with the token can look and set "
            "registers, and the way there is not encrypted",
            soft_wrap=True,
        )
    console.print(f"panel: {panel.url}", soft_wrap=True, highlight=False)
    if opens and not webbrowser.open(panel.url):
        console.print("no browser could be opened here: open the address yourself")
