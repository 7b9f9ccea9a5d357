"""Limits of the size of files, checked before memory is allocated; errors name them, docs/files.md lists them.

Files may be damaged or malicious: a few bytes can claim 10^12 values. The limits lie well above what current
sensors record. Those of .mcap are in its reader (crates/taxel-live/src/recording/limits.rs).
"""

from __future__ import annotations

import numpy as np

from taxel._core import FormatError

__all__ = ["COLUMNS", "DESCRIPTION", "TAXELS", "TEXT", "TIME_US", "UNPACKED", "VALUE", "unpacked"]

#: Taxels of a sensor: 2048 x 2048.
TAXELS = 1 << 22
#: Columns of a table of text: a time, and 256 x 256 taxels.
COLUMNS = (1 << 16) + 1
#: Bytes of the arrays of a file, unpacked: 4 GiB.
UNPACKED = 1 << 32
#: Bytes of a text, unpacked: 1 GiB.
TEXT = 1 << 30
#: Bytes of a description in JSON: 64 MiB.
DESCRIPTION = 1 << 26
#: The largest value of a picture, which has 32 bits.
VALUE = float(np.finfo(np.float32).max)
#: The largest absolute time, us: 142 years, so that it also fits in 64 bits as ns.
TIME_US = 1 << 52


def unpacked(place: str, size: int, most: int = UNPACKED) -> None:
    """Refuse data that would unpack to more than `most` bytes.

    Raises
    ------
    FormatError : more bytes than `most`
    """
    if size > most:
        raise FormatError(f"{place}: claims {size} bytes, unpacked; at most {most} are read")
