"""Chosen topics of a ROS bag, each as a source of frames, with the times of their messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base import arguments
from taxel._base.columns import frozen_whole
from taxel._base.errors import helped, refused
from taxel._base.messages import counted, first_line, warn
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.checks import sensor
from taxel.formats.checks import table as limited
from taxel.formats.ros.bag import open_bag
from taxel.formats.ros.fields import grid, leaves, values
from taxel.formats.times import repaired
from taxel.frames import Frames
from taxel.labels import source_of
from taxel.reading import Facts, InMemory, Reader

__all__ = ["Topics", "read_ros"]

#: A stamp that is further from the bag's time of its message is wrong, ns.
_DAY_NS = 86_400 * 10**9
#: Stamps count if so many are right.
_MOST = 0.9


@dataclass(frozen=True)
class Topics:
    """Choose what of a ROS bag is opened; the arguments are those of `taxel.open`.

    Parameters
    ----------
    topic, field : str, or list of str, optional
    ros : str, optional
    by : str, optional
        A field whose value says which sensor a message is of: each value is a source.

    Raises
    ------
    ProblemError : not a text, or more fields than topics
    """

    topic: str | Sequence[str] | None
    field: str | Sequence[str] | None
    ros: str | None
    by: str | None = None

    def __post_init__(self) -> None:
        for name in ("topic", "field"):
            _texts(name, getattr(self, name))
        for name in ("ros", "by"):
            if getattr(self, name) is not None:
                arguments.text(name, getattr(self, name))

    @property
    def are_given(self) -> bool:
        """Whether any of them is."""
        return any(option is not None for option in (self.topic, self.field, self.ros))

    def but(self, of_layout: Mapping[str, Any]) -> Topics:
        """Return what is given, and what a layout says of the rest."""
        return replace(self, **{name: value for name, value in of_layout.items() if getattr(self, name) is None})

    def chosen(self, array: Array | Sequence[Array] | None) -> list[tuple[str, str | None, Array | None]]:
        """Return each topic with its field and its array."""
        topics, fields, arrays = _texts("topic", self.topic), _texts("field", self.field), _arrays(array)
        count = max(len(topics), len(fields), len(arrays))
        for name, times in (("topic", len(topics)), ("field", len(fields)), ("array", len(arrays))):
            if times not in (0, 1, count):
                raise refused(
                    name, f" is given {times} times for {count} sources; must be given once, or once for each source"
                )
        topics = topics * count if len(topics) == 1 else topics
        every_field: Sequence[str | None] = fields * count if len(fields) == 1 else fields or [None] * count
        every_array: Sequence[Array | None] = arrays * count if len(arrays) == 1 else arrays or [None] * count
        return list(zip(topics, every_field, every_array, strict=True))


def _texts(name: str, texts: str | Sequence[str] | None) -> list[str]:
    entries = [texts] if isinstance(texts, str) else [] if texts is None else arguments.several(name, texts)
    return [arguments.text(name, entry) for entry in entries]


def _arrays(array: Array | Sequence[Array] | None) -> list[Array]:
    if array is None or isinstance(array, Array):
        return [] if array is None else [array]
    entries = arguments.several("array", array)
    if entries and not isinstance(entries[0], Array):
        Array._given(array)
    return [arguments.instance("array", entry, Array) for entry in entries]


def read_ros(path: Path, topics: Topics, array: Array | Sequence[Array] | None) -> list[Reader]:
    """Return a reader of each chosen topic of a ROS bag, and of each value of the field `by`.

    Raises
    ------
    ImportError : rosbags is not installed
    FormatError : no topic is chosen; damaged; no such topic or field; no message of the array's length
    ProblemError : an unknown release
    """
    if not topics.topic:
        error = FormatError(
            f"{path}: is a ROS bag; choose one of its topics, or write [ros] in a layout file; to list the topics, run "
            f"taxel info {path}"
        )
        raise helped(error, "topic", "give")
    chosen = topics.chosen(array)
    names = [topic for topic, _, _ in chosen]
    found: dict[str, Reader] = {}
    with open_bag(path, topics.ros) as bag:
        there = {connection.topic for connection in bag.connections}
        missing = next((topic for topic in names if topic not in there), None)
        if missing is not None:
            listed = ", ".join(sorted(there)) or "none"
            raise FormatError(f"{path}: the bag has no topic {missing}; its topics are {listed}")
        unread = tuple(sorted(there - set(names)))
        for topic, field, size in chosen:
            held = _Messages(path, topic, field, size)
            for connection, at, data in bag.messages([c for c in bag.connections if c.topic == topic]):
                held.add(bag.deserialize(data, connection.msgtype), at, topics.by, connection.msgtype)
            for key, reader in held.readers(unread, is_named=names.count(topic) > 1):
                if key in found:
                    raise ProblemError(f"{path}: two sources would have the name {key}; open one at a time")
                found[key] = reader
    return list(found.values())


class _Messages:
    """The messages of a field of a topic."""

    def __init__(self, path: Path, topic: str, field: str | None, array: Array | None) -> None:
        self.path, self.topic, self.field, self.array = path, topic, field, array
        self.type = ""
        self.values, self.times = list[NDArray[Any]](), list[tuple[int, int]]()
        self.keys, self.grids = list[str](), list[tuple[int, int] | None]()
        #: The names of channels of the first message that has some; those of others are put in their order.
        self.names: tuple[str, ...] = ()
        #: Why a message has no numbers to read: those of most may have some.
        self.trouble = ""

    @property
    def location(self) -> str:
        return f"{self.path}: topic {self.topic}" + f", field {self.field}" * bool(self.field)

    def add(self, message: Any, at: int, by: str | None, kind: str) -> None:
        """Add a message, which the bag got `at` ns."""
        self.type = kind
        try:
            if self.field is None:
                self.field = self._only_field(message)
            numbers = np.empty(0) if self.field is None else self._numbers(message, self.field)
            key = "" if by is None else str(reduce(getattr, by.split("."), message))
        except AttributeError:
            raise FormatError(f"{self.location}: has no field {by}, which by names") from None
        except FormatError as error:
            raise FormatError(f"{self.location}: {error}") from None
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        self.times.append((at, 0 if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec)))
        self.values.append(self._by_name(message, numbers))
        self.keys.append(key)
        self.grids.append(None if self.field is None else grid(message, self.field))

    def _numbers(self, message: Any, field: str) -> NDArray[Any]:
        try:
            return values(message, field)
        except LookupError:
            there = ", ".join(path for path, each in leaves(message) if each.size > 1) or "none"
            self.trouble = f"the field has no numbers; fields with numbers: {there}"
            return np.empty(0)

    def _only_field(self, message: Any) -> str | None:
        """Return the field of a message that holds more numbers than one; None of a message without any."""
        there = [path for path, numbers in leaves(message) if numbers.size > 1]
        if len(there) > 1:
            raise helped(FormatError(f"has several fields with numbers: {', '.join(there)}"), "field", "give")
        if not there:
            self.trouble = "no field has more than one number; to find topics with such a field, run taxel info"
        return there[0] if there else None

    def _by_name(self, message: Any, numbers: NDArray[Any]) -> NDArray[Any]:
        """Return numbers in the order of the first message's names, where a message names its channels."""
        for field in ("name", "names", "channels", "channel_names"):
            names = getattr(message, field, None)
            if isinstance(names, list) and len(names) == numbers.size and all(isinstance(n, str) for n in names):
                self.names = self.names or tuple(names)
                if sorted(names) != sorted(self.names):
                    return np.empty(0)
                return numbers[[names.index(name) for name in self.names]]
        return numbers

    def readers(self, unread: Sequence[str], *, is_named: bool) -> Iterator[tuple[str, Reader]]:
        """Yield the frames of each key."""
        if not any(value.size for value in self.values):
            raise FormatError(f"{self.location}: {self.trouble or 'contains no message with values'}")
        array = sensor(self.location, self.array or self._stated())
        fits = np.array([v.shape == array.shape if v.ndim == 2 else v.size == array.taxels for v in self.values])
        if not fits.any():
            size = next(value.size for value in self.values if value.size)
            raise FormatError(
                f"{self.location}: the messages have {size} values each; the array has {array.rows} x "
                f"{array.columns} taxels"
            )
        names = source_of(f"{self.topic}.{self.field}" if is_named else self.topic)
        for key in dict.fromkeys(self.keys):
            kept = np.flatnonzero(fits & (np.array(self.keys) == key))
            if len(kept):
                name = source_of(f"{names}_{key}") if key else names
                yield name, self._reader(name, array, kept, int((~fits).sum()), unread)

    def _reader(
        self, name: str, array: Array, kept: NDArray[np.intp], left_out: int, unread: Sequence[str]
    ) -> InMemory:
        # Files of a bag may overlap.
        kept = kept[np.argsort(np.array(self.times)[kept, 0], kind="stable")]
        rows = np.stack([self.values[k].reshape(-1) for k in kept])
        with np.errstate(over="ignore"):
            frames = rows.astype(np.float32)
        if np.isinf(frames).any():
            bad = int(np.argwhere(np.isinf(frames))[0, 0])
            raise FormatError(f"{self.location}, message {kept[bad]}: a value is infinite, or does not fit 32 bits")
        bag, stamps = np.array(self.times, np.int64)[kept].T
        right = (stamps > 0) & (np.abs(bag.astype(np.float64) - stamps) <= _DAY_NS)
        found = repaired(np.where(right, stamps, bag) // 1000)
        by_the_bag = int((~right).sum())
        are_few = 2 * len(np.unique(stamps)) < len(stamps)
        if are_few or right.mean() < _MOST or found.wrong > (1 - _MOST) * len(kept):
            by_the_bag, found = len(kept), repaired(bag // 1000)
        frames = frames if found.order is None else frames[found.order]
        lost = [f"{left_out} of {counted(len(self.values), 'message')} are left out, of another length"] * (
            left_out > 0
        )
        if stamps.any() and by_the_bag:
            lost.append(
                f"{by_the_bag} of {counted(len(kept), 'message')} have the time of the bag: their stamps are wrong"
            )
        lost += found.said
        for line in lost:
            warn(f"{self.path}: topic {self.topic}: {line}", stacklevel=6)
        others = [f"other topics of the bag: {', '.join(unread)}"] * bool(unread)
        unit = "counts" if rows.dtype.kind in "ui" else "as sent"
        table = Frames(frozen_whole(frames.reshape(-1, *array.shape)), frozen_whole(found.t), unit=unit, array=array)
        limited(self.location, table)
        remarks = () if stamps.any() else ("the times are those of the bag, because the messages have no header",)
        source = self.topic + f".{self.field}" * bool(self.field) + f" ({self.type})"
        facts = Facts(
            path=self.path, array=array, kind="ros", label=name, source=source, remarks=remarks, lost=(*lost, *others)
        )
        counts = {"messages": len(kept), "messages_of_another_length": left_out, "times_by_the_bag": by_the_bag}
        return InMemory(facts, table, counted=counts)

    def _stated(self) -> Array:
        """Return the most frequent length: in rows and columns as most of its messages state them, else in one row."""
        lengths = Counter(value.shape for value in self.values if value.size)
        ((most, _),) = lengths.most_common(1)
        stated = Counter(g for value, g in zip(self.values, self.grids, strict=True) if g and value.shape == most)
        rows, columns = stated.most_common(1)[0][0] if stated else (1, int(np.prod(most)))
        try:
            return Array(rows, columns, name=self.topic, names=self.names or None)
        except ProblemError as error:
            raise FormatError(f"{self.location}: {most} values each: {first_line(error)}") from None
