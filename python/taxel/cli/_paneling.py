"""Options and output of the commands that show the panel."""

from __future__ import annotations

import ipaddress
import webbrowser
from typing import Annotated

from cyclopts import Parameter

from taxel.cli.app import Limits
from taxel.cli.console import Console
from taxel.panel import Panel

PanelHostOption = Annotated[
    str,
    Parameter(
        help="The address of this machine on which the panel listens; a warning is printed for every address except "
        "loopback."
    ),
]
PanelPortOption = Annotated[
    int, Parameter(validator=Limits(0, 65_535), help="The panel's TCP port; 0 finds a free one.")
]
OpenOption = Annotated[bool, Parameter(name="--open", negative="--no-open", help="Open the panel in a browser.")]


def announce(panel: Panel, opens: bool, console: Console) -> None:
    """Print the panel's address, warn if other machines can reach it, and open it."""
    host = panel.address[0]
    if not ipaddress.ip_address(host).is_loopback:
        console.print(
            f"warning: the panel listens on {host}: everyone who has its address with the token can see the board "
            f"and set registers, and the connection is not encrypted",
        )
    console.print(f"panel: {panel.url}", highlight=False)
    if opens and not webbrowser.open(panel.url):
        console.print("no browser could be opened here: open the address yourself")
