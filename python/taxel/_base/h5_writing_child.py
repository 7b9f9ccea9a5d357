"""Writes a .h5 in a child process, which is run by the path of this file (`taxel._base.h5_writing`).

HDF5 crashes some time after a write has failed, and has lost the reason by then. So Python writes for it, and the first
write that fails ends the process, which first says why.
"""

import importlib
import io
import json
import os
import sys
from typing import Any, NoReturn


def main() -> None:
    """Write the file that the parent names by the function that it names."""
    part, module, function = sys.argv[1:]
    sys.path[:] = json.loads(sys.stdin.buffer.readline())
    try:
        write = getattr(importlib.import_module(module), function)
        with FailFastFile(part, "r+") as file:
            write(file, sys.stdin.buffer)
            file.flush_to_disk()
    except BaseException as error:
        line = (str(error).splitlines() or [""])[0][:200] or type(error).__name__
        end(error=line, kind=type(error).__name__)
    end(done=True)


def end(**answer: Any) -> NoReturn:
    """Give the answer and end, without the library's cleaning up, in which it may crash."""
    print(json.dumps(answer), flush=True)
    os._exit(0)


class FailFastFile(io.FileIO):
    """A file at which HDF5 never sees an error: the first one ends the process."""

    def readinto(self, buffer: Any) -> int:
        """Read into a buffer."""
        try:
            return super().readinto(buffer) or 0
        except OSError as error:
            end(errno=error.errno)

    def write(self, data: Any) -> int:
        """Write all of the data."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while left:
                left = left[super().write(left) :]
        except OSError as error:
            end(errno=error.errno)
        return size

    def truncate(self, size: int | None = None) -> int:
        """Cut or lengthen the file."""
        try:
            return super().truncate(size)
        except OSError as error:
            end(errno=error.errno)

    def flush_to_disk(self) -> None:
        """Wait until the disk has the file: some systems find only then that it is full."""
        try:
            os.fsync(self.fileno())
        except OSError as error:
            end(errno=error.errno)


if __name__ == "__main__":
    main()
