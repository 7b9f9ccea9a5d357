"""Numbers in a message: found by the path of a field, and as the frames of an image."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._core import FormatError

__all__ = ["IMAGE", "grid", "is_empty", "leaves", "values"]

IMAGE = "sensor_msgs/msg/Image"
#: Messages that hold bytes, not numbers, and how they could be read.
_BYTES = {
    "sensor_msgs/msg/CompressedImage": "the messages are compressed images, which taxel does not read; record them as "
    "sensor_msgs/Image with one channel",
    "sensor_msgs/msg/PointCloud2": "the messages are clouds of points, which taxel does not read; record the readings "
    "as an array or an image",
}
#: Types whose numbers are no readings: times, shapes, and bytes.
_WITHOUT_READINGS = (
    "std_msgs/msg/Header",
    "std_msgs/msg/MultiArrayLayout",
    "builtin_interfaces/msg/Time",
    "builtin_interfaces/msg/Duration",
    *_BYTES,
)
#: What one pixel is, by encoding (sensor_msgs/image_encodings), of those with one channel.
_PIXELS = {
    **dict.fromkeys(("mono8", "8UC1"), "u1"),
    **dict.fromkeys(("mono16", "16UC1"), "u2"),
    **dict(zip(("8SC1", "16SC1", "32SC1", "32FC1", "64FC1"), ("i1", "i2", "i4", "f4", "f8"), strict=True)),
}


def leaves(message: Any, path: str = "", *, listed: bool = False) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the fields of a message that hold numbers, each with its path; a single number only in a list of messages.

    A part of the messages of a list is one field: ``sensors.taxels`` are the taxels of all sensors, in their order.

    Raises
    ------
    FormatError : the message is an image that is not read, or holds bytes
    """
    if not path and _type(message) in _BYTES:
        raise FormatError(_BYTES[_type(message)])
    if isinstance(message, np.ndarray) or _type(message) == IMAGE:
        yield path, values(message, "")
    elif isinstance(message, list):
        for inner, _ in leaves(message[0], listed=True) if message and is_dataclass(message[0]) else ():
            yield f"{path}.{inner}", values(message, inner)
    elif is_dataclass(message):
        for field in fields(message) if _type(message) not in _WITHOUT_READINGS else ():
            yield from leaves(getattr(message, field.name), f"{path}.{field.name}".lstrip("."), listed=listed)
    elif listed and isinstance(message, int | float | np.number):
        yield path, values(message, "")


def is_empty(found: Sequence[tuple[str, NDArray[Any]]]) -> bool:
    """Return whether the arrays of a message (`leaves`) are all empty, as some publishers begin; false without any."""
    return bool(found) and not any(numbers.size for _, numbers in found)


def values(message: Any, path: str) -> NDArray[Any]:
    """Return the numbers of a field, shape (n,), or (rows, columns) of an image.

    Raises
    ------
    LookupError : there is no such field, or it holds no numbers
    """
    step, _, rest = path.partition(".")
    if isinstance(message, list):
        if step.isascii() and step.isdigit():
            return values(message[int(step)], rest)
        each = [values(part, path).reshape(-1) for part in message]
        return np.concatenate(each) if each else np.empty(0)
    if step:
        if not is_dataclass(message) or not hasattr(message, step):
            raise LookupError(step)
        return values(getattr(message, step), rest)
    if isinstance(message, np.ndarray) and message.dtype.kind in "uifb":
        return message
    if isinstance(message, int | float | np.number):
        return np.array([message])
    if _type(message) == IMAGE:
        return _pixels(message)
    raise LookupError(path)


def grid(message: Any, path: str) -> tuple[int, int] | None:
    """Return rows and columns of a field, if the message states them: of an image, or of a std_msgs multi-array."""
    parent, _, last = path.rpartition(".")
    try:
        for step in filter(None, parent.split(".")):
            message = message[int(step)] if isinstance(message, list) else getattr(message, step)
        inner = getattr(message, last) if last else message
    except (LookupError, AttributeError, ValueError):  # of a list of messages
        return None
    if _type(inner) == IMAGE:
        return int(inner.height), int(inner.width)
    if _type(message).startswith("std_msgs/msg/") and _type(message).endswith("MultiArray"):
        sizes = tuple(int(dimension.size) for dimension in message.layout.dim)
        if len(sizes) == 2 and sizes[0] * sizes[1] == len(message.data) and not message.layout.data_offset:
            return sizes
    return None


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


def _type(value: Any) -> str:
    return str(getattr(value, "__msgtype__", ""))
