"""Limits of what files hold, and of the memory that their arrays take."""

from __future__ import annotations

from os import PathLike

import numpy as np
import psutil

from taxel._base.errors import unreadable

#: Taxels of a sensor: 2048 x 2048.
TAXELS = 1 << 22
#: Columns of a table of text: a time, and 256 x 256 taxels.
COLUMNS = (1 << 16) + 1
#: The largest value of a frame, which has 32 bits.
VALUE = float(np.finfo(np.float32).max)
#: The largest absolute time, us: 142 years, so that it also fits in 64 bits as ns.
TIME_US = 1 << 52

#: Up to this many bytes are read without a look at the available memory, which takes longer than to read them.
_SMALL = 1 << 24


def check_memory(path: str | PathLike[str], size: int, subject: str = "") -> None:
    """Refuse an array of a file that takes more bytes than there is memory for; `subject` begins the error.

    Raises
    ------
    FormatError : it is larger than the memory that is available (names both sizes)
    """
    if size > _SMALL and size > (most := available()):
        raise unreadable(f"{subject}would take {size} bytes of memory; {most} are available", path)


def available() -> int:
    """Return how many bytes of memory the machine has free."""
    return int(psutil.virtual_memory().available)
