"""Reads chosen topics of a ROS bag: each as a source of frames."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from taxel._base import arguments
from taxel._base.columns import frozen_whole
from taxel._base.errors import helped, refused
from taxel._base.messages import counted, warn
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.ros import Chosen, Read, read
from taxel.frames import Frames
from taxel.labels import source_of
from taxel.reading import Facts, InMemory, Reader
from taxel.recording.readers.mcap import ascending


@dataclass(frozen=True)
class Topics:
    """Choose what of a ROS bag is opened; the arguments are those of `taxel.open`.

    Raises
    ------
    ProblemError : not a text, or more fields than topics
    """

    topic: str | Sequence[str] | None
    field: str | Sequence[str] | None
    types: str | os.PathLike[str] | None
    ros: str | None

    def __post_init__(self) -> None:
        for name in ("topic", "field"):
            _texts(name, getattr(self, name))
        if self.types is not None:
            arguments.checked_path("types", self.types)
        if self.ros is not None:
            arguments.text("ros", self.ros)

    @property
    def are_given(self) -> bool:
        """Whether any of them is."""
        return any(option is not None for option in (self.topic, self.field, self.types, self.ros))

    def but(self, of_layout: Mapping[str, Any]) -> Topics:
        """Return what is given, and what a layout says of the rest."""
        return replace(self, **{name: value for name, value in of_layout.items() if getattr(self, name) is None})

    @property
    def folder(self) -> Path | None:
        """The folder of definitions."""
        return None if self.types is None else Path(self.types)

    def chosen(self, array: Array | Sequence[Array] | None) -> list[Chosen]:
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
        return [Chosen(*choice) for choice in zip(topics, every_field, every_array, strict=True)]


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
    """Return a reader of each chosen topic of a ROS bag.

    Raises
    ------
    ImportError : rosbags is not installed
    FormatError : no topic is chosen, or as `taxel.formats.ros.read`
    """
    if not topics.topic:
        error = FormatError(
            f"{path}: is a ROS bag; choose one of its topics, or write [ros] in a layout file; to list the topics, run "
            f"taxel info {path}"
        )
        raise helped(error, "topic", "give")
    reads = read(path, topics.chosen(array), topics.folder, topics.ros)
    readers = list[Reader]()
    for name, topic in zip(_names(path, reads), reads, strict=True):
        left_out = tuple(_lines_of_losses(topic))
        for line in left_out:
            warn(f"{path}: topic {topic.topic}: {line}", stacklevel=6)
        others = (f"other topics of the bag: {', '.join(topic.unread)}",) * bool(topic.unread)
        frames = Frames(
            frozen_whole(topic.values), frozen_whole(ascending(topic.t)), unit=topic.unit, array=topic.array
        )
        facts = Facts(
            path=path,
            array=topic.array,
            kind="ros",
            label=name,
            source=topic.topic + f".{topic.field}" * bool(topic.field) + f" ({topic.type})",
            remarks=()
            if topic.has_stamps
            else ("the times are those of the bag, because the messages have no header",),
            lost=(*left_out, *others),
        )
        counts = {
            "messages": len(topic.t),
            "messages_of_another_length": topic.left_out,
            "times_by_the_bag": topic.by_the_bag,
        }
        readers.append(InMemory(facts, frames, counted=counts))
    return readers


def _names(path: Path, reads: Sequence[Read]) -> list[str]:
    """Return the names of sources: their topics (/palm/left: palm_left), with the field where one is opened twice."""
    topics = [read.topic.strip("/") for read in reads]
    full_names = [f"{t}.{read.field}" if topics.count(t) > 1 else t for t, read in zip(topics, reads, strict=True)]
    names = [source_of(name) for name in full_names]
    for k, name in enumerate(names):
        if name in names[:k]:
            also = full_names[names.index(name)]
            raise ProblemError(
                f"{path}: {also} is chosen twice"
                if also == full_names[k]
                else f"{path}: {also} and {full_names[k]} would both have the name {name}; open one at a time"
            )
    return names


def _lines_of_losses(topic: Read) -> Iterator[str]:
    """Yield what was left out, and how many of the stamps were wrong."""
    if topic.left_out:
        total = counted(topic.left_out + len(topic.t), "message")
        rows, columns = topic.array.shape
        yield f"{topic.left_out} of {total} are left out, because they do not have {rows} x {columns} values"
    if topic.by_the_bag:
        yield (
            f"{topic.by_the_bag} of {counted(len(topic.t), 'message')} have the time of the bag, because their "
            f"stamps are "
            "0, do not ascend, or are far from that time"
        )
