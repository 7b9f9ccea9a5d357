"""Reads chosen topics of a ROS bag: each as a source of pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from taxel._base import arguments
from taxel._base.messages import counted
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats import ros
from taxel.frames import Frames
from taxel.recording.contents import Contents, alone
from taxel.recording.read_mcap import ascending

__all__ = ["Topics", "read_ros"]


@dataclass(frozen=True)
class Topics:
    """Choose what of a ROS bag is opened.

    Parameters
    ----------
    topic, field : str, or list of str, optional
        As many of each, or one of either for all.
    types : path, optional
        A folder of .msg or .idl files.
    ros : str, optional
        A release of ROS.

    Raises
    ------
    ProblemError : no text, or more fields than topics
    """

    topic: object = None
    field: object = None
    types: object = None
    ros: object = None

    def __post_init__(self) -> None:
        for name in ("topic", "field"):
            given = getattr(self, name)
            entries = [given] if isinstance(given, str) else [] if given is None else arguments.several(name, given)
            object.__setattr__(self, name, [arguments.text(name, one) for one in entries])
        object.__setattr__(self, "types", None if self.types is None else Path(arguments.path("types", self.types)))
        object.__setattr__(self, "ros", None if self.ros is None else arguments.text("ros", self.ros))

    def __bool__(self) -> bool:
        return any((self.topic, self.field, self.types, self.ros))

    def chosen(self, array: Array | Sequence[Array] | None) -> list[ros.Chosen]:
        """Return each topic with its field and its array."""
        given = {"topic": self.topic, "field": self.field, "array": _arrays(array)}
        count = max(map(len, given.values()))
        for name, entries in given.items():
            if len(entries) not in (0, 1, count):
                raise ProblemError(f"{name}: given {len(entries)} times for {count} sources; must be once, or for each")
        columns = (entries * count if len(entries) == 1 else entries or [None] * count for entries in given.values())
        return [ros.Chosen(*one) for one in zip(*columns, strict=True)]


def _arrays(array: Array | Sequence[Array] | None) -> list[Array]:
    if array is None or isinstance(array, Array):
        return [] if array is None else [array]
    return [arguments.instance("array", one, Array) for one in arguments.several("array", array)]


def read_ros(path: Path, topics: Topics, array: Array | Sequence[Array] | None) -> Contents:
    """Return the contents of a ROS bag: those of its only chosen topic, or of several sources.

    Raises
    ------
    ImportError : rosbags is not installed
    FormatError : no topic is chosen, or as `taxel.formats.ros.read`
    """
    if not topics.topic:
        raise FormatError(
            f"{path}: a ROS bag; say what to open of it: --topic NAME --field NAME (topic=, field=); taxel info lists "
            "its topics"
        )
    reads = ros.read(path, topics.chosen(array), topics.types, topics.ros)
    sources: dict[str, Contents] = {}
    for name, one in zip(_names(path, reads), reads, strict=True):
        sources[name] = Contents(
            path,
            path.name,
            "ros",
            one.array,
            label=name,
            source=one.topic + f".{one.field}" * bool(one.field) + f" ({one.type})",
            frames=Frames(one.values, ascending(one.t), unit=one.unit, array=one.array),
            counts={
                "messages": len(one.t),
                "messages_of_another_length": one.left_out,
                "times_by_the_bag": one.by_the_bag,
            },
            verdict=_verdict(one),
            sources=sources,
        )
    return alone(sources)


def _names(path: Path, reads: Sequence[ros.Read]) -> list[str]:
    """Return the names of sources: their topics, with the field where a topic is opened twice."""
    topics = [one.topic.strip("/") for one in reads]
    names = [f"{t}.{one.field}" if topics.count(t) > 1 else t for t, one in zip(topics, reads, strict=True)]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ProblemError(f"{path}: {twice} is chosen twice")
    return names


def _verdict(one: ros.Read) -> str:
    """Return in one line what was left out, and whose times stand in for a header's."""
    parts = []
    if one.left_out:
        parts.append(f"{counted(one.left_out, 'message')} of another length left out")
    if one.by_the_bag:
        parts.append(
            f"{one.by_the_bag} of {counted(len(one.t), 'message')} at the bag's time, as stamps are 0 or step back"
        )
    if not one.has_stamps:
        parts.append("at the bag's times, as its messages have no header")
    return "; ".join(parts) or "nothing left out"
