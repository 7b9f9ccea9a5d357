"""A ROS bag: recognised by its content, and opened with the definitions of its messages."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from taxel._base.documents import read_text
from taxel._base.errors import helped, refused
from taxel._base.messages import escaped, first_line, installing
from taxel._core import Error, FormatError, ProblemError

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.typesys.store import Typestore

__all__ = ["Bag", "is_bag", "open_bag"]

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
    head = _begins(path, 64)
    if head.startswith(_MCAP):
        profile = head[len(_MCAP) + 8 :]
        return profile[4 : 4 + int.from_bytes(profile[:4], "little")] in (b"ros1", b"ros2")
    return head.startswith((_ROS1, _SQLITE))


def _begins(path: Path, count: int) -> bytes:
    with open(path, "rb") as file:
        return file.read(count)


@dataclass(frozen=True)
class Bag:
    """Hold an open bag: its reader, and the definitions of its messages."""

    path: Path
    is_ros1: bool
    reader: Any
    store: Typestore

    def of_topic(self, topic: str) -> list[Connection]:
        """Return the connections of a topic, which have messages of one type.

        Raises
        ------
        FormatError : no such topic, messages of several types, or a type without a definition
        """
        found = [connection for connection in self.reader.connections if connection.topic == topic]
        types = sorted({connection.msgtype for connection in found})
        if not found:
            there = ", ".join(sorted(self.topics())) or "none"
            raise FormatError(f"{self.path}: the bag has no topic {topic}; its topics are {there}")
        if len(types) > 1:
            raise FormatError(
                f"{self.path}: topic {topic} has messages of several types ({', '.join(types)}); must have one type"
            )
        undefined = self.undefined(types[0])
        if undefined:
            error = FormatError(
                f"{self.path}: the definition of {undefined} (topic {topic}) is not in the bag; it may be in a "
                f"folder of .msg or .idl files, or in a release of ROS, one of {', '.join(_stores())}"
            )
            raise helped(error, "types", "give")
        for connection in found:
            self._check_digest(connection)
        return found

    def topics(self) -> set[str]:
        """Return the names of all topics."""
        return {connection.topic for connection in self.reader.connections}

    def undefined(self, name: str) -> str:
        """Return the name of a type that is not defined: this type, or a type that it is made of; "" if none."""
        if name not in self.store.fielddefs:
            return name
        from rosbags.interfaces import Nodetype  # noqa: PLC0415  an extra

        for _, described in self.store.fielddefs[name][1]:
            kind, inner = described
            if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
                kind, inner = inner[0]
            missing = self.undefined(str(inner)) if kind == Nodetype.NAME else ""
            if missing:
                return missing
        return ""

    def messages(self, connections: Sequence[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield the messages of some connections: connection, the bag's time in ns, bytes."""
        if connections:  # rosbags reads none as all
            yield from self.reader.messages(connections=connections)

    def decoded(self, connection: Connection, data: bytes) -> Any:
        """Return a message."""
        decode = self.store.deserialize_ros1 if self.is_ros1 else self.store.deserialize_cdr
        return decode(data, connection.msgtype)

    def _check_digest(self, sent: Connection) -> None:
        """Refuse a given definition whose digest differs from that of the messages' own, if the bag holds it."""
        if sent.msgdef.data or not sent.digest:
            return
        digest = self.store.generate_msgdef(sent.msgtype)[1] if self.is_ros1 else self.store.hash_rihs01(sent.msgtype)
        if digest != sent.digest:
            raise FormatError(
                f"{self.path}: the bag was recorded with another definition of {sent.msgtype} than the given files "
                f"contain; the digest in the bag is {sent.digest}"
            )


@contextmanager
def open_bag(path: Path, types: Path | None, ros: str | None) -> Iterator[Bag]:
    """Open a bag; parameters and errors are those of `taxel.formats.ros.topics`."""
    try:
        from rosbags import rosbag1, rosbag2  # noqa: PLC0415  an extra
    except ImportError:
        raise ImportError(
            f"{escaped(path)}: to read a ROS bag, taxel needs rosbags, which is not installed: {installing('ros')}"
        ) from None
    try:
        is_ros1 = path.is_file() and _begins(path, len(_ROS1)) == _ROS1
        reader: Any = (rosbag1 if is_ros1 else rosbag2).Reader(path)
        with reader:
            yield Bag(path, is_ros1, reader, _store(reader.connections, types, ros))
    except Error:
        raise
    # Damaged files raise errors of rosbags' parts: of struct, of SQLite, of YAML, of bz2, of zstd; and a damaged size
    # asks for more memory than is available.
    except Exception as error:
        is_position = getattr(error, "errno", None) == errno.EINVAL or "offset-sized" in str(error)
        if isinstance(error, OSError) and error.errno is not None and not is_position:
            error.filename = error.filename or str(path)
            raise
        why = "it needs more memory than is available" if isinstance(error, MemoryError) else first_line(error)
        if is_position:
            why = "the bag is damaged: a position in it is beyond the end of any file"
        elif "index" in why.lower() and path.suffix == ".bag":
            why = "the index is missing or damaged; to repair it, run rosbag reindex"
        elif "magic" in why.lower() and path.suffix not in (".bag", ".db3"):
            why = "the end of the file is missing; to repair it, run mcap recover"
        raise FormatError(f"{path}: cannot be read as a ROS bag: {why}") from None


def _store(connections: Sequence[Connection], types: Path | None, ros: str | None) -> Typestore:
    """Return the definitions of messages: the bag's own, before those of `types`, before those of `ros`."""
    from rosbags.interfaces import MessageDefinitionFormat  # noqa: PLC0415  an extra
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

    stores = _stores()
    if ros is not None and ros not in stores:
        raise refused("ros", f" is {ros}: must be one of {', '.join(stores)}")
    defined: dict[str, Any] = {} if ros is None else dict(get_typestore(stores[ros]).fielddefs)
    if types is not None:
        defined |= _of_folder(types, [connection.msgtype for connection in connections])
    for connection in connections:
        if connection.msgdef.format == MessageDefinitionFormat.MSG:
            defined |= get_types_from_msg(connection.msgdef.data, connection.msgtype)
        elif connection.msgdef.format == MessageDefinitionFormat.IDL:
            defined |= _of_idl(connection.msgdef.data)
    store = get_typestore(Stores.EMPTY)
    store.register(defined)
    return store


def _stores() -> dict[str, Any]:
    """Return the releases of ROS whose types rosbags knows, by name."""
    from rosbags.typesys import Stores  # noqa: PLC0415  an extra

    return {store.value.partition("_")[2]: store for store in Stores if "_" in store.value}


def _of_folder(folder: Path, needed: Iterable[str]) -> dict[str, Any]:
    """Return the types that the .msg and .idl files of a folder, or below it, define."""
    from rosbags.typesys import get_types_from_msg  # noqa: PLC0415  an extra

    files = sorted(file for file in folder.rglob("*") if file.suffix in (".msg", ".idl"))
    if not files:
        raise ProblemError(f"{folder}: must be a folder with .msg or .idl files")
    defined: dict[str, Any] = {}
    for file in files:
        try:
            text = read_text(file)
            if file.suffix == ".idl":
                defined |= _of_idl(text)
            else:
                defined |= get_types_from_msg(text, f"{_package(file, needed)}/msg/{file.stem}")
        except Exception as error:  # of the parser, and of text that is not UTF-8
            raise FormatError(f"{file}: the definition of messages in it cannot be read: {first_line(error)}") from None
    return defined


def _package(file: Path, needed: Iterable[str]) -> str:
    """Return the package of a .msg file: of PACKAGE/msg/NAME.msg, or else the one that the bag's types name."""
    if file.parent.name == "msg":
        return file.resolve().parent.parent.name
    beside = {message.stem for message in file.parent.glob("*.msg")}
    packages = {name.split("/")[0] for name in needed if name.split("/")[-1] in beside}
    return packages.pop() if len(packages) == 1 else file.resolve().parent.name


def _of_idl(text: str) -> dict[str, Any]:
    """Return the types of a definition in IDL, which may be that of several files."""
    from rosbags.typesys import get_types_from_idl  # noqa: PLC0415  an extra

    # The parser of rosbags knows no preprocessor; what a file includes is found by its name.
    text = re.sub(r"(?m)^[ \t]*#.*$", "", text)
    line = "=" * 80 + "\n"
    parts = [part.partition("\n")[2] for part in text.split(line)[1:]] if text.startswith(f"{line}IDL: ") else [text]
    defined: dict[str, Any] = {}
    for part in parts:
        defined |= get_types_from_idl(part)
    return defined
