"""Makes small ROS bags with rosbags itself: a palm, a hand of fingers, images."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

#: 2026-11-23 in ns, near to what robots write.
BEGIN_NS = 1_795_000_000_000_000_000
PALM, HAND, SKIN = "skins_msgs/msg/Palm", "skins_msgs/msg/Hand", "skins_msgs/msg/Skin"
STATE, SIDE = "skins_msgs/msg/State", "skins_msgs/msg/Side"
#: Custom messages: a palm of 24 x 32 where less means more pressure, fingers, and a list of sensors.
DEFINITIONS = {
    PALM: "std_msgs/Header header\nint16[768] taxels\n",
    HAND: "std_msgs/Header header\nfloat64[] thumb\nfloat64[] index\nstring note\n",
    SKIN: "skins_msgs/Patch[] patches\n",
    "skins_msgs/msg/Patch": "uint8 number\nuint16[] taxels\nskins_msgs/Force[] forces\n",
    "skins_msgs/msg/Force": "float32 x\nfloat32 z\n",
    STATE: "std_msgs/Header header\nskins_msgs/Channel[] sensors\n",
    "skins_msgs/msg/Channel": "string name\nfloat32[] values\n",
    SIDE: "string hand\nskins_msgs/Labelled skin\n",
    "skins_msgs/msg/Labelled": "string[] channels\nfloat32[] values\n",
}

#: A message, by the types of a store: what its constructor is called with.
Make = Callable[[dict[str, Any], int], Any]


def store(ros: Stores = Stores.ROS2_HUMBLE) -> Typestore:
    """Return the types of a release of ROS and the custom ones."""
    made = get_typestore(ros)
    types: dict[str, Any] = {}
    for name, text in DEFINITIONS.items():
        types |= get_types_from_msg(text, name)
    made.register(types)
    return made


def header(types: dict[str, Any], ns: int) -> Any:
    """Return a header with a stamp; of ROS 1 it has a number too."""
    stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    make = types["std_msgs/msg/Header"]
    number = {"seq": 0} if "seq" in make.__dataclass_fields__ else {}
    return make(**number, stamp=stamp, frame_id="palm")


def palm(values: Any) -> Make:
    """Return the maker of a message of a palm."""
    return lambda types, ns: types[PALM](header(types, ns), np.asarray(values, np.int16).reshape(-1))


def hand(thumb: Sequence[float], index: Sequence[float]) -> Make:
    """Return the maker of a message of a hand."""
    return lambda types, ns: types[HAND](header(types, ns), np.array(thumb, float), np.array(index, float), "")


def array_of(dtype: type[Any]) -> str:
    """Return the std_msgs multi-array of a type of numbers."""
    name = np.dtype(dtype).name.replace("uint", "UInt").capitalize().replace("Uint", "UInt")
    return f"std_msgs/msg/{name}MultiArray"


def multi_array(values: Any, sizes: Sequence[int], dtype: type[Any] = np.int16) -> Make:
    """Return the maker of a std_msgs multi-array whose layout has these dimensions, as publishers fill it in."""

    def make(types: dict[str, Any], _: int) -> Any:
        dimension = types["std_msgs/msg/MultiArrayDimension"]
        strides = np.cumprod([*sizes[::-1]])[::-1]
        dims = [
            dimension(f"d{k}", size, int(stride)) for k, (size, stride) in enumerate(zip(sizes, strides, strict=True))
        ]
        layout = types["std_msgs/msg/MultiArrayLayout"](dims, 0)
        return types[array_of(dtype)](layout, np.asarray(values, dtype).reshape(-1))

    return make


def image(pixels: Any, encoding: str, *, padding: int = 0, big: bool = False) -> Make:
    """Return the maker of an image, with so many unused bytes at the end of each row."""
    pixels = np.asarray(pixels)
    lines = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<")).view(np.uint8).reshape(len(pixels), -1)
    data = np.pad(lines, ((0, 0), (0, padding)), constant_values=255)

    def make(types: dict[str, Any], ns: int) -> Any:
        rows, columns = pixels.shape[:2]
        of = types["sensor_msgs/msg/Image"]
        return of(header(types, ns), rows, columns, encoding, int(big), data.shape[1], data.reshape(-1))

    return make


def compressed(types: dict[str, Any], ns: int) -> Any:
    """A CompressedImage."""
    return types["sensor_msgs/msg/CompressedImage"](header(types, ns), "png", np.zeros(9, np.uint8))


def cloud(types: dict[str, Any], ns: int) -> Any:
    """A PointCloud2 of two points."""
    field = types["sensor_msgs/msg/PointField"]("x", 0, 7, 1)
    return types["sensor_msgs/msg/PointCloud2"](
        header(types, ns), 1, 2, [field], False, 4, 8, np.zeros(8, np.uint8), True
    )


def skin(patches: Sequence[tuple[Sequence[int], Sequence[float]]]) -> Make:
    """Return the maker of a message of several sensors, each of taxels and of forces along z."""

    def make(types: dict[str, Any], _: int) -> Any:
        force, patch = types["skins_msgs/msg/Force"], types["skins_msgs/msg/Patch"]
        made = [
            patch(k, np.array(taxels, np.uint16), [force(-1.0, z) for z in forces])
            for k, (taxels, forces) in enumerate(patches)
        ]
        return types[SKIN](made)

    return make


def state(channels: dict[str, Sequence[float]]) -> Make:
    """Return the maker of a message of channels, each with its name, in their order."""

    def make(types: dict[str, Any], ns: int) -> Any:
        made = [types["skins_msgs/msg/Channel"](name, np.array(v, np.float32)) for name, v in channels.items()]
        return types[STATE](header(types, ns), made)

    return make


def side(hand: str, channels: dict[str, float]) -> Make:
    """Return the maker of a message of a hand, whose channels are named within it."""
    values = np.array([*channels.values()], np.float32)
    return lambda types, _: types[SIDE](hand, types["skins_msgs/msg/Labelled"]([*channels], values))


#: One message: topic, type, the bag's time and the stamp in ms after the beginning (None: a stamp of 0), its maker.
Message = tuple[str, str, float, float | None, Make]


def write(path: Path, messages: Iterable[Message], *, pack: str = "") -> Path:
    """Write a bag of the kind that the ending says; without an ending a folder of a .db3.

    `pack` is "bz2" or "lz4" of a .bag, "storage" of a .mcap, "file" or "message" of a folder.
    """
    ros1 = path.suffix == ".bag"
    types = store(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = rosbag2.StoragePlugin.MCAP if path.suffix == ".mcap" else rosbag2.StoragePlugin.SQLITE3
        folder = path.with_name(f"{path.stem} parts") if path.suffix else path
        writer = rosbag2.Writer(folder, version=9, storage_plugin=plugin)
    if pack and ros1:
        writer.set_compression(rosbag1.Writer.CompressionFormat[pack.upper()])
    elif pack:
        writer.set_compression(rosbag2.CompressionMode[pack.upper()], rosbag2.CompressionFormat.ZSTD)
    serialize = types.serialize_ros1 if ros1 else types.serialize_cdr
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, bag_ms, stamp_ms, make in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            stamp = 0 if stamp_ms is None else BEGIN_NS + round(stamp_ms * 1e6)
            message = make(types.types, stamp)
            writer.write(connections[topic], BEGIN_NS + round(bag_ms * 1e6), serialize(message, kind))
    if path.suffix and not ros1:
        (inner,) = (file for file in folder.iterdir() if file.suffix == path.suffix)
        inner.rename(path)
        (folder / "metadata.yaml").unlink()
        folder.rmdir()
    return path
