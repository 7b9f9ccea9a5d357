"""A ROS bag: recognised by its content, and opened by rosbags with the definitions of its messages."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from taxel._base.errors import refused, unreadable
from taxel._base.messages import escaped, first_line, installing
from taxel._core import Error

__all__ = ["is_bag", "open_bag"]

#: The first bytes of a .bag and of a .db3, which is a database of SQLite.
_ROS1, _SQLITE = b"#ROSBAG V", b"SQLite format 3\0"
#: The first bytes of a .mcap: its magic and the code of the header, before the header's length and its profile.
_MCAP = b"\x89MCAP0\r\n\x01"


def is_bag(path: Path) -> bool:
    """Return whether a path is a ROS bag, by its content.

    Raises
    ------
    OSError : the file is not there, or cannot be read
    """
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    with open(path, "rb") as file:
        head = file.read(64)
    if head.startswith(_MCAP):
        profile = head[len(_MCAP) + 8 :]
        return profile[4 : 4 + int.from_bytes(profile[:4], "little")] in (b"ros1", b"ros2")
    return head.startswith((_ROS1, _SQLITE))


@contextmanager
def open_bag(path: Path, ros: str | None) -> Iterator[Any]:
    """Open a bag as an `AnyReader` of rosbags; `ros` is the release whose types a bag without definitions has.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, without definitions of its messages, or of a kind that rosbags does not read
    ProblemError : an unknown release
    """
    try:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        raise ImportError(
            f"{escaped(path)}: to read a ROS bag, taxel needs rosbags, which is not installed: {installing('ros')}"
        ) from None
    stores = {store.value.partition("_")[2]: store for store in Stores if "_" in store.value}
    if ros is not None and ros not in stores:
        raise refused("ros", f" is {ros}: must be one of {', '.join(stores)}")
    given = None if ros is None else get_typestore(stores[ros])
    try:
        with AnyReader([path], default_typestore=given) as reader:
            yield reader
    except (Error, FileNotFoundError, PermissionError):
        raise
    # Damaged files raise errors of rosbags' parts: of struct, of SQLite, of YAML, of bz2, of zstd; and a damaged size
    # asks for more memory than is available.
    except Exception as error:
        why = "it needs more memory than is available" if isinstance(error, MemoryError) else first_line(error)
        if "type definitions" in why:
            why = f"it has no definitions of its messages; give ros, one of {', '.join(stores)}"
        elif "index" in why.lower() and path.suffix == ".bag":
            why = "the index is missing or damaged; to repair it, run rosbag reindex"
        elif "magic" in why.lower() and path.suffix not in (".bag", ".db3"):
            why = "the end of the file is missing; to repair it, run mcap recover"
        raise unreadable(f"cannot be read as a ROS bag: {why}", path) from None
