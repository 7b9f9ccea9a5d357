"""Reads a .h5 in a process of its own, run by its path (`taxel._base.h5_file`): it knows nothing of taxel.

It answers in lines of JSON on its standard output: first that it runs, then what the file holds; then, for each order
on its standard input, a line for each piece that it has read into the shared memory, and one when it is done.
"""

import json
import mmap
import sys
from typing import Any

#: What is read at once, bytes: a line is said after each.
PIECE = 4 << 20


def main() -> None:
    """Answer orders until there are no more."""
    path, memory = sys.argv[1], int(sys.argv[2])
    sys.path[:] = json.loads(sys.stdin.readline())
    import h5py  # noqa: PLC0415  where it lies was read just now

    send(running=True)
    try:
        with h5py.File(path) as h5:
            send(attributes={name: whole(value) for name, value in h5.attrs.items()}, entries=entries(h5, h5py))
            for line in sys.stdin:
                order = json.loads(line)
                if order["text"]:
                    send(done=str(h5[order["name"]].asstr()[()]))
                else:
                    read(h5[order["name"]], memory, order["at"], order["size"])
    # What h5py raises on damage is no closed list.
    except BaseException as error:
        send(error=(str(error).splitlines() or [""])[0][:200], kind=type(error).__name__)


def send(**message: Any) -> None:
    """Write a line."""
    print(json.dumps(message), flush=True)


def whole(value: Any) -> int | None:
    """Return a whole number; None of anything else."""
    try:
        return int(value)
    except (TypeError, ValueError):
        return None


def entries(h5: Any, h5py: Any) -> dict[str, Any]:
    """Return what each entry of the root is: its kind of numbers ("text", "" of a group) and its shape."""
    described = {}
    for name in h5:
        data = h5[name]
        if not isinstance(data, h5py.Dataset):
            described[name] = ["", []]
        elif h5py.check_string_dtype(data.dtype) is not None:
            described[name] = ["text", list(data.shape)]
        else:
            described[name] = [data.dtype.str if data.dtype.kind in "biuf" else str(data.dtype), list(data.shape)]
    return described


def read(data: Any, memory: int, at: int, size: int) -> None:
    """Read a data set into the shared memory, from a byte on."""
    import numpy as np  # noqa: PLC0415  h5py has loaded it

    if size:
        with mmap.mmap(memory, at + size) as shared:
            array = np.frombuffer(shared, data.dtype, data.size, at).reshape(data.shape)
            if data.ndim == 0:
                array[()] = data[()]
            else:
                # A piece is never less than the file's own, which is unpacked whole.
                rows = max(1, PIECE // max(1, size // len(data)), (data.chunks or (1,))[0])
                for k in range(0, len(data), rows):
                    part = np.s_[k : k + rows]
                    data.read_direct(array, part, part)
                    send(read=k)
            del array
    send(done=None)


if __name__ == "__main__":
    main()
