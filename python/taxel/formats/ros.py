"""ROS bags: which topics hold numbers, and the frames of chosen ones; by the library rosbags, without ROS.

A bag is a ``.bag`` of ROS 1, a ``.db3`` or ``.mcap`` of ROS 2, or a folder with ``metadata.yaml`` and its files.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import frozen_whole
from taxel._base.errors import helped, refused, unreadable
from taxel._base.messages import counted, first_line, installing, warn
from taxel._core import Error, FormatError, ProblemError
from taxel.array import Array
from taxel.formats.times import repaired
from taxel.frames import Frames
from taxel.labels import source_of
from taxel.reading import Facts, InMemory, Reader

__all__ = ["Topic", "is_bag", "read_ros", "topics"]

#: The first bytes of a .bag and of a .db3, which is a database of SQLite.
_ROS1, _SQLITE = b"#ROSBAG V", b"SQLite format 3\0"
#: The first bytes of a .mcap: its magic and the code of the header, before the header's length and its profile.
_MCAP = b"\x89MCAP0\r\n\x01"
#: A stamp that is further from the bag's time of its message is wrong, ns; stamps count if so many are right.
_DAY_NS, _MOST = 86_400 * 10**9, 0.9
IMAGE = "sensor_msgs/msg/Image"
#: Messages that hold bytes, not numbers, and how they could be read.
_BYTES = {
    "sensor_msgs/msg/CompressedImage": "the messages are compressed images, which taxel does not read; record them as "
    "sensor_msgs/Image with one channel",
    "sensor_msgs/msg/PointCloud2": "the messages are clouds of points, which taxel does not read; record the readings "
    "as an array or an image",
}
#: Types whose numbers are no readings: times and shapes.
_WITHOUT_READINGS = (
    "std_msgs/msg/Header",
    "std_msgs/msg/MultiArrayLayout",
    "builtin_interfaces/msg/Time",
    "builtin_interfaces/msg/Duration",
)
#: What one pixel is, by encoding (sensor_msgs/image_encodings), of those with one channel.
_PIXELS = {
    **dict.fromkeys(("mono8", "8UC1"), "u1"),
    **dict.fromkeys(("mono16", "16UC1"), "u2"),
    **dict(zip(("8SC1", "16SC1", "32SC1", "32FC1", "64FC1"), ("i1", "i2", "i4", "f4", "f8"), strict=True)),
}


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
def _open_bag(path: Path, ros: str | None) -> Iterator[Any]:
    """Open a bag as an `AnyReader` of rosbags; `ros` is the release whose types a bag without definitions has."""
    try:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        text = f"to read a ROS bag, taxel needs rosbags, which is not installed: {installing('ros')}"
        raise ImportError(f"{path}: {text}") from None
    stores = {store.value.partition("_")[2]: store for store in Stores if "_" in store.value}
    if ros is not None and ros not in stores:
        raise refused("ros", f" is {ros}: must be one of {', '.join(stores)}")
    try:
        with AnyReader([path], default_typestore=None if ros is None else get_typestore(stores[ros])) as reader:
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


def _type(value: Any) -> str:
    return str(getattr(value, "__msgtype__", ""))


def _leaves(message: Any, path: str = "", *, listed: bool = False) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the fields of a message that hold numbers, each with its path; a single number only in a list of messages.

    A part of the messages of a list is one field: ``sensors.taxels`` are the taxels of all sensors, in their order.

    Raises
    ------
    FormatError : the message is an image that is not read, or holds bytes
    """
    if _type(message) in _BYTES and not path:
        raise FormatError(_BYTES[_type(message)])
    if isinstance(message, np.ndarray) or _type(message) == IMAGE:
        yield path, _values(message, "")
    elif isinstance(message, list):
        for inner, _ in _leaves(message[0], listed=True) if message and is_dataclass(message[0]) else ():
            yield f"{path}.{inner}", _values(message, inner)
    elif is_dataclass(message) and _type(message) not in (*_WITHOUT_READINGS, *_BYTES):
        for field in fields(message):
            yield from _leaves(getattr(message, field.name), f"{path}.{field.name}".lstrip("."), listed=listed)
    elif listed and isinstance(message, int | float | np.number):
        yield path, _values(message, "")


def _values(message: Any, path: str) -> NDArray[Any]:
    """Return the numbers of a field, shape (n,), or (rows, columns) of an image.

    Raises
    ------
    LookupError : there is no such field, or it holds no numbers
    """
    step, _, rest = path.partition(".")
    if isinstance(message, list):
        if step.isascii() and step.isdigit():
            return _values(message[int(step)], rest)
        each = [_values(part, path).reshape(-1) for part in message]
        return np.concatenate(each) if each else np.empty(0)
    if step:
        if not is_dataclass(message) or not hasattr(message, step):
            raise LookupError(step)
        return _values(getattr(message, step), rest)
    if isinstance(message, np.ndarray) and message.dtype.kind in "uifb":
        return message
    if isinstance(message, int | float | np.number):
        return np.array([message])
    if _type(message) == IMAGE:
        return _pixels(message)
    raise LookupError(path)


def _pixels(image: Any) -> NDArray[Any]:
    """Return an image's pixels, shape (rows, columns); none if its data are shorter than it says."""
    if image.encoding not in _PIXELS:
        raise FormatError(
            f"the encoding of the images is {image.encoding}; must be one with a single channel: {', '.join(_PIXELS)}"
        )
    kind = np.dtype(_PIXELS[image.encoding]).newbyteorder(">" if image.is_bigendian else "<")
    width = image.width * kind.itemsize
    if image.step < width or len(image.data) < image.height * image.step:
        return np.empty((0, 0))
    lines = np.asarray(image.data[: image.height * image.step], np.uint8).reshape(image.height, image.step)
    return np.ascontiguousarray(lines[:, :width]).view(kind).reshape(image.height, image.width)


def _grid(message: Any, path: str) -> tuple[int, int] | None:
    """Return rows and columns of a field, if the message states them: of an image, or of a std_msgs multi-array."""
    *parents, last = path.split(".")
    try:
        parent = reduce(lambda m, step: m[int(step)] if isinstance(m, list) else getattr(m, step), parents, message)
        inner = getattr(parent, last) if last else parent
    except (LookupError, AttributeError, ValueError):  # of a list of messages
        return None
    if _type(inner) == IMAGE:
        return int(inner.height), int(inner.width)
    if _type(parent).startswith("std_msgs/msg/") and _type(parent).endswith("MultiArray"):
        sizes = tuple(int(dimension.size) for dimension in parent.layout.dim)
        if len(sizes) == 2 and sizes[0] * sizes[1] == len(parent.data) and not parent.layout.data_offset:
            return sizes
    return None


@dataclass(frozen=True)
class Topic:
    """Describe a field of a ROS topic that holds numbers, by the topic's first message that has some.

    Parameters
    ----------
    topic, type, field : str
        `field` is "" for a topic of images, and for a topic without a definition.
    shape : tuple of int
        Shape of its numbers (n,), or its rows and columns if the message states them; empty if unknown.
    dtype : str
        Type of its numbers, such as "int16"; "" if unknown.
    messages : int
    rate_hz : float, Hz, optional
        Rate by the bag's times; None with fewer than two messages.
    trouble : str
        Reason why it cannot be read: its type has no definition, or its images have several channels; "" if it can be
        read.
    """

    topic: str
    type: str
    field: str
    shape: tuple[int, ...]
    dtype: str
    messages: int
    rate_hz: float | None
    trouble: str = ""


def topics(path: Path, ros: str | None = None) -> list[Topic]:
    """Return the fields of a bag's topics that hold more numbers than one.

    Parameters
    ----------
    path : Path
    ros : str, optional
        A release of ROS, for example "humble", whose types a bag without definitions has.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, or without definitions of its messages
    ProblemError : an unknown release
    """
    with _open_bag(path, ros) as bag:
        names = sorted({connection.topic for connection in bag.connections})
        return [each for name in names for each in _of_topic(bag, name)]


def _of_topic(bag: Any, topic: str) -> Iterator[Topic]:
    """Yield the fields of a topic by the first message that has numbers; all are counted."""
    connections = [connection for connection in bag.connections if connection.topic == topic]
    kind, count = connections[0].msgtype, sum(connection.msgcount for connection in connections)
    if kind not in bag.typestore.fielddefs:
        yield Topic(topic, kind, "", (), "", count, None, f"no definition of {kind}")
        return
    times, found, first = list[int](), list[tuple[str, NDArray[Any]]](), None
    for connection, at, data in bag.messages(connections):
        times.append(at)
        if found:
            continue
        try:
            first = bag.deserialize(data, connection.msgtype)
            found = [(field, content) for field, content in _leaves(first) if content.size > 1]
        except FormatError as error:
            yield Topic(topic, kind, "", (), "", count, None, str(error))
            return
    span = np.ptp(times) / 1e9 if times else 0.0
    rate = (len(times) - 1) / span if span > 0 else None
    for field, content in found:
        yield Topic(topic, kind, field, _grid(first, field) or content.shape, content.dtype.name, len(times), rate)


def _chosen(
    topic: object, field: object, array: Array | Sequence[Array] | None
) -> list[tuple[str, str | None, Array | None]]:
    """Return each topic with its field and its array; a single one is that of all."""
    given = {"topic": _listed("topic", topic, str), "field": _listed("field", field, str)}
    given["array"] = _listed("array", array, Array)
    count = max(map(len, given.values()))
    for name, listed in given.items():
        if len(listed) not in (0, 1, count):
            times = f" is given {len(listed)} times for {count} sources"
            raise refused(name, f"{times}; must be given once, or once for each source")
    every = (listed * count if len(listed) == 1 else listed or [None] * count for listed in given.values())
    return list(zip(*every, strict=True))


def _listed(name: str, value: Any, kind: type[Any]) -> list[Any]:
    """Return what is given of a kind as a list."""
    entries = [] if value is None else [value] if isinstance(value, kind) else arguments.several(name, value)
    check = arguments.text if kind is str else lambda name, entry: arguments.instance(name, entry, Array)
    return [check(name, entry) for entry in entries]


def read_ros(
    path: Path,
    array: Array | Sequence[Array] | None = None,
    *,
    topic: str | Sequence[str] | None = None,
    field: str | Sequence[str] | None = None,
    ros: str | None = None,
    by: str | None = None,
) -> list[Reader]:
    """Return a reader of each chosen topic of a ROS bag, and of each value of the field `by`.

    Parameters
    ----------
    path : Path
    array, topic, field, ros
        As of `taxel.open`.
    by : str, optional
        A field whose value says which sensor a message is of: each value is a source.

    Raises
    ------
    ImportError : rosbags is not installed
    FormatError : no topic is chosen; damaged; no such topic or field; no message of the array's length
    ProblemError : an unknown release; more fields than topics
    """
    if not topic:
        right = "choose one of its topics, or write [ros] in a layout file"
        error = FormatError(f"{path}: is a ROS bag; {right}; to list the topics, run taxel info {path}")
        raise helped(error, "topic", "give")
    chosen = _chosen(topic, field, array)
    for name, value in (("ros", ros), ("by", by)):
        arguments.optional(arguments.text, name, value)
    names = [name for name, _, _ in chosen]
    found: dict[str, Reader] = {}
    with _open_bag(path, ros) as bag:
        there = {connection.topic for connection in bag.connections}
        missing = next((name for name in names if name not in there), None)
        if missing is not None:
            listed = ", ".join(sorted(there)) or "none"
            raise FormatError(f"{path}: the bag has no topic {missing}; its topics are {listed}")
        others = sorted(there - set(names))
        lost = (f"other topics of the bag: {', '.join(others)}",) * bool(others)
        for name, part, size in chosen:
            held = _Messages(path, name, part, size, by)
            for connection, at, data in bag.messages([c for c in bag.connections if c.topic == name]):
                held.add(bag.deserialize(data, connection.msgtype), at)
            for key, reader in held.readers(lost, is_named=names.count(name) > 1):
                if key in found:
                    raise ProblemError(f"{path}: two sources would have the name {key}; open one at a time")
                found[key] = reader
    return list(found.values())


class _Message(NamedTuple):
    """What is read of a message: its times by the bag and by its stamp, ns."""

    values: NDArray[Any]
    at: int
    stamp: int
    key: str
    grid: tuple[int, int] | None


class _Messages:
    """The messages of a field of a topic."""

    def __init__(self, path: Path, topic: str, field: str | None, array: Array | None, by: str | None) -> None:
        self.path, self.topic, self.field, self.array, self.by = path, topic, field, array, by
        self.type = ""
        self.messages = list[_Message]()
        #: The names of channels of the first message that has some; those of others are put in their order.
        self.names: tuple[str, ...] = ()
        #: Why a message has no numbers to read: those of most may have some.
        self.trouble = ""

    @property
    def location(self) -> str:
        return f"{self.path}: topic {self.topic}" + f", field {self.field}" * bool(self.field)

    def add(self, message: Any, at: int) -> None:
        """Add a message, which the bag got `at` ns."""
        self.type = _type(message)
        try:
            self.field = self._only_field(message) if self.field is None else self.field
            numbers = np.empty(0) if self.field is None else self._numbers(message, self.field)
            key = "" if self.by is None else str(reduce(getattr, self.by.split("."), message))
        except AttributeError:
            raise FormatError(f"{self.location}: has no field {self.by}, which by names") from None
        except FormatError as error:
            raise FormatError(f"{self.location}: {error}") from None
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        stamped = 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
        grid = None if self.field is None else _grid(message, self.field)
        self.messages.append(_Message(numbers, at, stamped, key, grid))

    def _only_field(self, message: Any) -> str | None:
        """Return the field of a message that holds more numbers than one; None of a message without any."""
        there = [path for path, numbers in _leaves(message) if numbers.size > 1]
        if len(there) > 1:
            raise helped(FormatError(f"has several fields with numbers: {', '.join(there)}"), "field", "give")
        if not there:
            self.trouble = "no field has more than one number; to find topics with such a field, run taxel info"
        return there[0] if there else None

    def _numbers(self, message: Any, field: str) -> NDArray[Any]:
        """Return the numbers of a field, in the order of the first message's names, if a message names its channels."""
        try:
            numbers = _values(message, field)
        except LookupError:
            there = ", ".join(path for path, each in _leaves(message) if each.size > 1) or "none"
            self.trouble = f"the field has no numbers; fields with numbers: {there}"
            return np.empty(0)
        for named in ("name", "names", "channels", "channel_names"):
            names = getattr(message, named, None)
            if isinstance(names, list) and len(names) == numbers.size and all(isinstance(n, str) for n in names):
                self.names = self.names or tuple(names)
                is_same = sorted(names) == sorted(self.names)
                return numbers[[names.index(name) for name in self.names]] if is_same else np.empty(0)
        return numbers

    def readers(self, lost: tuple[str, ...], *, is_named: bool) -> Iterator[tuple[str, Reader]]:
        """Yield the frames of each key."""
        # Files of a bag may overlap.
        whole = sorted((each for each in self.messages if each.values.size), key=lambda each: each.at)
        if not whole:
            raise FormatError(f"{self.location}: {self.trouble or 'contains no message with values'}")
        array = self.array or self._stated(whole)
        fits = [
            m for m in whole if (m.values.shape == array.shape if m.values.ndim == 2 else m.values.size == array.taxels)
        ]
        if not fits:
            raise FormatError(
                f"{self.location}: the messages have {whole[0].values.size} values each; the array has {array.rows} x "
                f"{array.columns} taxels"
            )
        name = source_of(f"{self.topic}.{self.field}" if is_named else self.topic)
        for key in dict.fromkeys(message.key for message in fits):
            label = source_of(f"{name}_{key}") if key else name
            yield (
                label,
                self._reader(label, array, [m for m in fits if m.key == key], len(self.messages) - len(fits), lost),
            )

    def _reader(
        self, label: str, array: Array, messages: Sequence[_Message], left_out: int, lost: tuple[str, ...]
    ) -> InMemory:
        rows = np.stack([message.values.reshape(-1) for message in messages])
        with np.errstate(over="ignore"):
            frames = rows.astype(np.float32)
        if np.isinf(frames).any():
            raise FormatError(f"{self.location}: a value is infinite, or does not fit 32 bits")
        bag, stamps = (np.array([getattr(m, name) for m in messages], np.int64) for name in ("at", "stamp"))
        right = (stamps > 0) & (np.abs(bag.astype(np.float64) - stamps) <= _DAY_NS)
        found, by_the_bag = repaired(np.where(right, stamps, bag) // 1000), int((~right).sum())
        are_few = 2 * len(np.unique(stamps)) < len(stamps)
        if are_few or right.mean() < _MOST or found.wrong > (1 - _MOST) * len(messages):
            found, by_the_bag = repaired(bag // 1000), len(messages)
        frames = frames if found.order is None else frames[found.order]
        said = [f"{left_out} of {counted(len(self.messages), 'message')} are left out, of another length"] * bool(
            left_out
        )
        if stamps.any() and by_the_bag:
            said.append(
                f"{by_the_bag} of {counted(len(messages), 'message')} have the time of the bag: their stamps are wrong"
            )
        said += found.said
        for line in said:
            warn(f"{self.path}: topic {self.topic}: {line}", stacklevel=6)
        unit = "counts" if rows.dtype.kind in "ui" else "as sent"
        table = Frames(frozen_whole(frames.reshape(-1, *array.shape)), frozen_whole(found.t), unit=unit, array=array)
        remarks = () if stamps.any() else ("the times are those of the bag, because the messages have no header",)
        source = self.topic + f".{self.field}" * bool(self.field) + f" ({self.type})"
        counts = {"messages": len(messages), "messages_of_another_length": left_out, "times_by_the_bag": by_the_bag}
        facts = Facts(
            path=self.path, array=array, kind="ros", label=label, source=source, remarks=remarks, lost=(*said, *lost)
        )
        return InMemory(facts, table, counted=counts)

    def _stated(self, whole: Sequence[_Message]) -> Array:
        """Return the most frequent length: in rows and columns as most of its messages state them, else in one row."""
        ((most, _),) = Counter(message.values.shape for message in whole).most_common(1)
        stated = Counter(message.grid for message in whole if message.grid and message.values.shape == most)
        rows, columns = stated.most_common(1)[0][0] if stated else (1, int(np.prod(most)))
        try:
            return Array(rows, columns, name=self.topic, names=self.names or None)
        except ProblemError as error:
            raise FormatError(f"{self.location}: {most} values each: {first_line(error)}") from None
