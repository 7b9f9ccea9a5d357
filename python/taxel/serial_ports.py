"""The serial ports of the system."""

from __future__ import annotations

from dataclasses import dataclass

from taxel import _core

__all__ = ["Port", "ports"]


@dataclass(frozen=True)
class Port:
    """Name a serial port of the system.

    Parameters
    ----------
    place : str
        For example "COM3" or "/dev/ttyACM0", for `taxel.device.Cable` and `taxel.device.Device`.
    kind : {"usb", "pci", "bluetooth", "other"}
    product, maker, serial : str or None
        The description of a USB device.
    usb : (int, int) or None
        Vendor and product numbers of a USB device.

    Examples
    --------
    >>> Port("COM3", "usb", product="FT232R").place
    'COM3'
    """

    place: str
    kind: str
    product: str | None = None
    maker: str | None = None
    serial: str | None = None
    usb: tuple[int, int] | None = None


def ports() -> list[Port]:
    """Return the serial ports of the system, USB devices first.

    Returns
    -------
    list of Port

    Raises
    ------
    OSError : the system does not list its ports

    Examples
    --------
    >>> all(port.place for port in ports())
    True
    """
    return [Port(**port) for port in _core.serial_ports()]
