"""The network interfaces of this machine."""

from __future__ import annotations

import socket
from typing import NamedTuple

import psutil


class Interface(NamedTuple):
    """Describe an IPv4 address of a network interface: a name, whether it is up, and its speed, Mbit/s."""

    name: str
    address: str
    up: bool
    speed: int


def interfaces() -> list[Interface]:
    """Return the IPv4 addresses of all interfaces."""
    states = psutil.net_if_stats()
    return [
        Interface(name, address.address, states[name].isup, states[name].speed)
        for name, addresses in psutil.net_if_addrs().items()
        for address in addresses
        if address.family == socket.AF_INET and name in states
    ]
