"""ROS bags: which topics hold numbers, and the frames of chosen ones; by the library rosbags, without ROS.

A bag is a ``.bag`` of ROS 1, a ``.db3`` or ``.mcap`` of ROS 2, or a folder with ``metadata.yaml`` and its files.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import reduce
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import Array, Error, FormatError, Frames, ProblemError
from taxel.formats.column_names import says
from taxel.formats.foreign import is_bag
from taxel.formats.layout import Layout, Topics
from taxel.formats.roles import FIRST, Role
from taxel.formats.times import repaired
from taxel.labels import source_of
from taxel.reading import Facts, InMemory, Reader, helped, refused, unreadable, warn
from taxel.recording.kinds import Kind, ListedTopics

#: So many different texts are names of sensors.
_KEYS = 16
#: So many messages of a topic are looked at for numbers.
_FIRST = 1000
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


@contextmanager
def _open_bag(path: Path, ros: str | None) -> Iterator[Any]:
    """Open a bag as an `AnyReader` of rosbags; `ros` is the release whose types a bag without definitions has."""
    try:
        from rosbags.highlevel import AnyReader  # noqa: PLC0415  an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError:
        how = "which is not installed: pip install 'taxel[ros]'"
        raise ImportError(f"{path}: to read a ROS bag, taxel needs rosbags, {how}") from None
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
        why = "it needs more memory than is available" if isinstance(error, MemoryError) else _first_line(error)
        if "type definitions" in why:
            why = f"it has no definitions of its messages; give ros, one of {', '.join(stores)}"
        elif "index" in why.lower() and path.suffix == ".bag":
            why = "the index is missing or damaged; to repair it, run rosbag reindex"
        elif "magic" in why.lower() and path.suffix not in (".bag", ".db3"):
            why = "the end of the file is missing; to repair it, run mcap recover"
        raise unreadable(f"cannot be read as a ROS bag: {why}", path) from None


def _first_line(error: BaseException) -> str:
    """Return the first line of an error."""
    return str(error).partition("\n")[0] or type(error).__name__


def _type(value: Any) -> str:
    return str(getattr(value, "__msgtype__", ""))


def _paths(message: Any, path: str = "", *, listed: bool = False) -> Iterator[str]:
    """Yield the paths of the fields of a message that hold numbers; a single number only in a list of messages.

    A part of the messages of a list is one field: ``sensors.taxels`` are the taxels of all sensors, in their order.

    Raises
    ------
    FormatError : the message holds bytes
    """
    if _type(message) in _BYTES and not path:
        raise FormatError(_BYTES[_type(message)])
    if isinstance(message, np.ndarray) or _type(message) == IMAGE:
        yield path
    elif isinstance(message, list):
        for inner in _paths(message[0], listed=True) if message and is_dataclass(message[0]) else ():
            yield f"{path}.{inner}"
    elif is_dataclass(message) and _type(message) not in (*_WITHOUT_READINGS, *_BYTES):
        for field in fields(message):
            yield from _paths(getattr(message, field.name), f"{path}.{field.name}".lstrip("."), listed=listed)
    elif listed and isinstance(message, int | float | np.number):
        yield path


def _numbers(message: Any) -> dict[str, NDArray[Any]]:
    """Return the fields of a message that hold more numbers than one.

    Raises
    ------
    FormatError : the message is an image that is not read, or holds bytes
    """
    return {path: values for path in _paths(message) if (values := _values(message, path)).size > 1}


def _values(message: Any, path: str) -> NDArray[Any]:
    """Return the numbers of a field, shape (n,), or (rows, columns) of an image or a multi-array that states them.

    Raises
    ------
    LookupError : there is no such field, or it holds no numbers
    FormatError : an image that is not read
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
        found = _values(getattr(message, step), rest)
        layout: Any = getattr(message, "layout", None) if _type(message).endswith("MultiArray") else None
        sizes = [] if layout is None or layout.data_offset else [int(dimension.size) for dimension in layout.dim]
        return found.reshape(sizes) if len(sizes) == 2 and sizes[0] * sizes[1] == found.size else found
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


def list_topics(path: Path, ros: str | None = None) -> ListedTopics:
    """Return the topics that hold numbers, and which options open one of them.

    Raises
    ------
    ImportError, FormatError, ProblemError : as of `topics`
    """
    found = topics(path, ros)
    facts = {"file": str(path), "kind": "ros", "topics": [asdict(topic) for topic in found]}
    if not found:
        return f"{path}: this ROS bag has no topic with numbers", [], facts
    rows = [("topic", "field", "shape", "numbers", "messages", "rate", "type")]
    for topic in found:
        shape = " x ".join(map(str, topic.shape)) or "-"
        rate = "-" if topic.rate_hz is None else f"{topic.rate_hz:.1f} Hz"
        kind = topic.type + f": {topic.trouble}" * bool(topic.trouble)
        rows.append((topic.topic, topic.field or "-", shape, topic.dtype or "-", str(topic.messages), rate, kind))
    # An id is no skin: most numbers are.
    named = max(found, key=lambda topic: (not topic.trouble, math.prod(topic.shape)))
    more = f" --field {named.field}" * bool(named.field) + " --array ROWSxCOLUMNS" * (len(named.shape) < 2)
    return f"{path}: ROS bag; open a topic by --topic {named.topic}{more}", rows, facts


def _of_topic(bag: Any, topic: str) -> Iterator[Topic]:
    """Yield the fields of a topic by the first message that has numbers; the bag's index counts all."""
    connections = [connection for connection in bag.connections if connection.topic == topic]
    kind, count = connections[0].msgtype, sum(connection.msgcount for connection in connections)
    if kind not in bag.typestore.fielddefs:
        yield Topic(topic, kind, "", (), "", count, None, f"no definition of {kind}")
        return
    begin, found = None, dict[str, NDArray[Any]]()
    for connection, at, data in islice(bag.messages(connections), _FIRST):
        begin = at if begin is None else begin
        try:
            found = _numbers(bag.deserialize(data, connection.msgtype))
        except FormatError as error:
            yield Topic(topic, kind, "", (), "", count, None, str(error))
            return
        if found:
            break
    span = _last(bag, connections, begin) - begin if found and begin is not None else 0
    rate = (count - 1) / span * 1e9 if span > 0 else None
    for field, values in found.items():
        yield Topic(topic, kind, field, values.shape, values.dtype.name, count, rate)


def _last(bag: Any, connections: Sequence[Any], begin: int) -> int:
    """Return the time of the last message of connections, ns: that of most is near the bag's end."""
    before = 10**9
    while True:
        start = max(bag.end_time - before, begin)
        times = [at for _, at, _ in bag.messages(connections, start=start)]
        if times or start == begin:
            return max(times, default=begin)
        before *= 4


def _chosen(how: Topics) -> list[tuple[str, str | None, Array | None]]:
    """Return each topic with its field and its array; a single one is that of all."""
    given = {name: how.entries(name) for name in ("topic", "field", "array")}
    count = max(map(len, given.values()))
    for name, listed in given.items():
        if len(listed) not in (0, 1, count):
            times = f" is given {len(listed)} times for {count} sources"
            raise refused(name, f"{times}; must be given once, or once for each source")
    every = (listed * count if len(listed) == 1 else listed or [None] * count for listed in given.values())
    return list(zip(*every, strict=True))


class _Message(NamedTuple):
    """What is read of a message: its times by the bag and by its stamp, ns; `key` is the value of the field `by`.

    `texts` are of fields that may say which sensor it is of, if `by` is not stated.
    """

    values: NDArray[Any]
    at: int
    stamp: int
    key: str
    texts: tuple[Any, ...]


def read(path: Path, layout: Layout | None = None) -> list[Reader]:
    """Return a reader of each topic that `[ros]` of a layout chooses, and of each value of its field `by`.

    Messages that do not state rows and columns have those of the layout.

    Raises
    ------
    ImportError : rosbags is not installed
    FormatError : no topic is chosen; damaged; no such topic or field; no message of the array's length
    ProblemError : an unknown release; more fields than topics
    """
    how = (None if layout is None else layout.ros) or Topics()
    grid = None if layout is None else layout.grid()
    how = replace(how, array=grid) if how.array is None and grid is not None else how
    if not how.topic:
        right = "choose one of its topics, or write [ros] in a layout file"
        error = FormatError(f"{path}: is a ROS bag; {right}; to list the topics, run taxel info {path}")
        raise helped(error, "topic", "give")
    chosen, ros, by = _chosen(how), how.ros, how.by
    names = [name for name, _, _ in chosen]
    found: dict[str, Reader] = {}
    with _open_bag(path, ros) as bag:
        there = {connection.topic for connection in bag.connections}
        missing = next((name for name in names if name not in there), None)
        if missing is not None:
            listed = ", ".join(sorted(there)) or "none"
            raise FormatError(f"{path}: the bag has no topic {missing}; its topics are {listed}")
        others = ", ".join(sorted(there - set(names)))
        lost = (f"other topics of the bag: {others}",) * bool(others)
        for name, part, size in chosen:
            for reader in _readers(path, bag, name, part, size, by, lost, is_named=names.count(name) > 1):
                if reader.facts.label in found:
                    raise ProblemError(
                        f"{path}: two sources would have the name {reader.facts.label}; open one at a time"
                    )
                found[reader.facts.label] = reader
    return list(found.values())


def _readers(
    path: Path,
    bag: Any,
    topic: str,
    field: str | None,
    array: Array | None,
    by: str | None,
    lost: tuple[str, ...],
    *,
    is_named: bool,
) -> Iterator[InMemory]:
    """Yield the frames of a topic, those of each key apart."""
    location = f"{path}: topic {topic}" + f", field {field}" * bool(field)
    kind, names, trouble, messages = "", tuple[str, ...](), "", list[_Message]()
    # A message has names where the first with values has some.
    keys: dict[str, list[str]] | None = None
    are_named, roles = True, list[Role]()
    for connection, at, data in bag.messages([each for each in bag.connections if each.topic == topic]):
        message = bag.deserialize(data, connection.msgtype)
        kind = _type(message)
        try:
            field = _only_field(message) if field is None else field
            values, names = _ordered(message, field, names, are_named=are_named)
            if values.size and keys is None:
                keys = {name: name.split(".") for name in _texts(message)} if by is None else {}
                are_named, roles = bool(names), _roles(message, field, by)
            key = "" if not by else str(reduce(getattr, by.split("."), message))
        except LookupError as error:
            values, key, trouble = np.empty(0), "", str(error.args[0])
        except AttributeError:
            raise FormatError(f"{location}: has no field {by}, which by names") from None
        except FormatError as error:
            raise FormatError(f"{location}: {error}") from None
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        ns = 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)
        texts = tuple([reduce(getattr, steps, message) for steps in (keys or {}).values()])
        messages.append(_Message(values, at, ns, key, texts))
    # Files of a bag may overlap.
    whole = sorted((each for each in messages if each.values.size), key=lambda each: each.at)
    if not whole:
        raise FormatError(f"{location}: {trouble or 'contains no message with values'}")
    _refuse_mixed(location, [*(keys or {})], [message.texts for message in whole if message.texts])
    shape = _shape(whole) if array is None else array.shape
    # What states other rows and columns than those of one row does not fit.
    fits = [m for m in whole if m.values.shape in (shape, (math.prod(shape),), (1, math.prod(shape)))]
    if not fits:
        sizes = f"{whole[0].values.size} values each; the array has {shape[0]} x {shape[1]} taxels"
        raise FormatError(f"{location}: the messages have {sizes}")
    try:
        array = array or Array(*shape, name=topic, names=names or None)
    except ProblemError as error:
        raise FormatError(f"{location}: {shape} values each: {_first_line(error)}") from None
    name = source_of(f"{topic}.{field}" if is_named else topic)
    short = len(messages) - len(fits)
    said = [f"{short} of {_counted(messages)} are left out, of another length"] * bool(short)
    for key in dict.fromkeys(message.key for message in fits):
        of_key = [message for message in fits if message.key == key]
        facts = Facts(
            path=path,
            array=array,
            kind="ros",
            label=source_of(f"{name}_{key}") if key else name,
            source=topic + f".{field}" * bool(field) + f" ({kind})",
            lost=lost,
            roles=tuple(map(asdict, roles)),
        )
        yield _reader(location, facts, of_key, said, short)


def _roles(message: Any, field: str, by: str | None) -> list[Role]:
    """Return what the time, the field that says the sensor, and each field of numbers of a message is."""
    stamp = "header.stamp" if hasattr(getattr(message, "header", None), "stamp") else "time of the bag"
    roles = [Role(stamp, role="time"), *[Role(by, role="sensor", why="stated") for by in [by] if by]]
    first = [f"{value:g}" for value in _values(message, field).reshape(-1)[:FIRST].tolist()]
    others = (Role(name, role="no taxel", why="not chosen") for name in _paths(message) if name != field)
    return [*roles, Role(field, first), *others]


def _only_field(message: Any) -> str:
    """Return the field of a message that holds more numbers than one.

    Raises
    ------
    LookupError : there is none
    FormatError : there are several
    """
    there = list(_numbers(message))
    if len(there) > 1:
        raise helped(FormatError(f"has several fields with numbers: {', '.join(there)}"), "field", "give")
    if not there:
        raise LookupError("no field has more than one number; to find topics with such a field, run taxel info")
    return there[0]


def _ordered(
    message: Any, field: str, known: tuple[str, ...], *, are_named: bool = True
) -> tuple[NDArray[Any], tuple[str, ...]]:
    """Return the numbers of a field in the order of `known` names, and these: those of the message if none are known.

    Raises
    ------
    LookupError : there is no such field, or it holds no numbers
    """
    try:
        numbers = _values(message, field)
    except LookupError:
        there = ", ".join(_numbers(message)) or "none"
        raise LookupError(f"the field has no numbers; fields with numbers: {there}") from None
    names = _names(message, field) if are_named else []
    if not names:
        return numbers, known
    known = known or tuple(names)
    is_same = sorted(names) == sorted(known)
    return numbers.reshape(-1)[[names.index(name) for name in known]] if is_same else np.empty(0), known


def _names(message: Any, path: str) -> list[str]:
    """Return a name for each number of a field, if a list beside it or above it, or the parts of a list, state them."""
    step, _, rest = path.partition(".")
    found = list[str]()
    if isinstance(message, list) and not step.isdecimal():
        for part in message:
            size = _values(part, path).size
            own = next((value for value in _texts(part).values() if value), "")
            found += [own if size == 1 else f"{own}[{k}]" for k in range(size)] if own else _names(part, path)
    elif step:
        size = _values(message, path).size
        lists = [getattr(message, each.name) for each in fields(message)] if is_dataclass(message) else []
        texts = (each for each in lists if isinstance(each, list) and len(each) == size)
        found = next((each for each in texts if all(isinstance(name, str) for name in each)), [])
        inner = message[int(step)] if isinstance(message, list) else getattr(message, step)
        found = found or (_names(inner, rest) if rest or isinstance(inner, list) else [])
    return found if len({*found}) == len(found) else []


def _texts(message: Any, path: str = "") -> dict[str, Any]:
    """Return the fields of a message that may say which sensor it is of: texts, and numbers with such a name."""
    found: dict[str, Any] = {}
    for each in fields(message) if is_dataclass(message) else ():
        value, name = getattr(message, each.name), f"{path}.{each.name}".lstrip(".")
        if isinstance(value, str) or (isinstance(value, int | np.integer) and says("sensor", each.name)):
            found[name] = value
        elif is_dataclass(value) and not isinstance(value, list):
            found |= _texts(value, name)
    return found


def _refuse_mixed(location: str, names: Sequence[str], texts: Sequence[Sequence[Any]]) -> None:
    """Refuse messages of several sensors in turn, with the field that says which each is of; its texts are given.

    Raises
    ------
    FormatError : there is such a field
    """
    for name, values in zip(names, zip(*texts, strict=True), strict=False):
        known = sorted(map(str, set(values)))
        in_turn = 3 * sum(a != b for a, b in pairwise(values)) > len(values)
        if 1 < len(known) <= _KEYS and in_turn and len(values) > len(known):
            right = f"write by = {name!r}, each a source, or by = '', all of one, in [ros] of a layout file"
            raise FormatError(f"{location}: the messages are of {', '.join(known[:4])} in turn ({name}): {right}")


def _counted(messages: Sequence[_Message]) -> str:
    """Return how many messages there are, for people."""
    return f"{len(messages)} message{'s' * (len(messages) != 1)}"


def _shape(whole: Sequence[_Message]) -> tuple[int, int]:
    """Return rows and columns of the most frequent number of values: as most messages state them, else one row."""
    ((size, _),) = Counter(message.values.size for message in whole).most_common(1)
    stated = Counter(m.values.shape for m in whole if m.values.size == size and m.values.ndim == 2).most_common(1)
    return stated[0][0] if stated else (1, size)


def _reader(location: str, facts: Facts, messages: Sequence[_Message], said: Sequence[str], short: int) -> InMemory:
    """Return the frames of messages, by their stamps, or by the bag's times where many of these are wrong."""
    rows = np.stack([message.values.reshape(-1) for message in messages])
    with np.errstate(over="ignore"):
        frames = rows.astype(np.float32)
    if np.isinf(frames).any():
        raise FormatError(f"{location}: a value is infinite, or does not fit 32 bits")
    bag, stamps = (np.array([getattr(m, name) for m in messages], np.int64) for name in ("at", "stamp"))
    right = (stamps > 0) & (np.abs(bag.astype(np.float64) - stamps) <= _DAY_NS)
    found, by_the_bag = repaired(np.where(right, stamps, bag) // 1000), int((~right).sum())
    are_few = 2 * len(np.unique(stamps)) < len(stamps)
    if are_few or right.mean() < _MOST or found.wrong > (1 - _MOST) * len(messages):
        found, by_the_bag = repaired(bag // 1000), len(messages)
    frames = frames if found.order is None else frames[found.order]
    wrong = f"{by_the_bag} of {_counted(messages)} have the time of the bag: their stamps are wrong"
    said = [*said, *[wrong] * bool(stamps.any() and by_the_bag), *found.said]
    for line in said:
        warn(f"{location.partition(', field ')[0]}: {line}", stacklevel=6)
    unit = "counts" if rows.dtype.kind in "ui" else "as sent"
    table = Frames(frames.reshape(-1, *facts.array.shape), found.t, unit=unit, array=facts.array)
    remarks = () if stamps.any() else ("the times are those of the bag, because the messages have no header",)
    counts = {"messages": len(messages), "messages_of_another_length": short, "times_by_the_bag": by_the_bag}
    return InMemory(replace(facts, remarks=remarks, lost=(*said, *facts.lost)), table, counted=counts)


ROS = Kind(is_bag, read, topics=list_topics)
