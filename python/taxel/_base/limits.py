"""What a file may hold at most: checked before memory is allocated, named in the error, listed in docs/files.md.

Files may be damaged, or made to harm: a few bytes can claim 10^12 values. The limits lie well above what
sensors of today record. Those of .mcap stand beside its reader (crates/taxel-live/src/recording/limits.rs).
"""

from __future__ import annotations

import numpy as np

from taxel._core import FormatError

__all__ = ["COLUMNS", "DESCRIPTION", "TAXELS", "TEXT", "TIME_US", "UNPACKED", "VALUE", "unpacked"]

#: Taxels of a sensor: 2048 x 2048.
TAXELS = 1 << 22
#: Columns of a table of text: a time, and 256 x 256 taxels.
COLUMNS = (1 << 16) + 1
#: What the arrays of a file may hold, unpacked: 4 GiB.
UNPACKED = 1 << 32
#: Of a text, unpacked: 1 GiB.
TEXT = 1 << 30
#: Of a description in JSON: 64 MiB.
DESCRIPTION = 1 << 26
#: Of a value of a picture, which has 32 bits.
VALUE = float(np.finfo(np.float32).max)
#: Of times, us, on both sides of 0: 142 years, so that ns in 64 bits hold them too.
TIME_US = 1 << 52


def unpacked(place: str, size: int, most: int = UNPACKED) -> None:
    """Refuse what would unpack to more than a file may hold.

    Raises
    ------
    FormatError : more bytes than `most`
    """
    if size > most:
        raise FormatError(f"{place}: claims {size} bytes, unpacked; at most {most} are read")
