"""A board of another computer, whose datagrams a package beside taxel carries to this computer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any

from taxel._base.arguments import text
from taxel._core import DeviceError, ParcelFeed, ProblemError
from taxel.array import Array

__all__ = ["ParcelFeed", "RemoteBoard", "receiver_of"]


class RemoteBoard(ABC):
    """Receive a board of another computer for a `Live`: the base of those that do so over a network.

    Parameters
    ----------
    place : str
        Its address, as text.
    about : mapping
        The description of the sensor, as `Live.about` of the other computer states it.
    """

    def __init__(self, place: str, about: Mapping[str, Any]) -> None:
        self.place = text("place", place)
        #: The sensor.
        self.array = Array._from_geometry(dict(about["array"]))
        #: The contents of the board's registers, in their own units.
        self.registers = dict(about["registers"])
        #: Whether the board sends differences for intensities.
        self.differences = bool(about["differences"])
        #: Whether a `Live` receives from it.
        self.in_use = False

    @abstractmethod
    def begin(self, feed: ParcelFeed) -> None:
        """Set `in_use`, and from then pass what arrives to a pipeline, from a separate thread.

        Parameters
        ----------
        feed : ParcelFeed
            Takes parcels of datagrams (``take``), the beginning of a session of the other computer and round trips to
            its clock (``begin_session``, ``compare``), and an error that ends the pipeline (``fail``).
        """


def receiver_of(address: str) -> Any:
    """Return what makes a `RemoteBoard` of an address: the entry point of ``taxel.remotes`` that has its scheme's name.

    Parameters
    ----------
    address : str
        SCHEME:REST, as zenoh:192.168.1.5:7447/left.

    Raises
    ------
    DeviceError : no package that receives from such addresses is installed
    ProblemError : no scheme
    """
    scheme, colon, _ = text("address", address).partition(":")
    if not colon:
        raise ProblemError(
            f"address {address!r}: must be zenoh:HOST:PORT/NAME, for example zenoh:192.168.1.5:7447/left"
        )
    for point in entry_points(group="taxel.remotes", name=scheme):
        return point.load()
    raise DeviceError(
        f"{address}: no installed package receives addresses that begin with {scheme}: (zenoh: needs taxel_bridge)"
    )
