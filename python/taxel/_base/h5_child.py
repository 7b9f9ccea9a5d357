"""Reads a .h5 in a child process, which is run by the path of this file (`taxel._base.h5_file`) without taxel.

The parent writes a line of JSON for each request, the first with its `sys.path`. The child writes lines of JSON: that
it runs; the entries of the file, one each; then, for each request, a line before each piece of the
values, which follows as bytes, and one at the end.

The file is a stranger's, so the child neither opens another file nor takes more memory than `MEMORY`:

- It walks the hard links first, without a value being read, and refuses the file if a link or a data set leads to
  another file. Soft links are followed only then: a path through them reaches no other links than these.
- While it does so, the limit on descriptors is 0, so that the system refuses what the checks may miss. Windows has no
  such limit.
"""

import contextlib
import itertools
import json
import math
import os
import sys
from collections.abc import Iterator
from typing import Any

#: Bytes that are read at once, unless a packed chunk of the file has more.
PIECE = 4 << 20
#: Bytes of a chunk that can be read in whole only, as it is packed: 32 MiB.
CHUNK = 1 << 25
#: Bytes of all paths and names, with a share for each.
LISTED, SHARE = 1 << 24, 64
#: Bytes that the child may take beyond its libraries.
MEMORY = 192 << 20
#: Bytes of the texts of a data set: 64 MiB; and how often a text that the file holds may be in memory on its way.
TEXT, COPIES = 1 << 26, 4
#: Characters of the longest text of an attribute that is read.
WORD = 40
#: Bytes that the parent lets this process have where the process cannot limit itself (`taxel._base.windows_job`).
JOB_MEMORY = 1 << 30


class Refused(Exception):  # noqa: N818  what the file holds is no error of this program
    """Says why a file is not read, and the path of the entry."""


def main() -> None:
    """Answer requests until there are no more."""
    path = sys.argv[1]
    sys.path[:] = json.loads(sys.stdin.readline())
    # HDF5 loads plug-ins from these folders: not from one that depends on the current folder.
    folders = [folder for folder in os.environ.pop("HDF5_PLUGIN_PATH", "").split(os.pathsep) if os.path.isabs(folder)]
    if folders:
        os.environ["HDF5_PLUGIN_PATH"] = os.pathsep.join(folders)
    import h5py  # noqa: PLC0415  its path was read just now
    import numpy as np  # noqa: F401, PLC0415  no module can be loaded later

    send(running=True)
    most = begin = memory()
    try:
        most = bound_memory(begin + MEMORY)
        with h5py.File(path) as h5, files(allowed=False):
            listing = Listing(h5, h5py)
            listing.entries()
            send(listed=True)
            for order in orders():
                if "attribute" in order:
                    send(done=listing.attribute(order["entry"], order["attribute"]))
                    continue
                if "attributes" in order:
                    send(done=listing.attributes(order["attributes"]))
                    continue
                data = h5py.Dataset(listing.opened(order["name"]))
                if order["text"]:
                    most = bound_memory(begin + MEMORY + COPIES * min(TEXT, os.stat(path).st_size))
                    send_texts(data)
                else:
                    send_numbers(data)
                send(done=None)
    except Refused as error:
        send(refused=error.args[0], entry=error.args[1])
    # The errors that h5py raises on damage are not documented.
    except BaseException as error:
        if isinstance(error, MemoryError) or "memory allocation failed" in str(error):
            send(refused=f"needs more than {most - begin} bytes of memory in addition to its values", entry="")
        else:
            send(error=(str(error).splitlines() or [type(error).__name__])[0][:200])


def orders() -> Iterator[Any]:
    """Yield the requests."""
    yield from map(json.loads, sys.stdin)


def send(*pieces: Any, **message: Any) -> None:
    """Write a line and the bytes that follow it."""
    sys.stdout.buffer.write(json.dumps(message).encode() + b"\n")
    for piece in pieces:
        sys.stdout.buffer.write(piece)
    sys.stdout.buffer.flush()


if sys.platform == "win32":

    def memory() -> int:
        """Return 0: bytes count from the start of the process on."""
        return 0

    def bound_memory(_most: int) -> int:
        """Return the limit of this process's memory, which its parent has set."""
        return JOB_MEMORY

    @contextlib.contextmanager
    def files(*, allowed: bool) -> Iterator[None]:  # noqa: ARG001  as elsewhere
        """Leave it to the checks that no other file is opened."""
        yield

else:
    import resource

    #: What the system lets this process have from its start on.
    INHERITED = resource.getrlimit(resource.RLIMIT_AS)

    def memory() -> int:
        """Return the bytes that this process has asked for; a very large number where the system does not say."""
        try:
            with open("/proc/self/statm", encoding="ascii") as file:
                return int(file.read().split()[0]) * resource.getpagesize()
        except (OSError, ValueError):
            return 1 << 50

    def bound_memory(most: int) -> int:
        """Limit what this process may ask for; return the limit."""
        least = min([most, *(limit for limit in INHERITED if limit != resource.RLIM_INFINITY)])
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_AS, (least, INHERITED[1]))
        return least

    @contextlib.contextmanager
    def files(*, allowed: bool) -> Iterator[None]:
        """Let files be opened within the block, or none."""
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard if allowed else 0, hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


class Listing:
    """Send what a file holds, and open its data sets.

    Parameters
    ----------
    h5 : h5py.File
    h5py : module
    """

    def __init__(self, h5: Any, h5py: Any) -> None:
        self.h5, self.h5py = h5, h5py
        self.size = 0
        #: Numbers of filters; those that are not built in are loaded while a file may be opened.
        self.filters: set[int] = set()

    def count(self, name: str) -> None:
        """Count a name; refuse more than may be listed."""
        self.size += len(name) + SHARE
        if self.size > LISTED:
            raise Refused(
                f"too many names in this file: their paths have more than {LISTED} bytes, with {SHARE} added for each",
                name,
            )

    def attributes(self, entry: str) -> list[str]:
        """Return the names of the attributes of an entry."""
        names = list(self.h5[entry].attrs)
        for name in names:
            self.count(name)
        return names

    def attribute(self, entry: str, name: str) -> int | float | str | None:
        """Return an attribute: a number, a short text, "" for another value, None if it is missing."""
        attributes = self.h5[entry].attrs
        if name not in attributes:
            return None
        about = attributes.get_id(name)
        kind = dtype_of(about, self.h5py)
        if about.shape not in ((), (1,)) or not (kind == "text" or kind[1:2] in ("i", "u", "f")):
            return ""
        value = attributes[name]
        value = value if isinstance(value, str | bytes) else value.item()
        if isinstance(value, int | float):
            return value
        word = value.decode(errors="replace") if isinstance(value, bytes) else value
        return word if len(word) <= WORD else ""

    def entries(self) -> None:
        """Send groups and data sets by their paths; those that only a soft link names after all others."""
        soft = []
        # A group may be linked within itself; it is listed by its first path only.
        seen, left = {self.address(self.h5.id)}, [(b"", self.h5.id, iter(self.h5.id))]
        while left:
            before, group, names = left[-1]
            name = next(names, None)
            if name is None:
                left.pop()
                continue
            path = before + name
            self.count(text := text_of(path))
            kind = group.links.get_info(name).type
            if kind == self.h5py.h5l.TYPE_EXTERNAL:
                raise Refused("a link to another file (an external link)", text)
            if kind == self.h5py.h5l.TYPE_SOFT:
                soft.append((path, text_of(group.links.get_val(name))[:80]))
            elif kind == self.h5py.h5l.TYPE_HARD:
                data = self.h5py.h5o.open(group, name)
                self.send_entry(path, data)
                if isinstance(data, self.h5py.h5g.GroupID) and (at := self.address(data)) not in seen:
                    seen.add(at)
                    left.append((path + b"/", data, iter(data)))
        for path, target in soft:
            try:
                data = self.h5py.h5o.open(self.h5.id, path)
            # A link that leads nowhere, or in a circle, is an error of another class for each reason.
            except Exception as error:
                why = str(error).partition("(")[2].partition(")")[0] or type(error).__name__
                send(left_out=text_of(path), target=target, why=why)
            else:
                self.send_entry(path, data)

    def send_entry(self, path: bytes, data: Any) -> None:
        """Send the dtype ("text", or "" for anything except a data set) and the shape of an entry."""
        dtype, shape = "", ()
        if isinstance(data, self.h5py.h5d.DatasetID):
            self.check(path, data)
            dtype, shape = dtype_of(self.h5py.Dataset(data), self.h5py), data.shape or ()
        send(entry=text_of(path), dtype=dtype, shape=shape)

    def opened(self, path: str) -> Any:
        """Return a data set that was listed, checked again, so that it is read as it was checked."""
        data = self.h5py.h5o.open(self.h5.id, path.encode())
        self.check(path.encode(), data)
        return data

    def check(self, path: bytes, data: Any) -> None:
        """Refuse a data set whose values are in another file."""
        how = data.get_create_plist()
        if how.get_external_count():
            raise Refused("its values are in another file (external storage)", text_of(path))
        if how.get_layout() == self.h5py.h5d.VIRTUAL:
            # A file names itself by a dot.
            if any(how.get_virtual_filename(k) != "." for k in range(how.get_virtual_count())):
                raise Refused("its values are in another file (a virtual data set)", text_of(path))
            return
        for code in {how.get_filter(k)[0] for k in range(how.get_nfilters())} - self.filters:
            self.filters.add(code)
            with files(allowed=True):
                self.h5py.h5z.filter_avail(code)

    def address(self, group: Any) -> tuple[int, int]:
        """Return what tells a group from all others: its file and its address there."""
        info = self.h5py.h5o.get_info(group)
        return info.fileno, info.addr


def text_of(path: bytes) -> str:
    """Return a path as a text."""
    return path.decode(errors="backslashreplace")


def dtype_of(data: Any, h5py: Any) -> str:
    """Return the dtype of a data set or an attribute; "text", or "empty" for one without a shape."""
    if data.shape is None:
        return "empty"
    try:
        dtype = data.dtype
    # Not every type of HDF5 is one of NumPy.
    except (TypeError, ValueError):
        return "unknown"
    if h5py.check_string_dtype(dtype) is not None:
        return "text"
    return str(dtype.str if dtype.kind in "biuf" else dtype)[:80]


def blocks(shape: tuple[int, ...], itemsize: int, chunk: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Yield the parts of an array of at most `PIECE` bytes, or of one chunk: no chunk is in two of them."""
    if 0 in shape:
        return
    steps = [min(step, length) for step, length in zip(chunk, shape, strict=True)]
    for k in reversed(range(len(shape))):
        steps[k] = min(shape[k], max(1, PIECE // (itemsize * math.prod(steps))) * steps[k])
    starts = (range(0, length, step) for length, step in zip(shape, steps, strict=True))
    for start in itertools.product(*starts):
        yield tuple(slice(at, min(at + step, length)) for at, step, length in zip(start, steps, shape, strict=True))


def packed_chunk(data: Any) -> tuple[int, ...]:
    """Return the shape of the parts of a data set that can be read in whole only."""
    if data.chunks is None or not data.id.get_create_plist().get_nfilters():
        return (1,) * len(data.shape)
    if (size := math.prod(data.chunks) * data.dtype.itemsize) > CHUNK:
        raise Refused(f"has compressed chunks of {size} bytes; at most {CHUNK} are read", data.name)
    return tuple(int(length) for length in data.chunks)


def send_numbers(data: Any) -> None:
    """Send the values of a data set, block after block."""
    import numpy as np  # noqa: PLC0415  h5py has loaded it

    for block in blocks(data.shape, data.dtype.itemsize, packed_chunk(data)):
        values = np.ascontiguousarray(data[block])
        send(values.reshape(-1).view(np.uint8), block=[(side.start, side.stop) for side in block], size=values.nbytes)


def send_texts(data: Any) -> None:
    """Send the texts of a data set in the order of its places, each in UTF-8, some at a time."""
    if (size := data.size * data.dtype.itemsize) > TEXT:
        raise Refused(f"has {size} bytes of text; at most {TEXT} are read", data.name)
    packed_chunk(data)
    for block in blocks(data.shape, PIECE >> 10, (1,) * data.ndim):
        values = data.asstr()[block]
        texts = [string.encode() for string in ([values] if data.ndim == 0 else values.flat)]
        send(*texts, lengths=[len(text) for text in texts])


if __name__ == "__main__":
    main()
