"""Pictures of chosen topics of a ROS bag, with the times of their messages."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import Growing
from taxel._base.limits import TIME_US, VALUE
from taxel._core import FormatError
from taxel.array import Array
from taxel.formats.checks import sensor
from taxel.formats.ros.bag import Bag, opened
from taxel.formats.ros.fields import grid, is_empty, leaves, values

__all__ = ["Chosen", "Read", "read"]


@dataclass(frozen=True)
class Chosen:
    """Choose a field of a topic.

    Parameters
    ----------
    topic : str
    field : str, optional
        A path, as "left.taxels"; default: the topic's only field with numbers.
    array : Array, optional
        Messages of another length are left out; default: rows and columns where the message states them, else one row
        of as many taxels as most messages have.
    """

    topic: str
    field: str | None = None
    array: Array | None = None


@dataclass(frozen=True, eq=False)
class Read:
    """Hold the pictures of a field.

    Parameters
    ----------
    topic, field, type : str
    array : Array
    values : float32, shape (n, rows, columns)
    unit : str
        "counts" of whole numbers, else "as sent".
    t : int64, shape (n,), us since 1970 as a rule
        The header's stamp, or the bag's time; it never falls.
    has_stamps : bool
        Whether the messages have a header.
    by_the_bag : int
        How many of them have the bag's time, as their stamp is 0 or not after the ones before.
    left_out : int
        How many messages have another length.
    unread : tuple of str
        The other topics of the bag, those that were chosen aside.
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
    """Return the pictures of each chosen field, from one pass through the bag.

    Parameters
    ----------
    path : Path
    chosen : sequence of Chosen
    types, ros : Path and str, optional
        As of `topics`.

    Raises
    ------
    ImportError : rosbags is not installed (``pip install 'taxel[ros]'``)
    FormatError : damaged, no such topic or field, no definition of its messages, or no message of the array's length
    ProblemError : an unknown release, or a folder without definitions
    """
    with opened(path, types, ros) as bag:
        connections = {one.topic: bag.of_topic(one.topic) for one in chosen}
        held = [_Held(bag, one) for one in chosen]
        for connection, at, data in bag.messages([c for each in connections.values() for c in each]):
            try:
                message = bag.decoded(connection, data)
            except Exception as error:  # rosbags' own, and those of bytes that it does not expect
                raise FormatError(f"{path}: a message of topic {connection.topic} at {at} ns: {error}") from None
            for one in held:
                if one.topic == connection.topic:
                    one.add(message, at)
        unread = tuple(sorted(bag.topics() - connections.keys()))
        return [one.read(connections[one.topic][0].msgtype, unread) for one in held]


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
        self.numbers = Growing(self.place, numbers=((), np.float32))
        self.bag_ns: list[int] = []
        self.stamps_ns: list[int | None] = []
        self.stated: tuple[int, int] | None = None
        self.unit = "as sent"

    @property
    def place(self) -> str:
        return f"{self.bag.path}: topic {self.topic}" + f", field {self.field}" * bool(self.field)

    def add(self, message: Any, at: int) -> None:
        """Add a message."""
        try:
            if self.field is None and not is_empty(list(leaves(message))):
                self.field = self._only_field(message)
            # Before a first reading there may be no field to choose by; such messages are of another length.
            numbers = np.empty(0) if self.field is None else self._numbers(message, self.field)
        except FormatError as error:
            raise FormatError(f"{self.place}: {error}") from None
        if numbers.size and not any(one.size for one in self.values):
            self.stated = None if self.field is None else grid(message, self.field)
            self.unit = "counts" if numbers.dtype.kind in "ui" else "as sent"
        if numbers.dtype.kind == "f" and (np.abs(numbers) > VALUE).any():
            raise FormatError(
                f"{self.place}, message {len(self.values)}: a value is infinite, or too large for 32 bits"
            )
        self.values.append(_Shape(numbers.shape, numbers.size, numbers.ndim))
        self.numbers.add(numbers=numbers.reshape(-1))
        self.bag_ns.append(at)
        header = getattr(message, "header", None)
        stamp = getattr(header, "stamp", None)
        self.stamps_ns.append(None if stamp is None else int(stamp.sec) * 10**9 + int(stamp.nanosec))

    def _only_field(self, message: Any) -> str:
        there = [path for path, numbers in leaves(message) if numbers.size > 1]
        if not there:
            raise FormatError("no field with more numbers than one; taxel info lists topics that have one")
        if len(there) != 1:
            raise FormatError(f"say which field (--field NAME, field=); there are {_there(message)}")
        return there[0]

    @staticmethod
    def _numbers(message: Any, field: str) -> NDArray[Any]:
        try:
            return values(message, field)
        except LookupError:
            raise FormatError(f"no field with numbers; there are {_there(message)}") from None

    def read(self, kind: str, unread: tuple[str, ...]) -> Read:
        """Return the pictures of the messages."""
        if not self.values:
            raise FormatError(f"{self.place}: holds no message")
        array = sensor(self.place, self.array or self._stated())
        fits = np.array([_fits(one, array) for one in self.values])
        if not fits.any():
            some = self.values[0]
            size = " x ".join(map(str, some.shape)) if some.ndim == 2 else f"{some.size}"
            raise FormatError(
                f"{self.place}: its messages hold {size} values; the array has {array.rows} x {array.columns}"
            )
        bag = np.array(self.bag_ns, np.int64)[fits]
        stamps = [stamp for stamp, fit in zip(self.stamps_ns, fits, strict=True) if fit]
        order = np.argsort(bag, kind="stable")  # files of a bag may overlap
        bag, pictures = bag[order], self._pictures(np.flatnonzero(fits)[order], array)
        has_stamps = None not in stamps
        t, by_the_bag = _times(np.array(stamps, np.int64)[order], bag) if has_stamps else (bag, 0)
        if np.abs(t).max() // 1000 > TIME_US:
            raise FormatError(f"{self.place}: a message at {t[np.abs(t).argmax()]} ns; must lie within 142 years of 0")
        return Read(
            self.topic,
            self.field or "",
            kind,
            array,
            pictures,
            self.unit,
            t // 1000,
            has_stamps,
            by_the_bag,
            int(np.count_nonzero(~fits)),
            unread,
        )

    def _pictures(self, chosen: NDArray[np.int64], array: Array) -> NDArray[np.float32]:
        """Return the numbers of messages as pictures; those that are read in their order are moved, not copied."""
        begins = np.concatenate([[0], np.cumsum([one.size for one in self.values])])
        numbers, size = self.numbers.column("numbers"), array.rows * array.columns
        if (np.diff(chosen) > 0).all():
            numbers.setflags(write=True)
            held = numbers[: len(chosen) * size]
        else:
            held = np.empty(len(chosen) * size, np.float32)
        for k, begin in enumerate(begins[chosen]):
            if held is not numbers or begin != k * size:
                held[k * size : (k + 1) * size] = numbers[begin : begin + size]
        return held.reshape(-1, *array.shape)

    def _stated(self) -> Array:
        """Return rows and columns as the first message states them, else one row of the most frequent length."""
        lengths = Counter(one.size for one in self.values if one.size)
        if not lengths:
            raise FormatError(f"{self.place}: its messages hold no values")
        rows, columns = self.stated or (1, lengths.most_common(1)[0][0])
        return Array(rows, columns, name=self.topic)


def _fits(numbers: _Shape, array: Array) -> bool:
    """Return whether a message's numbers are a picture of an array: as many, and an image of its rows and columns."""
    return numbers.shape == array.shape if numbers.ndim == 2 else numbers.size == array.rows * array.columns


def _there(message: Any) -> str:
    return ", ".join(path for path, numbers in leaves(message) if numbers.size > 1) or "none with more than one number"


def _times(stamps: NDArray[np.int64], bag: NDArray[np.int64]) -> tuple[NDArray[np.int64], int]:
    """Return times in ns by the headers' stamps, and how many are the bag's instead.

    The bag's time stands where a stamp is 0 or not after all before it. It is later than the stamp by the time that the
    message was under way; if it would come after the next message's, it is used less the median of that delay. Where
    that does not ascend either (the stamps' clock was set back), all messages have the bag's times.
    """
    before = np.concatenate([[0], np.maximum.accumulate(stamps)[:-1]])
    good = stamps > before
    if good.any():
        for late in (0, int(np.median((bag - stamps)[good]))):
            t = np.where(good, stamps, bag - late)
            if (np.diff(t) > 0).all():
                return t, int(np.count_nonzero(~good))
    return bag, len(bag)
