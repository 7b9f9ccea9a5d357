"""Frames of chosen topics of a ROS bag, with the times of their messages.

A single odd message does not decide for all: the majority decides which length is read, and whether stamps count.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import Growing
from taxel._base.errors import helped
from taxel._base.limits import TIME_US, VALUE
from taxel._base.messages import first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.checks import sensor
from taxel.formats.ros.bag import Bag, open_bag
from taxel.formats.ros.fields import grid, is_empty, leaves, values

__all__ = ["Chosen", "Read", "read"]

#: A stamp that is further from the bag's time of its message is wrong, ns.
_DAY_NS = 86_400 * 10**9

#: Nor is a first or last one sound that is further off the others' median delay, ns.
_SECOND_NS = 10**9


@dataclass(frozen=True)
class Chosen:
    """Choose a field of a topic.

    Parameters
    ----------
    topic : str
    field : str, optional
        A path, for example "left.taxels"; default: the topic's only field with numbers.
    array : Array, optional
        Messages of another length are left out; default: the length of most messages, in the rows and columns that
        they state, else in one row.
    """

    topic: str
    field: str | None = None
    array: Array | None = None


@dataclass(frozen=True, eq=False)
class Read:
    """Hold the frames of a field.

    Parameters
    ----------
    topic, field, type : str
    array : Array
    values : float32, shape (n, rows, columns)
    unit : str
        "counts" for whole numbers, else "as sent".
    t : int64, shape (n,), us since 1970 as a rule
        The header's stamp, or the bag's time; it never falls.
    has_stamps : bool
        Whether the messages have a header.
    by_the_bag : int
        Number of messages with the bag's time, because their stamp, or the stamps of most messages, are wrong.
    left_out : int
        Number of messages that have another length.
    unread : tuple of str
        The other topics of the bag, without the chosen ones.
    """

    topic: str
    field: str
    type: str
    array: Array
    values: NDArray[np.float32]
    unit: str
    t: NDArray[np.int64]
    has_stamps: bool
    by_the_bag: int
    left_out: int
    unread: tuple[str, ...]


def read(path: Path, chosen: Sequence[Chosen], types: Path | None = None, ros: str | None = None) -> list[Read]:
    """Return the frames of each chosen field, from one pass through the bag.

    Parameters
    ----------
    path : Path
    chosen : sequence of Chosen
    types, ros : Path and str, optional
        As in `topics`.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, no such topic or field, no definition of its messages, or no message of the array's length
    ProblemError : an unknown release, or a folder without definitions
    """
    with open_bag(path, types, ros) as bag:
        connections = {choice.topic: bag.of_topic(choice.topic) for choice in chosen}
        topics = [_Held(bag, choice) for choice in chosen]
        for connection, at, data in bag.messages([c for each in connections.values() for c in each]):
            try:
                message = bag.decoded(connection, data)
            except Exception as error:  # rosbags' own, and those of bytes that it does not expect
                raise FormatError(f"{path}: a message of topic {connection.topic} at {at} ns: {error}") from None
            for held_topic in topics:
                if held_topic.topic == connection.topic:
                    held_topic.add(message, at)
        unread = tuple(sorted(bag.topics() - connections.keys()))
        return [topic.read(connections[topic.topic][0].msgtype, unread) for topic in topics]


class _Shape(NamedTuple):
    """The shape of a message's numbers, named as NumPy names it."""

    shape: tuple[int, ...]
    size: int
    ndim: int


class _Held:
    """The messages of one field so far."""

    def __init__(self, bag: Bag, chosen: Chosen) -> None:
        self.bag, self.array = bag, chosen.array
        self.topic, self.field = chosen.topic, chosen.field
        #: The shape of each message's numbers, and all numbers one after the other.
        self.values: list[_Shape] = []
        self.numbers = Growing(self.location, numbers=((), np.float32))
        self.bag_ns: list[int] = []
        self.stamps_ns: list[int | None] = []
        self.grids: list[tuple[int, int] | None] = []
        self.are_whole: list[bool] = []
        #: Why a message has no numbers to read: those of most may have some.
        self.trouble = ""

    @property
    def location(self) -> str:
        return f"{self.bag.path}: topic {self.topic}" + f", field {self.field}" * bool(self.field)

    def add(self, message: Any, at: int) -> None:
        """Add a message."""
        try:
            if self.field is None:
                self.field = self._only_field(message)
            # Before a first reading there may be no field to choose by; such messages are of another length.
            numbers = np.empty(0) if self.field is None else self._numbers(message, self.field)
        except FormatError as error:
            raise FormatError(f"{self.location}: {error}") from None
        self.grids.append(None if self.field is None else grid(message, self.field))
        self.are_whole.append(numbers.dtype.kind in "ui")
        if numbers.dtype.kind == "f" and (np.abs(numbers) > VALUE).any():
            raise FormatError(
                f"{self.location}, message {len(self.values)}: a value is infinite, or does not fit 32 bits"
            )
        self.values.append(_Shape(numbers.shape, numbers.size, numbers.ndim))
        self.numbers.add(numbers=numbers.reshape(-1))
        self.bag_ns.append(at)
        header = getattr(message, "header", None)
        stamp = getattr(header, "stamp", None)
        self.stamps_ns.append(None if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec))

    def _only_field(self, message: Any) -> str | None:
        """Return the field of a message that holds more numbers than one; None of a message without any."""
        found = list(leaves(message))
        there = [path for path, numbers in found if numbers.size > 1]
        if len(there) > 1:
            raise helped(FormatError(f"has several fields with numbers: {_there(message)}"), "field", "give")
        if not there and not is_empty(found):
            self.trouble = "no field has more than one number; to find topics with such a field, run taxel info"
        return there[0] if there else None

    def _numbers(self, message: Any, field: str) -> NDArray[Any]:
        try:
            return values(message, field)
        except LookupError:
            self.trouble = f"the field has no numbers; fields with numbers: {_there(message)}"
            return np.empty(0)

    def read(self, kind: str, unread: tuple[str, ...]) -> Read:
        """Return the frames of the messages."""
        if not self.values:
            raise FormatError(f"{self.location}: contains no message")
        if self.trouble and not any(value.size for value in self.values):
            raise FormatError(f"{self.location}: {self.trouble}")
        array = sensor(self.location, self.array or self._stated())
        fits = np.array([_fits(value, array) for value in self.values])
        if not fits.any():
            some = next((value for value in self.values if value.size), self.values[0])
            size = " x ".join(map(str, some.shape)) if some.ndim == 2 else f"{some.size}"
            raise FormatError(
                f"{self.location}: the messages have {size} values each; the array has {array.rows} x "
                f"{array.columns} taxels"
            )
        bag = np.array(self.bag_ns, np.int64)[fits]
        stamps = [stamp for stamp, fit in zip(self.stamps_ns, fits, strict=True) if fit]
        order = np.argsort(bag, kind="stable")  # files of a bag may overlap
        bag, frames = bag[order], self._frames(np.flatnonzero(fits)[order], array)
        has_stamps = None not in stamps
        t, by_the_bag = _times(np.array(stamps, np.int64)[order], bag) if has_stamps else (bag, 0)
        if np.abs(t).max() // 1000 > TIME_US:
            raise FormatError(
                f"{self.location}: a message has the time {t[np.abs(t).argmax()]} ns; must be within 142 years of 0"
            )
        return Read(
            self.topic,
            self.field or "",
            kind,
            array,
            frames,
            "counts" if all(is_whole for is_whole, fit in zip(self.are_whole, fits, strict=True) if fit) else "as sent",
            t // 1000,
            has_stamps,
            by_the_bag,
            int(np.count_nonzero(~fits)),
            unread,
        )

    def _frames(self, chosen: NDArray[np.int64], array: Array) -> NDArray[np.float32]:
        """Return the numbers of messages as frames; those that are read in their order are moved, not copied."""
        begins = np.concatenate([[0], np.cumsum([value.size for value in self.values])])
        numbers, size = self.numbers.column("numbers"), array.rows * array.columns
        if (np.diff(chosen) > 0).all():
            numbers.setflags(write=True)
            chosen_values = numbers[: len(chosen) * size]
        else:
            chosen_values = np.empty(len(chosen) * size, np.float32)
        for k, begin in enumerate(begins[chosen]):
            if chosen_values is not numbers or begin != k * size:
                chosen_values[k * size : (k + 1) * size] = numbers[begin : begin + size]
        return chosen_values.reshape(-1, *array.shape)

    def _stated(self) -> Array:
        """Return the most frequent length: in rows and columns as most of its messages state them, else in one row."""
        lengths = Counter(value.shape for value in self.values if value.size)
        if not lengths:
            raise FormatError(f"{self.location}: the messages contain no values")
        ((most, _),) = lengths.most_common(1)
        stated = Counter(g for value, g in zip(self.values, self.grids, strict=True) if g and value.shape == most)
        rows, columns = stated.most_common(1)[0][0] if stated else (1, most[0])
        try:
            return Array(rows, columns, name=self.topic)
        except ProblemError as error:
            raise FormatError(
                f"{self.location}: the messages have {math.prod(most)} values each: {first_line(error)}"
            ) from None


def _fits(numbers: _Shape, array: Array) -> bool:
    """Return whether a message's numbers are a frame of an array: as many, and an image of its rows and columns."""
    return numbers.shape == array.shape if numbers.ndim == 2 else numbers.size == array.rows * array.columns


def _there(message: Any) -> str:
    return ", ".join(path for path, numbers in leaves(message) if numbers.size > 1) or "none with more than one number"


def _times(stamps: NDArray[np.int64], bag: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return times in ns, which never fall, by the headers' stamps; and how many are the bag's instead.

    Sound stamps are above 0, within a day of the bag's time of their message, and ascend. The first and the last are
    not sound if their delay is off the median delay by more than a second, and by ten times as much as any other.
    Where less than half are sound, all messages have the bag's times, else those whose stamp is wrong. The bag's
    time is later than the stamp by the time that the message was under way: where it would come after the next
    message's, it is used less the median of that delay, and at most that next time.
    """
    near = np.flatnonzero((stamps > 0) & (np.abs(bag.astype(np.float64) - stamps) <= _DAY_NS))
    sound = near[_ascending(stamps[near].tolist())]
    # No stamp beside a first or last one bounds it: it is compared with the delays of the others.
    for end, rest in ((0, slice(1, None)), (-1, slice(-1))):
        delays = (bag - stamps)[sound].astype(np.float64)
        off = np.abs(delays - np.median(delays)) if len(sound) > 2 else np.zeros(3)
        if off[end] > max(_SECOND_NS, 10 * off[rest].max()):
            near = near[near != sound[end]]
            sound = near[_ascending(stamps[near].tolist())]
    if 2 * len(sound) < len(stamps):
        return bag, len(bag)
    t, late = stamps.copy(), int(np.median((bag - stamps)[sound]))
    wrong = np.setdiff1d(np.arange(len(stamps)), sound)
    for run in np.split(wrong, np.flatnonzero(np.diff(wrong) > 1) + 1) if len(wrong) else ():
        before, after = t[: run[0]][-1:], stamps[run[-1] + 1 :][:1]
        candidates = [np.concatenate([before, bag[run] - less, after]) for less in (0, late)]
        fits = next((stamps for stamps in candidates if (np.diff(stamps) > 0).all()), None)
        low, high = before[0] if len(before) else None, after[0] if len(after) else None
        t[run] = np.clip(bag[run] - late, low, high) if fits is None else fits[len(before) :][: len(run)]
    return t, len(wrong)


def _ascending(times: Sequence[int]) -> list[int]:
    """Return the places of the most times that ascend; of several such choices the one of the latest times."""
    # From the end, as in patience sorting: for each length the place where the best choice of that length begins.
    begins: list[int] = []
    falling: list[int] = []
    after = [-1] * len(times)
    for k in reversed(range(len(times))):
        at = bisect_left(falling, -times[k])
        after[k] = begins[at - 1] if at else -1
        begins[at : at + 1], falling[at : at + 1] = [k], [-times[k]]
    chosen = begins[-1:]
    while chosen and after[chosen[-1]] >= 0:
        chosen.append(after[chosen[-1]])
    return chosen
