"""The topics of a ROS bag that hold numbers: fields, shapes and rates, by a message of the most frequent length."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from taxel._core import FormatError
from taxel.formats.ros.bag import Bag, open_bag
from taxel.formats.ros.fields import grid, leaves

__all__ = ["Topic", "topics"]

#: How many lengths of a topic's messages are looked at, in bytes, by the first message of each: lengths of clouds and
#: texts may all differ.
_MOST_LENGTHS = 32


@dataclass(frozen=True)
class Topic:
    """Describe a field of a ROS topic that holds numbers, by the topic's first message of the most frequent length.

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


def topics(path: Path, types: Path | None = None, ros: str | None = None) -> list[Topic]:
    """Return the fields of a bag's topics that hold more numbers than one.

    Parameters
    ----------
    path : Path
    types : Path, optional
        A folder of .msg or .idl files, for types that the bag does not define.
    ros : str, optional
        A release of ROS, for example "humble", whose types are used if neither bag nor folder defines them.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, or of a kind that rosbags does not read
    ProblemError : an unknown release, or a folder without definitions
    """
    with open_bag(path, types, ros) as bag:
        return [each for topic in sorted({c.topic for c in bag.reader.connections}) for each in _of_topic(bag, topic)]


def _of_topic(bag: Bag, topic: str) -> list[Topic]:
    """Return the fields of a topic by the first message of the most frequent length that has numbers; count all."""
    connections = [connection for connection in bag.reader.connections if connection.topic == topic]
    kind = connections[0].msgtype
    undefined = bag.undefined(kind)
    if undefined:
        count = sum(connection.msgcount for connection in connections)
        return [Topic(topic, kind, "", (), "", count, None, f"no definition of {undefined}")]
    lengths: Counter[int] = Counter()
    firsts: dict[int, tuple[Any, bytes]] = {}
    times: list[int] = []
    for connection, at, data in bag.messages(connections):
        lengths[len(data)] += 1
        if len(firsts) < _MOST_LENGTHS:
            firsts.setdefault(len(data), (connection, data))
        times.append(at)
    found: list[tuple[str, NDArray[Any]]] = []
    for length in sorted(firsts, key=lambda size: -lengths[size]):
        first = bag.decoded(*firsts[length])
        try:
            found = list(leaves(first))
        except FormatError as error:
            return [Topic(topic, kind, "", (), "", sum(c.msgcount for c in connections), None, str(error))]
        if any(content.size > 1 for _, content in found):
            break
    else:
        return []
    span = (max(times) - min(times)) / 1e9
    rate = (len(times) - 1) / span if span > 0 else None
    return [
        Topic(topic, kind, field, grid(first, field) or content.shape, content.dtype.name, len(times), rate)
        for field, content in found
        if content.size > 1
    ]
