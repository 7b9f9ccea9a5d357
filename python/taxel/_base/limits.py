"""Limits of file sizes, checked before memory is taken; errors name them, docs/files.md lists those that users meet.

Files may be damaged or malicious: a few bytes can claim 10^12 values. The limits are well above what current sensors
record. Those of .mcap are in its reader (crates/taxel-live/src/recording/limits.rs).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import psutil

from taxel._base.errors import helped
from taxel._core import FormatError

#: Taxels of a sensor: 2048 x 2048.
TAXELS = 1 << 22
#: Columns of a table of text: a time, and 256 x 256 taxels.
COLUMNS = (1 << 16) + 1
#: Bytes of a line of text: 4 MiB, 64 for each column.
LINE = 1 << 22
#: Bytes of the arrays of a file, unpacked: 4 GiB.
UNPACKED = 1 << 32
#: Bytes of a text, unpacked: 1 GiB.
TEXT = 1 << 30
#: Bytes of a chunk of a ROS bag, unpacked: 64 MiB, as of a .mcap.
CHUNK = 1 << 26
#: Bytes of a description in JSON: 64 MiB.
DESCRIPTION = 1 << 26
#: Bytes that the description of a recording takes, read: 192 MiB.
ABOUT = 192 << 20
#: Characters of a unit.
UNIT = 256
#: Markers of a recording, each of which is a tuple.
MARKERS = 1 << 18
#: The largest value of a frame, which has 32 bits.
VALUE = float(np.finfo(np.float32).max)
#: The largest absolute time, us: 142 years, so that it also fits in 64 bits as ns.
TIME_US = 1 << 52

#: Up to this many bytes are read without a look at the available memory, which takes longer than to read them.
_SMALL = 1 << 24


@dataclass
class _Room:
    """Say how much memory an opening may take.

    Parameters
    ----------
    limit : int, bytes, optional
        What the caller allows.
    most : int, bytes
        Three quarters of what was available when it began.
    kept : int, bytes
        The arrays of the files that it has read so far.
    """

    limit: int | None
    most: int
    kept: int = 0


_room: ContextVar[_Room | None] = ContextVar("room", default=None)


@contextmanager
def opening(limit: int | None = None) -> Iterator[None]:
    """Count what is read within this context as one opening, of a file or a folder.

    Parameters
    ----------
    limit : int, bytes, optional
        How much may be read; default: three quarters of what is available now, and at most the sizes of docs/files.md.
    """
    if limit is None and _room.get() is not None:
        yield
        return
    before = _room.set(_Room(limit, _most()))
    try:
        yield
    finally:
        _room.reset(before)


def given() -> int | None:
    """Return the limit that the caller of the current opening gave, bytes."""
    room = _room.get()
    return None if room is None else room.limit


def keep(size: int) -> None:
    """Count arrays of a file that stay in memory while the opening reads further files."""
    room = _room.get()
    if room is not None:
        room.kept += size


def memory(limit: int | None) -> int:
    """Return how many bytes may be read now, within a limit that a caller gave."""
    if limit is not None:
        return limit
    room = _room.get()
    return min(UNPACKED, _most() if room is None else room.most)


def unpacked(location: str, size: int, most: int = UNPACKED) -> None:
    """Refuse data that would take more bytes in memory than may be read.

    Parameters
    ----------
    location : str
        For the error.
    size : int, bytes
        What the data would take in memory.
    most : int, bytes
        How much is read of such data where the caller of the opening gave no limit.

    Raises
    ------
    FormatError : more bytes than `most`, than the limit of the opening, or than three quarters of what is available
        (names both sizes)
    """
    room = _room.get()
    limit, claimed = (None, size) if room is None else (room.limit, size + room.kept)
    if limit is not None:
        bound, why = limit, ""
    elif size > most:
        claimed, bound, why = size, most, ""
    elif claimed <= _SMALL:
        return
    else:
        bound, why = _most() if room is None else room.most, " (3/4 of the memory that is available)"
    if claimed > bound:
        error = FormatError(f"{location}: would take {claimed} bytes of memory; at most {bound} are read{why}")
        # What is read outside an opening has no such option.
        raise error if room is None else helped(error, "limit", "larger")


def _most() -> int:
    return available() * 3 // 4


def available(root: Path = Path("/")) -> int:
    """Return how many bytes this process can still take, of the machine, its control groups and its own limit.

    Parameters
    ----------
    root : Path
        Where ``proc`` and ``sys`` are, of which the control groups of Linux are read.
    """
    return max(0, min([psutil.virtual_memory().available, *_of_process(), *_of_groups(root)]))


def _of_process() -> list[int]:
    """Return what the limit of this process's addresses leaves, where there is one."""
    if sys.platform != "linux":
        return []
    process = psutil.Process()
    most, _ = process.rlimit(psutil.RLIMIT_AS)
    return [] if most == psutil.RLIM_INFINITY else [most - process.memory_info().vms]


#: By version of control groups: the folder, and the names of the limit, the usage, and the part of the usage that is
#: files, which the system gives up when memory is wanted.
_GROUPS = {
    "": ("sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"),
    "memory": ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"),
}


def _of_groups(root: Path) -> Iterator[int]:
    """Yield what the limit of each control group leaves that this process is in."""
    for folder, limit, usage, files in _groups(root):
        with suppress(OSError, ValueError):
            # Most groups have no limit: "max" is no number.
            most = int((folder / limit).read_text())
            stat = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
            yield most - int((folder / usage).read_text()) + int(stat.get(files, 0))


@cache
def _groups(root: Path) -> list[tuple[Path, str, str, str]]:
    """Return the folder of each control group that this process is in and that can have a limit, with its names."""
    found = []
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:
        return []
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        name = "memory" if "memory" in controllers.split(",") else controllers
        if name not in _GROUPS:
            continue
        base, limit, usage, files = _GROUPS[name]
        top = root / base
        # Within a container the path is that of the machine, of which only the top is there.
        group = top / path.lstrip("/")
        for folder in (group, *group.parents):
            if (folder / limit).exists():
                found.append((folder, limit, usage, files))
            if folder == top:
                break
    return found
