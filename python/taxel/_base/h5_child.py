"""Reads a .h5 in a child process, which is run by the path of this file (`taxel._base.h5_file`) without taxel.

It writes lines of JSON to its standard output: first that it runs, then a line for each entry that it has listed and
one with all of them; then, for each request on its standard input, a line for each piece that it has read into the
shared memory, and one at the end.
"""

import json
import mmap
import signal
import sys
from collections.abc import Iterator
from typing import Any

#: Bytes that are read at once; a line is written after each such piece.
PIECE = 4 << 20
#: Where the library has returned nothing for so long, s, as it may on a damaged file, the child ends by itself: its
#: parent ends it much sooner, unless it was killed.
LIMIT_S = 60


def main() -> None:
    """Answer requests until there are no more."""
    path, memory = sys.argv[1], int(sys.argv[2])
    sys.path[:] = json.loads(sys.stdin.readline())
    import h5py  # noqa: PLC0415  its path was read just now

    send(running=True)
    try:
        with h5py.File(path) as h5:
            send(attributes={name: whole(value) for name, value in h5.attrs.items()}, entries=entries(h5, h5py))
            for order in orders():
                if order["text"]:
                    send(done=str(h5[order["name"]].asstr()[()]))
                else:
                    read(h5[order["name"]], memory, order["at"], order["size"])
    # The errors that h5py raises on damage are not documented.
    except BaseException as error:
        send(error=(str(error).splitlines() or [""])[0][:200], kind=type(error).__name__)


def orders() -> Iterator[Any]:
    """Yield the requests; to wait for one is no reason to end."""
    signal.alarm(0)
    for line in sys.stdin:
        signal.alarm(LIMIT_S)
        yield json.loads(line)
        signal.alarm(0)


def send(**message: Any) -> None:
    """Write a line, from which on the limit counts anew."""
    signal.alarm(LIMIT_S)
    print(json.dumps(message), flush=True)


def whole(value: Any) -> int | None:
    """Return a whole number; None for any other value."""
    try:
        return int(value)
    except (TypeError, ValueError):
        return None


def entries(h5: Any, h5py: Any) -> dict[str, Any]:
    """Return the dtype ("text", or "" for a group) and the shape of each entry, those within groups by their path."""
    described: dict[str, Any] = {}
    # A group may be linked within itself; it is listed by its first path only.
    seen, left = {place(h5, h5py)}, [("", h5)]
    while left:
        before, group = left.pop()
        inner = []
        for name in group:
            # A soft link may lead nowhere; a hard one only in a damaged file.
            is_hard = isinstance(group.get(name, getlink=True), h5py.HardLink)
            data, path = group[name] if is_hard else group.get(name), before + name
            if isinstance(data, h5py.Group):
                described[path] = ["", []]
                if (at := place(data, h5py)) not in seen:
                    seen.add(at)
                    inner.append((f"{path}/", data))
            elif isinstance(data, h5py.Dataset):
                described[path] = [dtype_of(data, h5py), list(data.shape or [])]
            elif data is not None:
                described[path] = ["", []]
            send(listed=path)
        left += reversed(inner)
    return described


def place(group: Any, h5py: Any) -> tuple[int, int]:
    """Return what tells a group from all others: its file and its address there."""
    info = h5py.h5o.get_info(group.id)
    return info.fileno, info.addr


def dtype_of(data: Any, h5py: Any) -> str:
    """Return the dtype of a data set; "text", or "empty" for one without a shape."""
    if data.shape is None:
        return "empty"
    if h5py.check_string_dtype(data.dtype) is not None:
        return "text"
    return str(data.dtype.str if data.dtype.kind in "biuf" else data.dtype)


def read(data: Any, memory: int, at: int, size: int) -> None:
    """Read a data set into the shared memory, beginning at a byte offset."""
    import numpy as np  # noqa: PLC0415  h5py has loaded it

    if size:
        # It is unmapped with the array's last reference, which an error's traceback may hold.
        shared = mmap.mmap(memory, at + size)
        array = np.frombuffer(shared, data.dtype, data.size, at).reshape(data.shape)
        if data.ndim == 0:
            array[()] = data[()]
        else:
            # A piece is at least one chunk of the file, as chunks are unpacked whole.
            rows = max(1, PIECE // max(1, size // len(data)), (data.chunks or (1,))[0])
            for k in range(0, len(data), rows):
                part = np.s_[k : k + rows]
                data.read_direct(array, part, part)
                send(read=k)
    send(done=None)


if __name__ == "__main__":
    main()
