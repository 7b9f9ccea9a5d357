"""Writes HDF5 by a child process: the library crashes where a disk is full."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, cast

from taxel._base.child_process import ChildProcess, pipe_may_be_closed, search_path
from taxel._base.files import whole_file
from taxel._core import Error

_CHILD = Path(__file__).with_name("h5_writing_child.py")


def write_h5(
    path: str | os.PathLike[str],
    write: Callable[[BinaryIO, BinaryIO], object],
    send: Callable[[BinaryIO], object],
    *,
    overwrite: bool = False,
) -> None:
    """Write an HDF5 file as a whole, or nothing.

    Parameters
    ----------
    path : path
    write : function of two binary files
        A function of a module, which the child process calls: it writes the first file from what it reads of the other.
    send : function of a binary file
        Called in this process: it writes what `write` reads.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    FileExistsError : the file is there already and `overwrite` is false
    OSError : the folder is missing, the disk is full ...
    MemoryError : the child process has not enough memory
    ImportError : a library that `write` needs is missing
    Error : the library failed for another reason
    """
    with whole_file(path, overwrite=overwrite) as part:
        child = ChildProcess(
            _CHILD,
            [part, write.__module__, write.__qualname__],
            unfinished=[part],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert child.stdin is not None  # pipes
        assert child.stdout is not None
        try:
            # A child that has failed reads no more, and has reported why.
            with pipe_may_be_closed(), child.stdin as pipe:
                pipe.write(json.dumps(search_path()).encode() + b"\n")
                send(cast(BinaryIO, pipe))
            reply = child.stdout.read()
        except BaseException:
            child.kill()
            raise
        finally:
            child.stdout.close()
            code = child.wait()
        answer: dict[str, Any] = json.loads(reply or "{}")
        if "errno" in answer:
            raise OSError(answer["errno"], os.strerror(answer["errno"]))
        if answer.get("kind") == "MemoryError":
            raise MemoryError(answer["error"])
        if answer.get("kind") == "ModuleNotFoundError":
            raise ModuleNotFoundError(answer["error"])
        if "done" not in answer:
            why = answer.get("error", f"the library crashed while writing it, status {code}")
            raise Error(f"{path}: HDF5 cannot be written ({why})")
