"""The topics of a ROS bag that hold numbers: fields, shapes and rates."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from taxel._core import FormatError
from taxel.formats.ros.bag import Bag, opened
from taxel.formats.ros.fields import grid, is_empty, leaves

__all__ = ["Topic", "topics"]


@dataclass(frozen=True)
class Topic:
    """Describe a field of a ROS topic that holds numbers, by the topic's first message.

    Parameters
    ----------
    topic, type, field : str
        `field` is "" for a topic of images; for one without a definition too.
    shape : tuple of int
        Its numbers (n,), or its rows and columns if the message states them; empty if unknown.
    dtype : str
        As "int16"; "" if unknown.
    messages : int
    rate_hz : float, Hz, optional
        By the bag's times; None with fewer messages than two.
    trouble : str
        Why it cannot be read: its type has no definition, or its images several channels; "" if it can.
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
        A release of ROS, as "humble", whose types are used for those that neither defines.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, or of a kind that rosbags does not read
    ProblemError : an unknown release, or a folder without definitions
    """
    with opened(path, types, ros) as bag:
        return [one for topic in sorted({c.topic for c in bag.reader.connections}) for one in _of_topic(bag, topic)]


def _of_topic(bag: Bag, topic: str) -> list[Topic]:
    """Return the fields of a topic by its first message, or by the first whose arrays are not empty; count all."""
    connections = [one for one in bag.reader.connections if one.topic == topic]
    kind = connections[0].msgtype
    undefined = bag.undefined(kind)
    if undefined:
        count = sum(one.msgcount for one in connections)
        return [Topic(topic, kind, "", (), "", count, None, f"no definition of {undefined}")]
    first: Any = None
    found: list[tuple[str, NDArray[Any]]] = []
    times: list[int] = []
    for connection, at, data in bag.messages(connections):
        # Some publishers send empty arrays before they have a reading.
        if first is None or is_empty(found):
            first = bag.decoded(connection, data)
            try:
                found = list(leaves(first))
            except FormatError as error:
                return [Topic(topic, kind, "", (), "", sum(c.msgcount for c in connections), None, str(error))]
            if not any(held.size > 1 for _, held in found) and not is_empty(found):
                return []
        times.append(at)
    if first is None:
        return []
    span = (max(times) - min(times)) / 1e9
    rate = (len(times) - 1) / span if span > 0 else None
    return [
        Topic(topic, kind, field, grid(first, field) or held.shape, held.dtype.name, len(times), rate)
        for field, held in found
        if held.size > 1
    ]
