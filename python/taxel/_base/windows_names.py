"""Names that no file of Windows can have."""

from __future__ import annotations

import re
from pathlib import PureWindowsPath

#: Names of devices, with any ending; Windows takes the digits of ISO 8859-1 that are raised for digits too.
_DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|(com|lpt)[1-9¹²³]) *(\.|$)", re.IGNORECASE)
_FORBIDDEN = re.compile('[<>:"|?*\x00-\x1f]')


def name_fault(path: str) -> str:
    r"""Return why Windows has no file of such a path; "" where it may have.

    Examples
    --------
    >>> name_fault("data/aux.mcap")
    "on Windows, the name 'aux.mcap' is reserved for a device"
    >>> name_fault(r"C:\data\walk.mcap")
    ''
    """
    parts = PureWindowsPath(path)
    for name in parts.parts[1:] if parts.anchor else parts.parts:
        if _DEVICE.match(name):
            return f"on Windows, the name {name!r} is reserved for a device"
        if found := _FORBIDDEN.search(name):
            return f"the name {name!r} contains {found[0]!r}, which Windows does not allow in names"
        if name != ".." and name[-1] in ". ":
            return f"the name {name!r} ends with {name[-1]!r}, which Windows does not allow"
    return ""
