"""The topics of a ROS bag that hold numbers: fields, shapes and rates, by their first message with numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._core import FormatError
from taxel.formats.ros.bag import open_bag
from taxel.formats.ros.fields import grid, leaves

__all__ = ["Topic", "topics"]


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
    FormatError : damaged, or of a kind that rosbags does not read
    ProblemError : an unknown release
    """
    with open_bag(path, ros) as bag:
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
            found = [(field, content) for field, content in leaves(first) if content.size > 1]
        except FormatError as error:
            yield Topic(topic, kind, "", (), "", count, None, str(error))
            return
    span = np.ptp(times) / 1e9 if times else 0.0
    rate = (len(times) - 1) / span if span > 0 else None
    for field, content in found:
        shape = grid(first, field) or content.shape
        yield Topic(topic, kind, field, shape, content.dtype.name, len(times), rate)
